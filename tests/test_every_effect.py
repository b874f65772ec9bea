"""The contract of an effect, on all of EFFECTS at every target: one place, null is absent to the last bit, exact sensitivities,
visible at its listed size, recovered from a simulated flight, and a survivor of its own file (tests/physics/test_declaration.py)."""

from types import SimpleNamespace

import numpy as np
import pytest
from kites import DEVELOPMENT, PLAUSIBLE, POWERED, at_point, every_key, home, inputs_of_one_for, lively, sizes, truly, with_free

from awescli.estimation.fit import fit
from awescli.estimation.misfit import Misfit
from awescli.notation.quantities import MEASURED, OUTPUTS
from awescli.physics.effects import EFFECTS
from awescli.physics.effects.base import PLACES, Effect
from awescli.physics.kite import Kite, make_effect
from awescli.simulation.rollout import Columns, Simulator

KEYS = every_key()


def null(effect: Effect) -> dict[str, float]:
    return {p.name: p.value for p in effect.rows()}


def strengths(effect: Effect) -> list[str]:
    """Full names of the parameters that are no mere shapes."""
    return [f"{effect.key}.{p.name}" for p in effect.parameters if p.name not in effect.shapes]


@pytest.fixture(scope="module")
def bares(calm):
    """The kites without any effect, the powered one too: name -> (simulator, lively segments, what it flies on them)."""
    found = {}
    for name, declaration in (("development", DEVELOPMENT), ("powered", POWERED)):
        kite = Kite(declaration, calm.log.wind.height)
        simulator, observed = Simulator(kite, ()), lively(kite, calm.log)
        found[name] = simulator, observed, simulator.rollout(observed.segments)
    return found


@pytest.fixture
def bare(bares, one, calm):
    """The kite on which the effect acts, without it, and what it flies; the same segments with all inputs that the effect asks for."""
    simulator, _, without = bares["powered" if home(one[0].key) is POWERED else "development"]
    return simulator, lively(one[1], calm.log), without


@pytest.fixture(scope="module", params=KEYS)
def one(request, calm):
    """One effect on the kite: (effect, kite, simulator differentiable in its parameters)."""
    kite = Kite(home(request.param), calm.log.wind.height, (request.param,))
    effect = next(e for e in kite.effects if e.key == request.param)
    return effect, kite, Simulator(kite, tuple(p.name for p in effect.rows()))


@pytest.mark.parametrize("key", [*KEYS, *(n for n, e in EFFECTS.items() if e.always)])
def test_an_effect_acts_at_exactly_one_place(key):
    """Guards the contract that lets the tracer treat all candidates alike; states only with rates and starts of their own."""
    effect = make_effect(key, home(key))
    filled = [p for p in PLACES if getattr(type(effect), p) is not getattr(Effect, p)]
    assert filled == [effect.place]
    own_motion = [getattr(type(effect), n) is not getattr(Effect, n) for n in ("rates", "initial")]
    assert own_motion == [bool(effect.states)] * 2
    assert len(effect.state_units()) == len(effect.states)
    assert effect.name == key.partition(":")[0] and effect.doc and all(p.source for p in effect.parameters)
    null = SimpleNamespace(**{p.name: p.value for p in effect.parameters})
    spreads = effect.start_spreads(null)
    assert len(spreads) == len(effect.states) and all(s > 0 for s in spreads)


@pytest.mark.parametrize("key", KEYS)
def test_an_effect_writes_nothing_into_the_instant(key):
    """Guards the pure contract: the states of an instant are those of the vector, whatever an effect wants to remember for its rates."""
    kite = Kite(DEVELOPMENT, extra=(key,)).with_values(sizes(key))
    x, u, c = at_point(kite)
    at = kite.instant(x, u, c)
    assert at.states == dict(zip(kite.state_names[12:], x[12:], strict=False))
    assert at.inputs == dict(zip(kite.input_names, u, strict=True)) and at.values == dict(zip(kite.parameter_names, c, strict=True))


def test_the_tables_of_the_tests_are_complete():
    """Guards this file: an effect that is added to EFFECTS must get a plausible size here."""
    assert set(PLAUSIBLE) == {n for n, e in EFFECTS.items() if not e.always}
    for key in KEYS:
        effect = make_effect(key, DEVELOPMENT)
        assert set(strengths(effect)) <= set(sizes(key)) <= {p.name for p in effect.rows()}


def test_null_changes_nothing_to_the_last_bit(one, bare):
    """Guards "absent": at null a kite with the effect flies and reports, compiled, exactly what the kite without it does."""
    effect, kite, simulator = one
    _, observed, without = bare
    flown = simulator.rollout(observed.segments)
    assert np.array_equal(flown.outputs, without.outputs)
    assert np.array_equal(flown.states[:, :, :12], without.states[:, :, :12])
    assert np.array_equal(flown.alive, without.alive)


def test_null_changes_nothing_on_plain_floats(one, bare):
    """Guards the same on the uncompiled physics, where no simplification of a tape could hide a difference."""
    effect, kite, _ = one
    simple = bare[0].kite
    for changes in ({}, {"v": -6.0, "w": 9.0, "rudder": -0.3, "phi": 0.9}):
        (x, u, c), (x0, u0, c0) = at_point(kite, **changes), at_point(simple, **changes)
        assert inputs_of_one_for(simple, kite, u) == u0
        assert kite.derivative(x, u, c)[:12] == simple.derivative(x0, u0, c0)
        assert kite.outputs(x, u, c) == simple.outputs(x0, u0, c0)


def test_sensitivities_are_those_of_finite_differences(one, bare, tolerance=2e-5):
    """Guards the exact Jacobian through the whole rollout, for every parameter of the effect, at its plausible size.

    Central differences; kinks (thresholds, rate limits, a table of winds) that fall inside a step set the tolerance.
    """
    effect, kite, simulator = one
    segments = bare[1].segments
    at = {**null(effect), **sizes(effect.key)}
    names = [p.name for p in effect.rows() if p.name != "turbulence.L"]  # read by whoever makes the gusts, not by the physics
    flown, J = simulator.sensitivities(segments, Columns((), tuple(names)), MEASURED, at)
    assert not flown.diverged.any()
    for column, name in enumerate(names):
        p = kite.parameters[name]
        h = 1e-6 * min(p.upper - p.lower, 10 * max(abs(at[name]), 1e-3))
        above, below = (simulator.rollout(segments, {**at, name: at[name] + s * h}).outputs[:, :, : len(MEASURED)] for s in (1, -1))
        central, exact = (above - below) / (2 * h), J[:, :, :, column]
        for i, channel in enumerate(MEASURED):
            scale = np.abs(central[:, :, i]).max()
            rounding = 1e-10 * (1 + np.abs(above[:, :, i]).max()) / h
            error = np.abs(exact[:, :, i] - central[:, :, i]).max()
            assert error <= tolerance * scale + 2e-3 * rounding + 1e-12, (name, channel, error / max(scale, 1e-300))


def test_the_listed_size_is_visible(one, bare):
    """Guards against an effect that is wired to nothing: at its typical size some channel moves by more than its noise within 5 s."""
    effect, kite, simulator = one
    _, observed, without = bare
    flown = simulator.rollout(observed.segments, sizes(effect.key))
    index = [OUTPUTS.index(n) for n in observed.outputs]
    change = np.abs(flown.outputs - without.outputs)[:, :, index] / observed.sigma
    assert not flown.diverged.any() and change.max() > 1.0, change.max()


def test_what_was_flown_is_recovered(one, bare):
    """Guards the path of every effect through the estimator: from null, or from a probe where null has no slope, the strengths
    that a noise-free flight was flown with come back to 1e-3, the segments' starts being unknown too."""
    effect, kite, simulator = one
    observed = truly(bare[1], simulator, sizes(effect.key))
    names = strengths(effect)
    start = {n: v for n, v in sizes(effect.key).items() if n not in names}
    for name in names:
        probe = effect.probes.get(name.rpartition(".")[2])
        if probe:
            start[name] = min(probe, key=lambda v: abs(np.log(v / sizes(effect.key)[name])))
    table = with_free(kite.parameters.with_values(start), names)
    found = fit(Misfit(simulator.holding(table), observed, tuple(names)), table, prior=False, tolerance=1e-9, iterations=40)
    for name in names:
        scale = max(abs(sizes(effect.key)[name] - null(effect)[name]), 0.1 * abs(sizes(effect.key)[name]))
        assert found.parameters[name].value == pytest.approx(sizes(effect.key)[name], abs=1e-3 * scale), (name, found.solution.outcome)


def test_next_to_null_an_effect_weighs_as_much_as_none(one, bare, calm):
    """Guards the evidence of effects with states: a play, a lag, a delay of next to nothing remembers nothing, so that the start of its
    states is nothing that a likelihood would have to pay for."""
    effect, kite, simulator = one
    if not effect.states:
        pytest.skip("no states")
    plain, observed, _ = bare
    slight = {n: null(effect)[n] + 1e-4 * (v - null(effect)[n]) for n, v in sizes(effect.key).items()}
    there = simulator.holding(kite.parameters.with_values({**null(effect), **slight}))
    weights = []
    for s, flown in ((plain, lively(plain.kite, calm.log)), (there, observed)):
        misfit = Misfit(s, flown, ())
        gram = misfit.linear(np.zeros(0), misfit.own()).gram
        weights.append(float(misfit.eliminated(gram, misfit.own()).log_det.sum()))
    assert weights[1] == pytest.approx(weights[0], abs=1.0)
