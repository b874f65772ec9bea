"""Rollouts: exact sensitivities, named divergence, independent lanes, closed loop against replay, and the same physics in torch."""

import numpy as np
import pytest
import torch
from kites import DEVELOPMENT, at_point, flight, lively, sizes
from torchdiffeq import odeint

from awescli.control.linear_law import LinearLaw
from awescli.engine.machine import LANES, compile_program, evaluate
from awescli.notation.quantities import MEASURED, OUTPUTS, STATES, SURFACES
from awescli.physics.kite import Kite
from awescli.simulation.closed_loop import loop
from awescli.simulation.rollout import Columns, Segments, Simulator
from awescli.simulation.survival import flies, samples_flown

WRT = ("CLa", "Cmq", "Jx", "Cndr", "CtD", "rtz", "dl", "gust_n.even", "gust_e.even", "gust_d.even")


@pytest.fixture(scope="module")
def simulator(kite):
    return Simulator(kite, WRT)


@pytest.fixture(scope="module")
def segments(kite, calm):
    return lively(kite, calm.log, count=9, seconds=2.0).segments


def central(simulator, segments, h, above, below):
    """(rollout above - rollout below) / 2h of the measured channels."""
    return (simulator.rollout(*above).outputs - simulator.rollout(*below).outputs)[:, :, : len(MEASURED)] / (2 * h)


def agrees(exact, difference, tolerance):
    """Every channel to a share of its largest entry (a flat channel: of the largest of all)."""
    for i, channel in enumerate(MEASURED):
        scale = max(np.abs(difference[:, :, i]).max(), 1e-6 * np.abs(difference).max())
        assert np.abs(exact[:, :, i] - difference[:, :, i]).max() < tolerance * scale, (channel, scale)


def test_set_points_of_the_wrong_number_are_refused():
    """Guards the compiled loops, which read as many as they are told there are: beyond the array otherwise."""
    with pytest.raises(ValueError, match="4 set-points at a sample"):
        Segments(np.zeros(1, int), np.zeros((1, 12)), np.zeros((1, 5, 4)), np.zeros((1, 5, 3)), 0.02)


def test_segments_of_another_kite_are_refused(calm, segments):
    """Guards the same of inputs: an actuator with a past asks for more of them, and was begun with whatever stood behind the array."""
    slow = Simulator(Kite(DEVELOPMENT, calm.log.wind.height, ("actuator_lag:rudder",)))
    with pytest.raises(ValueError, match="inputs at a sample, this kite takes"):
        slow.rollout(segments)
    with pytest.raises(ValueError, match="inputs at a sample"):
        slow.sensitivities(segments, Columns(parameters=("CLa",)))


def test_sensitivities_to_the_start(simulator, segments):
    """Guards S0 = I and its way through RK4: all 12 initial states against central differences over 2 s."""
    _, J = simulator.sensitivities(segments, Columns(STATES))
    for i, name in enumerate(STATES):
        h = 1e-5 * (1.0 if i < 6 else 0.1)
        up, down = segments.starts.copy(), segments.starts.copy()
        up[:, i] += h
        down[:, i] -= h
        difference = central(simulator, segments, h, (segments.starting_at(up),), (segments.starting_at(down),))
        # kinks of the wind table inside h, and 1e-10 of rounding over h
        agrees(J[:, :, :, i], difference, 1e-4)
        assert J[:, 0, MEASURED.index(name), i] == pytest.approx(1.0) if name in MEASURED else True


def test_sensitivities_to_parameters(simulator, segments, kite):
    """Guards df/dc through the whole rollout, initial states of effects included, in any order of columns."""
    names = ("Cndr", "CLa", "dl", "Jx", "CtD", "rtz", "Cmq")
    _, J = simulator.sensitivities(segments, Columns((), names))
    for i, name in enumerate(names):
        value = kite.parameters[name].value
        h = 1e-6 * max(abs(value), 0.1)
        difference = central(simulator, segments, h, (segments, {name: value + h}), (segments, {name: value - h}))
        agrees(J[:, :, :, i], difference, 1e-4)


def test_sensitivities_to_windows_of_wind(simulator, segments, kite):
    """Guards the columns that count only during some steps: against gusts switched on as an input over the same window."""
    windows = (("gust_n.even", 0, 25), ("gust_d.even", 25, 60), ("gust_e.even", 60, 101))
    _, J = simulator.sensitivities(segments, Columns((), ("CLa",), windows))
    _, whole = simulator.sensitivities(segments, Columns((), ("gust_n.even",)))
    _, split = simulator.sensitivities(segments, Columns((), (), (("gust_n.even", 0, 40), ("gust_n.even", 40, 101))))
    # windows that together make the whole segment add up to the parameter
    assert np.abs(split.sum(-1) - whole[..., 0]).max() < 1e-9 * np.abs(whole).max()
    # before its window a gust has no influence; inside it has at once (airspeed)
    assert (J[:, :25, :, 2] == 0).all() and (J[:, :60, :, 3] == 0).all()
    assert (np.abs(J[:, 60, MEASURED.index("V_a"), 3]) > 0.01).any()
    gust_n, h = kite.input_names.index("gust_n"), 1e-4
    inputs = [segments.inputs.copy() for _ in range(2)]
    for block, sign in zip(inputs, (1, -1), strict=True):
        block[:, :, gust_n] += sign * h
    up, down = (segments.with_inputs(slice(0, len(kite.input_names)), block) for block in inputs)
    agrees(whole[..., 0], central(simulator, segments, h, (up,), (down,)), 1e-4)


def test_a_simulation_with_sensitivities_is_the_simulation(simulator, segments):
    """Guards the two kernels against drifting apart: the same trajectory to rounding."""
    plain, (both, _) = simulator.rollout(segments), simulator.sensitivities(segments, Columns(STATES, ("CLa",)))
    assert np.abs(plain.states - both.states).max() < 1e-9 and np.array_equal(plain.alive, both.alive)


def test_columns_do_not_influence_each_other(simulator, segments):
    """Guards the bookkeeping of columns: alone or among others, a column is the same."""
    _, every = simulator.sensitivities(segments, Columns(("p", "u"), ("CtD", "CLa")), ("tension", "p_n"))
    _, alone = simulator.sensitivities(segments, Columns((), ("CLa",)), ("p_n", "tension"))
    _, state = simulator.sensitivities(segments, Columns(("u",)), ("tension",))
    assert every[..., 3] == pytest.approx(alone[:, :, ::-1, 0], rel=1e-12)
    assert every[:, :, :1, 1] == pytest.approx(state[..., 0], rel=1e-12)


@pytest.mark.parametrize("count", [1, 7, 8, 9])
def test_segments_do_not_know_their_neighbours(simulator, segments, count):
    """Guards groups of lanes: any number of segments, in any company, gives each the same bits."""
    whole = simulator.rollout(segments)
    _, J = simulator.sensitivities(segments, Columns(("u",), ("CLa",)))
    which = np.arange(9)[::-1][:count]
    part, K = simulator.rollout(segments.pick(which)), simulator.sensitivities(segments.pick(which), Columns(("u",), ("CLa",)))[1]
    assert np.array_equal(part.outputs, whole.outputs[which]) and np.array_equal(part.states, whole.states[which])
    assert np.array_equal(K, J[which])


def test_values_of_one_segment_stay_with_it(simulator, segments, kite):
    """Guards parameters that differ from segment to segment (several flights in one fit)."""
    from dataclasses import replace

    CLa = kite.parameters["CLa"].value * np.linspace(0.9, 1.1, 9)
    together = simulator.rollout(replace(segments, values={"CLa": CLa}))
    for k in (0, 4, 8):
        alone = simulator.rollout(segments.pick([k]), {"CLa": CLa[k]})
        assert np.array_equal(together.outputs[k], alone.outputs[0])


# --- divergence ---


def test_divergence_has_a_name_and_is_never_a_nan(simulator, segments, kite):
    """Guards a report without NaN: one lane with absurd pitch damping ends, says when, and leaves its neighbours alone."""
    from dataclasses import replace

    Cmq = np.full(9, kite.parameters["Cmq"].value)
    Cmq[3] = 4e4
    wild = replace(segments, values={"Cmq": Cmq})
    flown, (with_J, J) = simulator.rollout(wild), simulator.sensitivities(wild, Columns(STATES, ("CLa",)))
    assert flown.diverged.tolist() == [k == 3 for k in range(9)] and 1 <= flown.alive[3] < 101
    assert with_J.alive[3] == flown.alive[3]
    for numbers in (flown.states, flown.outputs, with_J.outputs, J):
        assert np.isfinite(numbers).all()
    healthy = [k for k in range(9) if k != 3]
    assert np.array_equal(flown.outputs[healthy], simulator.rollout(segments).outputs[healthy])


def test_a_start_that_is_no_number_ends_at_once(simulator, segments):
    """Guards against a NaN in a log's start that spreads: the lane has lived for no more than its first sample."""
    starts = segments.starts.copy()
    starts[2, 4] = np.nan
    flown = simulator.rollout(segments.starting_at(starts))
    assert flown.alive[2] <= 1 and flown.diverged.sum() == 1
    others = [k for k in range(9) if k != 2]
    assert np.isfinite(flown.outputs[others]).all()


# --- closed loop ---


def test_a_law_flies_what_its_replay_flies(calm, kite):
    """Guards sample and hold in closed loop: the set-points that a law gave, recorded and replayed, give the same bits."""
    from dataclasses import replace

    closed = Simulator(kite, (), law=loop(calm.law, kite, 0.0))
    segments = lively(kite, calm.log, count=3, seconds=4.0).segments
    flown = closed.rollout(segments)
    setpoints = flown.outputs[:, :, [OUTPUTS.index(s) for s in SURFACES]]
    replayed = Simulator(kite, ()).rollout(replace(segments, setpoints=setpoints))
    assert np.array_equal(replayed.states, flown.states) and np.array_equal(replayed.outputs, flown.outputs)
    # and they are what the law says at the states, sample by sample
    z = {name: flown.states[0, :, i] for i, name in enumerate(STATES)}
    assert calm.law.deflections(z)["rudder"] == pytest.approx(setpoints[0, :, SURFACES.index("rudder")], abs=1e-12)


def test_a_law_leaves_the_surfaces_that_it_does_not_drive(calm, kite):
    """Guards `surfaces: controller` with a law for the rudder only: the others keep what was recorded."""
    law = LinearLaw(surfaces=("rudder",), features=("r",), centre=(0.0,), scale=(1.0,), limits={"rudder": (-0.1, 0.1)},
                    affine=np.array([[0.02, 0.3]]))  # fmt: skip
    segments = lively(kite, calm.log, count=2, seconds=1.0).segments
    flown = Simulator(kite, (), law=loop(law, kite, 0.0)).rollout(segments)
    for name in SURFACES:
        if name != "rudder":
            i = SURFACES.index(name)
            assert np.array_equal(flown[name], segments.setpoints[:, :, i]), name
    assert flown["rudder"] == pytest.approx(np.clip(0.02 + 0.3 * flown.states[:, :, STATES.index("r")], -0.1, 0.1), abs=1e-14)


def test_sensitivities_in_closed_loop(calm, kite):
    """Guards the chain through the law: a changed parameter changes the states, these the rudder, this the states."""
    simulator = Simulator(kite, ("CLa", "Cndr"), law=loop(calm.law, kite, 0.0))
    segments = lively(kite, calm.log, count=2, seconds=2.0).segments
    _, J = simulator.sensitivities(segments, Columns(("psi",), ("Cndr",)), (*MEASURED, "rudder"))
    value, h = kite.parameters["Cndr"].value, 1e-7
    up, down = (simulator.rollout(segments, {"Cndr": value + s * h}) for s in (1, -1))
    difference = (up.outputs - down.outputs) / (2 * h)
    agrees(J[:, :, : len(MEASURED), 1], difference[:, :, : len(MEASURED)], 1e-4)
    rudder = difference[:, :, OUTPUTS.index("rudder")]
    assert np.abs(J[:, :, -1, 1] - rudder).max() < 1e-4 * np.abs(rudder).max() and np.abs(rudder).max() > 0


def test_survival_is_named(calm):
    """Guards the outcomes of a law's test flight: the law that flew the flight flies, a hard-over aileron does not."""
    good = flies(DEVELOPMENT, calm.law, calm.log, 0.0, 6.0)
    assert good["outcome"] == "flies" and good["share"] == 1.0 and good["path_error_5s_m"] < 5.0
    hard_over = LinearLaw(surfaces=("aileron",), features=("r",), centre=(0.0,), scale=(1.0,), limits={"aileron": (-1.0, 1.0)},
                          affine=np.array([[0.9, 0.0]]))  # fmt: skip
    bad = flies(DEVELOPMENT, hard_over, calm.log, 0.0, 12.0)
    assert bad["outcome"] == "does_not_fly" and max(bad["survival_s"]) < 12.0, bad


def test_a_crash_counts_from_the_ground_on(simulator, segments):
    """Guards `samples_flown`: below 5 m is a crash, whatever the numbers do later."""
    flown = simulator.rollout(segments)
    flown.outputs[4, 30:40, OUTPUTS.index("p_d")] = 1.0
    assert samples_flown(flown).tolist() == [30 if k == 4 else 101 for k in range(9)]


# --- the same physics in torch ---


@pytest.mark.parametrize("key", ["", "actuator_lag:rudder", "lift_stall", "position_latency"])
def test_tensors_and_compiled_code_agree(key):
    """Guards one source of physics: Kite.derivative and outputs on float64 tensors equal the compiled program to 1e-12."""
    kite = Kite(DEVELOPMENT, (10.0, 100.0, 200.0), (key,) if key else ())
    kite = kite.with_values(sizes(key)) if key else kite
    points = [
        at_point(kite, v=float(v), rudder=float(r)) for v, r in zip(np.linspace(-8, 8, LANES), np.linspace(-0.3, 0.3, LANES), strict=True)
    ]
    x, u, c = (np.array([p[i] for p in points]).T for i in range(3))
    tensors = [[torch.tensor(row) for row in block] for block in (x, u, c)]
    for function in (kite.derivative, kite.outputs):
        compiled = evaluate(compile_program(function, len(x), len(u), len(c), linearised=False), x, u, c)
        in_torch = np.array([np.broadcast_to(torch.as_tensor(d).numpy(), LANES) for d in function(*tensors)])
        scale = np.abs(compiled).max(axis=1, keepdims=True) + 1.0
        assert (np.abs(compiled - in_torch) / scale).max() < 1e-12


def test_the_tangent_is_torchs_own_derivative():
    """Guards the Jacobian of the whole kite against an independent automatic differentiation, to 1e-10."""
    from engine.test_machine import jacobian

    kite = Kite(DEVELOPMENT, (10.0, 100.0, 200.0))
    x, u, c = at_point(kite)
    wrt = [kite.parameter_names.index(n) for n in kite.parameters.free]
    program = compile_program(kite.derivative, len(x), len(u), len(c), wrt)
    exact = jacobian(program, *(np.repeat(np.array(a)[:, None], LANES, axis=1) for a in (x, u, c)))[:, :, 0]
    free = torch.tensor([*x, *(c[i] for i in wrt)], dtype=torch.float64)
    inputs = [torch.tensor(v, dtype=torch.float64) for v in u]

    def f(z):
        values = [torch.tensor(v, dtype=torch.float64) for v in c]
        for place, i in enumerate(wrt):
            values[i] = z[len(x) + place]
        return torch.stack([torch.as_tensor(d) for d in kite.derivative(list(z[: len(x)]), inputs, values)])

    expected = torch.autograd.functional.jacobian(f, free).numpy()
    assert np.abs(exact - expected).max() < 1e-10 * np.abs(expected).max()
    assert exact == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("method", ["rk4", "dopri5"])
def test_torchdiffeq_flies_the_same_path(calm, kite, method):
    """Guards the kernel against another solver on the slow path: torchdiffeq's rk4 (the 3/8 rule) differs by the integrators' own
    errors only, and an adaptive solver is met as closely as the kernel's own finer steps are."""
    segments = lively(kite, calm.log, count=2, seconds=0.5 if method == "rk4" else 0.2).segments
    x = torch.tensor(segments.starts)
    c = [torch.tensor(v) for v in kite.parameters.vector()]
    states = [x]
    for k in range(segments.steps):
        a, b = (torch.tensor(segments.inputs[:, j]) for j in (k, k + 1))
        held = list(torch.tensor(segments.setpoints[:, k]).T)

        def rate(t, x, a=a, b=b, held=held):
            u = a + t * (b - a)
            return segments.dt * torch.stack([torch.as_tensor(d) for d in kite.derivative([*x.T, *held], list(u.T), c)], dim=-1)

        options = {"rtol": 1e-10, "atol": 1e-11} if method == "dopri5" else {}
        states.append(odeint(rate, states[-1], torch.tensor([0.0, 1.0], dtype=torch.float64), method=method, **options)[-1])
    in_torch = torch.stack(states, dim=1).numpy()
    ours = {n: Simulator(kite, (), step=0.02 / n).rollout(segments).states[:, :, :12] for n in (1, 8)}
    own_error = np.abs(ours[1] - ours[8]).max(axis=(0, 1))
    apart = np.abs(in_torch - ours[1 if method == "rk4" else 8]).max(axis=(0, 1))
    assert (apart <= (3.0 if method == "rk4" else 0.1) * own_error + 1e-9).all(), (apart, own_error)


def test_flights_do_not_depend_on_when_they_are_flown():
    """Guards against state that is kept between calls: the same flight twice, with another in between."""
    first = flight(seed=1).log["p_n"].copy()
    flight.__wrapped__(seed=2, duration=20.0)
    assert np.array_equal(flight.__wrapped__(seed=1).log["p_n"], first)
