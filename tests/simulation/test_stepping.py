"""Steps follow from the model: what a log's interval may not decide, and what a slow log still says of the flight."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, declared, every_key, lively

from awescli.control.pattern import arc
from awescli.notation.quantities import OUTPUTS, STATES
from awescli.physics.effects.lag import LONGEST_STEP, SHORTEST
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Columns, Segments, Simulator, inputs_of, setpoints_of
from awescli.simulation.segments import observe, smooth_states
from awescli.simulation.stepping import Stepping, fastest_poles, longest_step

POSITION = [OUTPUTS.index(n) for n in ("p_n", "p_e", "p_d")]


@pytest.mark.parametrize(
    ("rate", "dt", "steps", "shares"),
    [
        (50.0, 0.02, 1, [0.0]),  # a log as fast as the controller has every set-point
        (50.0, 0.01, 1, [0.0]),
        (1e4, 0.04, 2, [0.25, 0.75]),  # a controller that hardly holds: each step takes the command of its middle
        (1e4, 0.1, 5, [0.1, 0.3, 0.5, 0.7, 0.9]),
        (50.0, 0.04, 2, [0.0, 0.5]),  # held for 20 ms from rows 40 ms apart: every second set-point is a row
        (50.0, 0.1, 5, [0.0, 0.2, 0.4, 0.6, 0.8]),
        (10.0, 0.04, 2, [0.0, 0.0]),
    ],
)
def test_set_points_run_as_declared(rate, dt, steps, shares):
    s = Stepping.between(dt, LONGEST_STEP, rate)
    assert s.substeps == steps
    assert [s.first + i * s.onward for i in range(steps)] == pytest.approx(shares, abs=2e-3)


def test_a_held_set_point_is_half_a_period_late_whatever_the_step():
    """A linear command, seen at the middle of each step between two samples, lags by half the controller's period."""
    for dt, longest, rate in ((0.05, 0.02, 50.0), (0.1, 0.02, 30.0), (0.03, 0.004, 100.0)):
        s = Stepping.between(dt, longest, rate)
        middle = (np.arange(s.substeps) + 0.5) * dt / s.substeps
        commanded = dt * (s.first + s.onward * np.arange(s.substeps))
        assert middle - commanded == pytest.approx(0.5 / rate)


def test_the_fastest_pole_is_that_of_the_shortest_lag(calm):
    """A lag at null is stepped through with its shortest time; an oscillator of spring and mass is found at sqrt(k/m)."""
    kite = Kite(DEVELOPMENT, calm.log.wind.height, ("load_cell_lag",))
    rows = [200, 400, 600]
    where = (smooth_states(calm.log)[rows], setpoints_of(calm.log)[rows])
    assert fastest_poles(kite, *where, inputs_of(calm.log, kite)[rows]) == pytest.approx(1 / SHORTEST, rel=1e-4)
    assert longest_step(kite, *where, inputs_of(calm.log, kite)[rows]) == LONGEST_STEP
    stiff = Kite(declared(k_v=4e6, c_v=0.0), calm.log.wind.height)
    mass = DEVELOPMENT.parameters["m"].value
    assert np.median(fastest_poles(stiff, *where, inputs_of(calm.log, stiff)[rows])) == pytest.approx(np.sqrt(4e6 / mass), rel=0.02)
    assert longest_step(stiff, *where, inputs_of(calm.log, stiff)[rows]) < LONGEST_STEP / 2


def test_a_stiff_kite_flies_with_the_steps_that_it_needs(calm):
    """A line with poles at 200 1/s rattles for metres with steps of 20 ms; with the steps that they ask for, 2 s are right to 1 mm."""
    mass = DEVELOPMENT.parameters["m"].value
    kite = Kite(declared(k_v=200.0**2 * mass, c_v=2 * 200.0 * mass), calm.log.wind.height)
    segments = observe(calm.log, kite, np.array([100, 600]), 100, ("p_n",)).segments
    # on the line: a start beside it is thrown
    length = segments.inputs[:, 0, kite.input_names.index("tether_length")] + kite.parameters["dl"].value
    segments.starts[:, :3] *= (length / np.linalg.norm(segments.starts[:, :3], axis=1))[:, None]
    chosen, fine, long = (Simulator(kite, (), step=step).rollout(segments).outputs[..., POSITION] for step in (None, 2e-4, LONGEST_STEP))
    assert np.abs(chosen - fine).max() < 1e-3
    assert np.abs(long - fine).max() > 1.0


def slower(segments: Segments, every: int) -> Segments:
    """The same segments as a log with every so-many-th row has them."""
    kept = slice(None, None, every)
    return replace(segments, setpoints=segments.setpoints[:, kept], inputs=segments.inputs[:, kept], dt=every * segments.dt)


@pytest.mark.parametrize("every", [2, 5])
def test_a_slow_log_of_a_fast_controller_flies_as_the_fast_log(calm, every):
    """With every 2nd and 5th row of a flight of 50 Hz, 5 s end within 1 and 10 cm of the flight; with rows held to the next, metres off."""
    fast = Kite(DEVELOPMENT, calm.log.wind.height)
    segments = observe(calm.log, fast, np.array([100, 500, 900]), 250, ("p_n",)).segments
    truth = Simulator(fast, ()).rollout(segments).outputs[:, ::every][:, :, POSITION]
    error = lambda rate: np.abs(  # noqa: E731
        Simulator(Kite(DEVELOPMENT.model_copy(update={"set_point_rate": rate}), calm.log.wind.height), ())
        .rollout(slower(segments, every)).outputs[:, :, POSITION] - truth
    ).max()  # fmt: skip
    assert error(50.0) < {2: 0.01, 5: 0.1}[every]
    assert error(1.0 / (every * 0.02)) > 1.0


def test_a_law_in_a_slow_log_is_asked_as_often_as_it_flew(calm):
    """With inputs that are linear over 0.1 s, a loop that is closed at 50 Hz is the same loop at 50 and at 10 Hz of rows, to rounding."""
    law = calm.law
    kite = Kite(DEVELOPMENT.model_copy(update={"set_point_rate": 50.0}), calm.log.wind.height)
    coarse = slower(observe(calm.log, kite, np.array([100, 700]), 250, ("p_n",)).segments, 5)
    share = np.linspace(0, 1, 5, endpoint=False)[:, None]
    between = lambda a: np.concatenate(  # noqa: E731
        [(a[:, :-1, None] * (1 - share) + a[:, 1:, None] * share).reshape(len(a), -1, a.shape[2]), a[:, -1:]], axis=1
    )
    fine = replace(coarse, setpoints=between(coarse.setpoints), inputs=between(coarse.inputs), dt=0.02)
    simulator = Simulator(kite, (), law=law.setpoints)
    assert np.abs(simulator.rollout(coarse).states - simulator.rollout(fine).states[:, ::5]).max() < 1e-9


@pytest.mark.parametrize("rate", [400.0, 50.0])
def test_sensitivities_of_a_slow_log_are_those_of_its_rollout(calm, rate):
    """Central differences of the discretised rollout, with several steps to a row, lags and a law in the loop."""
    kite = Kite(DEVELOPMENT.model_copy(update={"set_point_rate": rate}), calm.log.wind.height, ("actuator_lag:rudder", "load_cell_lag"))
    kite = kite.with_values({"actuator_lag:rudder.tau": 0.1, "load_cell_lag.tau": 0.2})
    segments = slower(lively(kite, calm.log, count=3, seconds=2.0).segments, 4)
    names = ("CLa", "Cnr", "actuator_lag:rudder.tau")
    for law in (None, lambda x, u, c: [0.0 * x[0], 0.0 * x[0], -0.05 * x[9] + 0.02 * x[6], 0.0 * x[0]]):
        simulator = Simulator(kite, names, law)
        _, J = simulator.sensitivities(segments, Columns(parameters=names), ("p_n", "theta", "r", "tension"))
        index = [OUTPUTS.index(n) for n in ("p_n", "theta", "r", "tension")]
        for j, name in enumerate(names):
            value = kite.parameters[name].value
            h = 1e-5 * max(abs(value), 0.1)
            up, down = (simulator.rollout(segments, {name: value + s * h}).outputs[:, :, index] for s in (1, -1))
            difference = (up - down) / (2 * h)
            assert J[..., j] == pytest.approx(difference, rel=1e-5, abs=1e-6 * np.abs(difference).max())


def test_no_effect_of_the_library_blows_up_in_a_slow_log(calm):
    """Every effect at null in a log of 10 Hz: the same flight as without it (their shortest lags used to leave the numbers at 25 Hz)."""
    keys = tuple(k for k in every_key() if not k.startswith("custom_term"))
    plain = Kite(DEVELOPMENT, calm.log.wind.height)

    def cut(kite):
        return slower(observe(calm.log, kite, np.array([100, 700]), 250, ("p_n",)).segments, 5)

    flown = Simulator(plain, ()).rollout(cut(plain))
    for key in keys:
        kite = Kite(DEVELOPMENT, calm.log.wind.height, (key,))
        with_it = Simulator(kite, ()).rollout(cut(kite))
        assert not with_it.diverged.any(), key
        assert np.abs(with_it.outputs - flown.outputs)[..., : len(STATES)].max() < 1e-9, key


def test_a_law_in_a_slow_log_keeps_its_circle(calm):
    """A path-following law keeps the kite of a log of 10 Hz on its circle for 10 s."""
    kite = Kite(DEVELOPMENT.model_copy(update={"set_point_rate": 50.0}), calm.log.wind.height)
    segments = slower(observe(calm.log, kite, np.array([100]), 500, ("p_n",)).segments, 5)
    flown = Simulator(kite, (), law=calm.law.setpoints).rollout(segments)
    z = dict(zip(("p_n", "p_e", "p_d"), flown.states[:, :, :3].transpose(2, 0, 1), strict=True))
    assert np.abs(arc(z, calm.law.pattern) / calm.law.pattern.radius - 1).max() < 0.5
