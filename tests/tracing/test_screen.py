"""Screening: what the residual says about each candidate, beyond what the free parameters can absorb."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from kites import DEVELOPMENT, sizes
from tracing.traced import null_model, short_flight

from awescli.estimation.fit import fit
from awescli.estimation.problem import build, simulator_of
from awescli.notation.quantities import STATES
from awescli.physics.kite import make_effect
from awescli.tracing.candidates import variants
from awescli.tracing.frame import Frame, TracedFlight
from awescli.tracing.models import fit_null
from awescli.tracing.screen import CandidateColumns, Projected, _drawn, _flights, begun, holm, informed, screen

KEYS = ("sideslip_drag", "parasitic_drag", "actuator_lag:rudder", "pitch_curvature", "airspeed_scale", "position_latency",
        "surface_bias:roll", "tether_drag", "lift_stall", "heading_bias")  # fmt: skip
SMALL = {"sideslip_drag": 0.02, "airspeed_scale": 0.2, "pitch_curvature": 0.35}
"""Shares of a plausible size at which nothing but the effect itself is needed to follow the flight."""


def small(key: str) -> tuple:
    """A small effect as `null_model` takes it."""
    null = {p.name: p.value for p in make_effect(key, DEVELOPMENT).parameters}
    values = {n.rpartition(".")[2]: v for n, v in sizes(key).items()}
    return ((key, tuple((n, null[n] + SMALL[key] * (v - null[n])) for n, v in values.items())),)


def test_nothing_is_significant_where_nothing_is_missing():
    """Guards the false alarm: noise alone, ten candidates, and none passes the family-wise test."""
    frame, null = null_model()
    found = screen(frame, null, KEYS)
    assert len(found.scores) >= 8 and not holm([s.p_value for s in found.scores], 0.01).any()


@pytest.mark.parametrize("key", SMALL)
def test_a_score_is_what_a_fit_finds(key):
    """Guards size and drop: the effect in the truth leads, and where it is small its one-step estimate and the predicted fall of the
    deviance are those of a fit of the same segments with its strength free."""
    frame, null = null_model(small(key), seed=37)
    assert not null.rest  # so small that model error is not worth its while
    best = screen(frame, null, KEYS).scores[0]
    assert best.key == key and best.p_value < 1e-3
    problem = null.problems[0]
    simulator = simulator_of(frame.declared, frame.flights[0].log, (key,))
    table = simulator.kite.parameters.with_values({n: null.table[n].value for n in null.table})
    prior = simulator.kite.parameters.with_rows(replace(simulator.kite.parameters[n], std=1e6) for n in best.moving)
    raw = build(simulator.holding(table), problem.log, problem.split, frame.horizon, frame.outputs).with_factors(problem.factors)
    raw = replace(raw, processes=problem.processes, names=problem.names)
    before = fit(raw.misfit(), table, prior_table=prior, tolerance=1e-4)
    after = fit(raw.misfit(names=(*problem.names, *best.moving)), table, prior_table=prior, tolerance=1e-4)
    moved = [after.parameters[n].value - table[n].value for n in best.moving]
    assert np.abs((np.array(moved) - best.size) / best.std).max() < 0.25
    assert best.drop == pytest.approx(before.solution.cost - after.solution.cost, rel=0.05)
    std = np.sqrt(np.diag(after.covariance)[len(problem.names) :])
    assert best.std == pytest.approx(std, rel=0.05)


def test_the_projection_is_least_squares_of_everything_at_once():
    """Guards the elimination of what the free parameters absorb: size, drop and standard deviation of every plain candidate are those of
    one dense regression on all free parameters and its own columns."""
    frame, null = null_model(small("sideslip_drag"), seed=37)
    found = screen(frame, null, KEYS)
    columns = CandidateColumns([v for key in KEYS for v in variants(make_effect(key, frame.declared))])
    H, b = informed(frame, null, KEYS, columns, frame.horizon)
    n, tested = len(null.fit.names), 0
    for s in found.scores:
        at = np.r_[:n, n + np.array(s.place)]
        whole = np.linalg.lstsq(H[np.ix_(at, at)], b[at], rcond=1e-14)[0]
        without = np.linalg.solve(H[:n, :n], b[:n])
        assert s.size == pytest.approx(whole[n:], rel=1e-4, abs=1e-4 * s.std.max())
        assert s.drop == pytest.approx(b[at] @ whole - b[:n] @ without, rel=1e-4, abs=1e-4)
        assert s.std == pytest.approx(np.sqrt(np.diag(np.linalg.inv(H[np.ix_(at, at)]))[n:]), rel=1e-4)
        tested += 1
    assert tested >= 6


GUSTS = ("turbulence", (("sigma", 1.0), ("L", 150.0)))


def test_what_only_makes_gusts_easier_to_see_is_not_significant(monkeypatch):
    """Guards the score in gusts: a stall lowers the squared residual by 40 where there is none, for it makes gusts easier to see, and the
    log determinant takes that back."""
    frame, null = null_model((GUSTS,), seed=42)
    found = screen(frame, null, KEYS)
    assert len(found.scores) >= 8 and not holm([s.p_value for s in found.scores], 0.01).any()
    monkeypatch.setattr("awescli.tracing.screen.gusty", lambda model: False)
    without = screen(frame, null, KEYS).scores[0]
    assert without.key == "lift_stall" and without.drop > 30
    # what no draw can say, for a segment is lost, is left as it is
    monkeypatch.setattr("awescli.tracing.screen.gusty", lambda model: True)
    monkeypatch.setattr("awescli.tracing.screen.estimates", lambda *given, **how: None)
    assert screen(frame, null, KEYS).scores[0].drop == without.drop


def test_what_is_there_stays_significant_in_gusts():
    """Guards the same against a test that sees nothing: a pitot's scale leads in gusts, with its size."""
    frame, null = null_model((GUSTS, *small("airspeed_scale")), seed=42)
    best, *others = screen(frame, null, KEYS).scores
    assert best.key == "airspeed_scale" and best.p_value < 1e-6 and all(s.drop < best.drop / 2 for s in others)
    there = {p.name: -p.value for p in make_effect(best.key, frame.declared).parameters}
    for name, value in small("airspeed_scale")[0][1]:
        there[name] += value
    for name, size, std in zip(best.moving, best.size, best.std, strict=True):
        assert size == pytest.approx(there[name.rpartition(".")[2]], abs=4 * std) and abs(there[name.rpartition(".")[2]]) > 0


def test_flights_that_are_screened_together_add_up():
    """Guards several flights in gusts: what draws say of two that are alike is twice what they say of one, in the same places."""
    frame, null = null_model((GUSTS,), seed=42)
    flights, columns = _flights(frame, null, KEYS[:2], frame.horizon), CandidateColumns(variants(make_effect(KEYS[0], frame.declared)))
    one, two = (_drawn(null, each, columns) for each in (flights, 2 * flights))
    assert two == pytest.approx(2 * one) and one[:, -1].all()


def test_what_draws_say_counts_as_surely_as_they_say_it():
    """Guards the noise of the draws: what they agree on moves the gradient; what they disagree on weighs less; of what they leave more
    uncertain than the candidate itself they say nothing; and what free parameters absorb is theirs."""
    absorbed = np.array([[0.5, 0.0, 0.0]])
    projected = Projected(4.0 * np.eye(3), np.full(3, 10.0), np.full(3, 8.0), absorbed, np.array([0]), np.zeros((3, 3)))
    drawn = np.array([[2.0, -5.0, -4.0, 140.0], [2.0, -5.0, -8.0, -150.0], [2.0, -5.0, -4.0, 140.0], [2.0, -5.0, -8.0, -150.0]])
    found = projected.integrated(drawn)
    assert found.b == pytest.approx([10.0 - 5.0 - 0.5 * 2.0, 10.0 - 6.0, 10.0])
    assert np.diag(found.noise) == pytest.approx([0.0, 16 / 3 / 4, 0.0]) and not found.noise[2].any() and not found.noise[:, 2].any()
    parts = projected.of_columns([2, 1])
    assert parts.absorbed.tolist() == [[0.0, 0.0]] and len(parts.b) == 2


def test_states_that_a_candidate_brings_are_not_drawn():
    """Guards the score of lags and delays in gusts: at null nothing depends on their states, and drawn those made the score uncertain by 37
    standard deviations where it is known to 0.1."""
    frame, null = null_model((GUSTS,), seed=42)
    flight = _flights(frame, null, ("actuator_lag:rudder",), frame.horizon)[0]
    gram = flight.misfit.linear(flight.x, flight.own).gram
    for states, still in ((flight.states, True), (flight.misfit.simulator.kite.state_names, False)):
        drawn = replace(flight, states=states).draws(gram, np.arange(len(gram)))
        assert drawn.states[:, 0, : len(STATES)].any() and drawn.path.any() and drawn.states.shape[2] > len(STATES)
        assert (not drawn.states[:, 0, len(STATES) :].any()) is still


def test_a_one_sided_effect_is_found_through_its_probe():
    """Guards secants: a lag has no slope at null, its difference at a probe leads all the same, with a positive share of about its size."""
    frame, null = null_model((("actuator_lag:rudder", (("tau", 0.1),)),), seed=33)
    best = screen(frame, null, KEYS).scores[0]
    assert best.key == "actuator_lag:rudder" and best.variant.secant and best.size[0] > 0
    assert best.variant.at["actuator_lag:rudder.tau"] * best.size[0] == pytest.approx(0.1, rel=0.5)
    strengths, shapes = best.start(screen(frame, null, KEYS).rows)
    assert 0.03 < strengths["actuator_lag:rudder.tau"] < 0.3 and not set(strengths) & set(shapes)


def with_drag_bounded(upper: float | None):
    """(frame, declared model) of a flight with more constant drag than declared, CD0 bounded above (None: as wide as ever)."""
    declared, log, parts = short_flight({"parasitic_drag": {"dCD": 0.01}}, 35, 50.0, ("CL0", "CD0", "Cndr"))
    if upper is not None:
        row = declared.parameters["CD0"]
        truth = DEVELOPMENT.table()["CD0"].value
        bounded = row.model_copy(update={"value": 0.95 * truth, "lower": 0.5 * truth, "upper": upper * truth, "std": 0.5 * truth})
        declared = declared.model_copy(update={"parameters": {**declared.parameters, "CD0": bounded}})
    frame = Frame((TracedFlight(log, parts, declared),), 2.0, tuple(log.measured))
    return frame, fit_null(frame, {}, (1.0,))


def test_a_parameter_absorbs_an_effect_until_it_is_at_its_bound():
    """Guards the projection and its limit: constant extra drag is CD0 by another name, so with CD0 free only the priors tell them apart;
    where CD0 has come to its bound it takes up nothing any more, and the effect leads with its size."""
    keys, stds = ("parasitic_drag", "sideslip_drag"), []
    for upper, bound in ((None, []), (1.0, ["CD0"])):
        frame, null = with_drag_bounded(upper)
        found = screen(frame, null, keys)
        drag = next(s for s in found.scores if s.key == "parasitic_drag")
        at = drag.moving.index("parasitic_drag.dCD")
        stds.append(drag.std[at])
        assert null.at_bound == bound and holm([s.p_value for s in found.scores], 0.01)[found.scores.index(drag)] == bool(bound)
    assert stds[0] > 5 * stds[1] and drag.size[at] == pytest.approx(0.01, abs=4 * stds[1]) and drag.size[at] > 5 * stds[1]


def test_cosines_are_those_of_directions():
    """Guards the angle between candidates: one with itself, symmetric, and never above one."""
    frame, null = null_model(small("sideslip_drag"), seed=37)
    found = screen(frame, null, KEYS)
    for a in found.scores[:4]:
        assert found.cosine(a, a) == pytest.approx(1.0, abs=1e-6)
        for b in found.scores[:4]:
            assert found.cosine(a, b) == pytest.approx(found.cosine(b, a), abs=1e-6) and 0 <= found.cosine(a, b) <= 1


def test_holm_is_holms():
    """Guards the correction for many tests by a worked example: step down, and stop at the first that fails."""
    assert holm([0.01, 0.04, 0.03, 0.005], level=0.05).tolist() == [True, False, False, True]
    assert holm([0.0021, 0.9, 0.0024], level=0.01).tolist() == [True, False, True]
    assert holm([0.02], level=0.01).tolist() == [False]


def test_variants_are_the_grid_of_shapes_and_probes():
    """Guards how an effect is tried: smooth ones once, shapes and probes on their grids, shapes never as a strength."""
    assert [v.at for v in variants(make_effect("sideslip_drag", DEVELOPMENT))] == [{}]
    lag = variants(make_effect("actuator_lag:rudder", DEVELOPMENT))
    assert len(lag) == 12 and all(v.secant and v.moving == ("actuator_lag:rudder.tau",) for v in lag)
    stall = variants(make_effect("lift_stall", DEVELOPMENT))
    assert len(stall) == 4 and all(not v.secant and v.moving == ("lift_stall.k",) for v in stall)
    assert len({v.label for v in (*lag, *stall)}) == 16


def test_samples_that_do_not_count_have_no_say():
    """Guards invalid samples in the screening: a gross error where a channel does not count changes nothing."""
    frame, null = null_model()
    flight = frame.flights[0]
    at, found = flight.split.train[0][0] + 40, []
    for error in (0.0, 1e3):
        values, counts = flight.log["V_a"].copy(), np.ones(len(flight.log), bool)
        values[at : at + 20] += error
        counts[at : at + 20] = False
        log = replace(flight.log, measured={**flight.log.measured, "V_a": values}, fresh={"V_a": counts})
        problem = build(null.problems[0].simulator, log, flight.split, frame.horizon, frame.outputs)
        there = replace(frame, flights=(replace(flight, log=log),))
        problem = replace(null.problems[0], log=log, fitted=problem.fitted, validation=problem.validation)
        found.append(screen(there, replace(null, problems=(problem,)), KEYS[:4]))
    clean, dirty = found
    assert [s.drop for s in clean.scores] == pytest.approx([s.drop for s in dirty.scores], rel=1e-6)
    assert [s.drop for s in clean.scores] != pytest.approx([s.drop for s in screen(frame, null, KEYS[:4]).scores], rel=1e-6)


@pytest.mark.parametrize("at, seen", [(28.0, "train"), (11.5, "validation"), (19.0, "")])
def test_an_onset_is_sought_all_over_the_flight(at, seen):
    """Guards a loss of lift at 230 s of a flight of five minutes, which was `unexplained`: it was probed at 20 to 120 s, and a drift with a
    step the other way was fitted from there. It is found within a segment, with its size, also where no fitted loop holds it; where
    no loop is looked at, in the middle of these."""
    frame, null = null_model((("lift_drift", (("step", -0.06), ("at", at))),), seed=33)
    there = [part for part in ("train", "validation") for first, last in frame._stretches(part) if first < at < last]
    assert there == ([seen] if seen else [])
    found = begun(frame, null, "lift_drift")
    assert found["lift_drift.at"] == pytest.approx(at, abs=frame.horizon if seen else 4.0)
    assert found["lift_drift.step"] == pytest.approx(-0.06, abs=0.03)


@pytest.mark.parametrize("at", [0.4, 97.0, 30.0, 88.0])
def test_an_onset_is_sought_closer_to_the_best_moment(monkeypatch, at):
    """Guards what lies before the first moment that is looked at, or after the last one: the nearest moment is taken for the best, and the
    last of them lies within a segment, or in the middle of what is not looked at."""
    frame, null = null_model()
    (flight,) = frame.flights
    log, parts = SimpleNamespace(time=np.arange(5000) * 0.02), SimpleNamespace(train=((0, 1000), (2000, 5000)), validation=())
    frame = replace(frame, flights=(SimpleNamespace(log=log, split=parts, declared=flight.declared),))

    def nearest(columns, projected, rows, abrupt):
        best = min(columns.every, key=lambda v: abs(v.at["lift_drift.at"] - at))
        return SimpleNamespace(scores=(SimpleNamespace(start=lambda rows: ({}, best.at)),))

    monkeypatch.setattr("awescli.tracing.screen._flights", lambda *of, **how: [])
    monkeypatch.setattr("awescli.tracing.screen._informed", lambda *of: ())
    monkeypatch.setattr("awescli.tracing.screen.Projected", SimpleNamespace(of=lambda *of: None))
    monkeypatch.setattr("awescli.tracing.screen._scored", nearest)
    assert begun(frame, null, "lift_drift")["lift_drift.at"] == pytest.approx(at, abs=frame.horizon)
