"""What effects make of set-points, of surfaces and of the winch: sizes, signs and responses against formulae written out here."""

import numpy as np
import pytest
from kites import DEVELOPMENT, lively
from physics.effect_cases import both, deflection, flown

from awescli.notation.quantities import SURFACES
from awescli.physics.effects.past import BEHIND, past_of
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator


def test_surface_effectiveness_counts_less_beyond_the_threshold():
    """Guards both signs: 0.12 rad beyond 0.03 at one half are 0.075."""
    for angle in (0.12, -0.12, 0.02):
        with_it, _ = both("surface_effectiveness:rudder", rudder=angle)
        expected = np.sign(angle) * (min(abs(angle), 0.03) + 0.5 * max(abs(angle) - 0.03, 0.0))
        assert with_it.deflections["rudder"] == pytest.approx(expected) and with_it.deflections["aileron"] == 0.01


def test_a_dead_band_loses_small_deflections():
    """Guards both signs: of 0.12 rad a band of 0.01 leaves 0.11, of 0.006 nothing."""
    for angle in (0.12, -0.12, 0.006):
        with_it, _ = both("surface_dead_band:rudder", rudder=angle)
        expected = np.sign(angle) * max(abs(angle) - 0.01, 0.0)
        assert with_it.deflections["rudder"] == pytest.approx(expected, abs=1e-15)


def test_the_air_blows_a_surface_back():
    """Guards the balance of a spring and a hinge moment: at 50 m/s (1531 Pa) 2.8e-4 per Pa lose 30 % of a deflection, at half the speed a
    quarter of that moment loses 10 %; both signs, one surface only."""
    for speed, rudder in ((50.0, 0.12), (50.0, -0.12), (25.0, 0.12)):
        still = {"wind_speed_0": 0.0, "wind_speed_1": 0.0, "wind_speed_2": 0.0, "u": speed, "v": 0.0, "w": 0.0, "density": 1.225}
        with_it, without = both("hinge_blowback:rudder", {"k": 2.8e-4}, rudder=rudder, **still)
        moment = 2.8e-4 * 1.225 / 2 * speed**2
        assert with_it.deflections["rudder"] == pytest.approx(rudder / (1 + moment)) and without.deflections["rudder"] == rudder
        assert 1 - 1 / (1 + moment) == pytest.approx(0.3 if speed == 50 else 0.097, abs=0.01)
        assert with_it.deflections["aileron"] == 0.01


def test_an_actuator_lag_is_first_order(calm):
    """Guards the step response 1 - exp(-t / tau), and its rate limit."""
    step = np.where(np.arange(101) >= 10, 0.1, 0.0)
    values = {"actuator_lag:rudder.tau": 0.2}
    case = flown("actuator_lag:rudder", calm, values, setpoint=step)
    time = 0.02 * np.maximum(np.arange(101) - 10, 0)
    found = deflection(*case, values)[11:]
    assert found == pytest.approx(0.1 * (1 - np.exp(-time / 0.2))[11:], abs=3e-4)  # the start's rate is a gradient over the step
    values["actuator_lag:rudder.rate"] = 0.2
    limited = deflection(*flown("actuator_lag:rudder", calm, values, setpoint=step), values)
    assert np.diff(limited[11:20]) == pytest.approx(0.2 * 0.02, rel=1e-6)  # 0.1 / 0.2 s would be 0.5 rad/s


def test_an_actuator_lag_of_second_order(calm):
    """Guards the step response of lags of a = 0.2 s and b = 0.1 s in a row, 1 - (a e^(-t/a) - b e^(-t/b)) / (a - b)."""
    step = np.where(np.arange(101) >= 10, 0.1, 0.0)
    values = {"actuator_lag:rudder.tau": 0.3, "actuator_lag:rudder.inertia": 0.2 * 0.1 / 0.3**2}
    case = flown("actuator_lag:rudder", calm, values, setpoint=step)
    t = 0.02 * np.maximum(np.arange(101) - 10, 0)
    response = 1 - (0.2 * np.exp(-t / 0.2) - 0.1 * np.exp(-t / 0.1)) / 0.1
    assert deflection(*case, values)[11:] == pytest.approx(0.1 * response[11:], abs=1e-3)


@pytest.mark.parametrize("key", ["actuator_lag:rudder", "actuator_delay:rudder", "unsteady_lift", "load_cell_lag", "airspeed_lag"])
def test_a_lag_comes_out_of_null_without_a_step(calm, key):
    """Guards the lags that are too short to be stepped through: what a flight reports moves in proportion to the lag, from null past the
    shortest one (a step there is a wall for a fit: nothing that it tries beyond is better)."""
    from awescli.physics.effects.lag import SHORTEST

    setpoint = 0.05 * np.sin(3.0 * 0.02 * np.arange(101))
    taus = SHORTEST * np.array([0.0, 0.5, 1.0 - 1e-9, 1.0 + 1e-9, 1.5])
    runs = [flown(key, calm, {f"{key}.tau": tau}, setpoint=setpoint)[1].outputs[0] for tau in taus]
    # the first ten samples are the start's own transient
    moved = np.array([np.abs(run - runs[0])[10:].max(axis=0) for run in runs])
    seen = moved[-1] > 1e-6
    assert seen.any()
    assert moved[3, seen] == pytest.approx(moved[2, seen], rel=1e-4)
    assert (moved[1, seen] / moved[2, seen]) == pytest.approx(0.5, abs=0.25)
    assert (moved[4, seen] / moved[2, seen]) == pytest.approx(1.5, abs=0.25)


def test_a_lagging_surface_is_behind_from_the_start(calm):
    """Guards the start of a lag's state: a set-point that has been running at a steady rate is already tau times that rate ahead."""
    ramp = 0.05 + 0.2 * 0.02 * np.arange(51)
    values = {"actuator_lag:rudder.tau": 0.15}
    found = deflection(*flown("actuator_lag:rudder", calm, values, seconds=1.0, setpoint=ramp), values)
    # held set-points are half a sample late on average
    assert found == pytest.approx(ramp - 0.2 * (0.15 + 0.01), abs=0.2 * 0.02)
    assert found[0] == pytest.approx(0.05 - 0.2 * 0.15)


@pytest.mark.parametrize("tau", [0.03, 0.12])
def test_an_actuator_delay_is_a_pure_delay(calm, tau):
    """Guards phase and amplitude of the Pade form: a swinging rudder arrives tau later, as large, from the first sample on."""
    time = 0.02 * np.arange(101)
    values = {"actuator_delay:rudder.tau": tau}
    swing = lambda t: 0.1 * np.sin(2 * np.pi * 0.7 * t)  # noqa: E731
    case = flown("actuator_delay:rudder", calm, values, setpoint=swing(time))
    # set-points are held: they are half a sample late themselves, and their steps pass at once; between two steps stands the mean
    kite, result, segments = case
    rudder = len(kite.state_names) + SURFACES.index("rudder")
    result.states[0, 1:, rudder] = (result.states[0, 1:, rudder] + result.states[0, :-1, rudder]) / 2
    assert deflection(*case, values)[25:] == pytest.approx(swing(time - tau - 0.01)[25:], abs=2e-3)


@pytest.mark.parametrize("tau", [0.02, 0.04, 0.08])
def test_a_short_delay_is_flown_as_it_is_fitted(calm, tau):
    """Guards the poles of the Pade form: with steps of 20 ms, as fits take them, a step of the set-point goes the way that it goes with
    steps of 5 ms (poles of a shorter delay did not, and a lag explained flights with a short delay better than a delay)."""
    step, values = np.where(np.arange(101) >= 10, 0.1, 0.0), {"actuator_delay:rudder.tau": tau}
    fine, coarse = (deflection(*flown("actuator_delay:rudder", calm, values, setpoint=step, step=h), values) for h in (0.005, 0.02))
    assert coarse == pytest.approx(fine, abs=0.005)


def test_a_delay_has_no_kink_where_its_poles_stay(calm):
    """Guards fits: with a kink at 60 ms the fits of three surfaces of a measured flight ended on it, none at its minimum."""
    step = np.where(np.arange(51) >= 10, 0.1, 0.0)
    found = []
    for tau in (0.056, 0.06, 0.064):
        values = {"actuator_delay:rudder.tau": tau}
        found.append(deflection(*flown("actuator_delay:rudder", calm, values, setpoint=step, seconds=1.0), values))
    before, here, after = found
    assert np.abs(after - 2 * here + before).max() < 0.1 * np.abs(after - before).max()


def play(setpoint, width, start):
    """The play operator on samples: the surface is pushed along when the set-point leaves +-width/2 of it."""
    path = [start]
    for s in setpoint[1:]:
        path.append(min(max(path[-1], s - width / 2), s + width / 2))
    return np.array(path)


def test_backlash_is_the_play_operator(calm):
    """Guards memory: against the operator on samples, a swinging rudder that reverses inside and outside the play; a reversal is late by
    12 ms, which at 0.4 rad/s is 5 mrad. Small swings do nothing, large ones arrive half a width late."""
    width, time = 0.03, 0.02 * np.arange(201)
    setpoint = 0.1 * np.sin(2 * np.pi * 0.6 * time) * np.where(time < 2.5, 1.0, 0.12)
    case = flown("surface_backlash:rudder", calm, {"surface_backlash:rudder.width": width}, seconds=4.0, setpoint=setpoint)
    found = deflection(*case, {"surface_backlash:rudder.width": width})
    expected = play(setpoint, width, setpoint[0] - width / 2)
    assert np.abs(found - expected).max() < 6e-3 and np.median(np.abs(found - expected)) < 1e-3
    assert np.abs(setpoint - found).max() == pytest.approx(width / 2, abs=1e-4)
    # the small swing of the end is lost for the most part, the large one is not
    assert np.ptp(found[160:]) < 0.1 * np.ptp(setpoint[160:]) + 2e-3 and np.ptp(found[:100]) > 0.8 * np.ptp(setpoint[:100])


def wound(calm, speed, values, rising=0.0):
    """(paid-out speed, length behind the reference) (N+1,) along a segment on which the winch is asked for `speed` (N+1,), which was
    `rising` [m/s2] before."""
    kite = Kite(DEVELOPMENT, calm.log.wind.height, ("winch_tracking",))
    values = {f"winch_tracking.{n}": v for n, v in values.items()}
    segments = lively(kite, calm.log, count=1, seconds=4.0).segments
    at = {n: kite.input_names.index(n) for n in ("tether_length", "reel_out_speed", "reel_out_acceleration")}
    length = segments.inputs[0, 0, at["tether_length"]] + np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * segments.dt)])
    asked = np.stack([length, speed, np.gradient(speed, segments.dt)], axis=1)[None]
    segments = segments.with_inputs(list(at.values()), asked)
    past = [kite.input_names.index(n) for n in past_of("reel_out_speed")]
    segments = segments.with_inputs(past, np.broadcast_to(-rising * np.array(BEHIND), (1, len(speed), len(BEHIND))))
    flown = Simulator(kite, (), step=0.005).rollout(segments, values)
    assert not flown.diverged.any()
    kite = kite.with_values(values)
    line = kite.instant(list(flown.states[0].T), list(segments.inputs[0].T), list(kite.parameters.vector())).line
    return line.speed, length - line.length


def test_a_winch_follows_its_reference_late(calm):
    """Guards lag, length and limits: a reference that rises steadily at 0.2 m/s2 is followed 0.5 s behind, 0.1 m/s slower, and the line is
    behind by tau v, as after a whole reel-out from rest; a torque limit of 0.1 m/s2 makes the speed a ramp, a speed limit ends it."""
    time = 0.02 * np.arange(201)
    ramp = 0.5 + 0.2 * time
    v, behind = wound(calm, ramp, {"tau": 0.5}, rising=0.2)
    assert v == pytest.approx(ramp - 0.1, abs=1e-6) and behind == pytest.approx(0.5 * v, abs=1e-4)
    step = np.where(time < 1.0, 0.5, 1.0)
    v, _ = wound(calm, step, {"tau": 0.5})
    # the input runs up to its step over one sample
    assert v[55:] == pytest.approx(1.0 - 0.5 * np.exp(-(time[55:] - 0.99) / 0.5), abs=2e-3)
    v, _ = wound(calm, step, {"tau": 0.5, "a_max": 0.1})
    assert v[60:150] == pytest.approx(0.5 + 0.1 * (time[60:150] - 0.99), abs=2e-3)
    v, _ = wound(calm, step, {"tau": 0.2, "v_max": 0.8})
    assert v[:49] == pytest.approx(0.5, abs=1e-9) and v[-1] == pytest.approx(0.8, abs=1e-6)
    # a drum at its limit does not wind up: once it is asked for less it slows down at once
    v, _ = wound(calm, np.where((time < 1.0) | (time > 3.0), 0.5, 3.0), {"tau": 0.2, "v_max": 0.8})
    assert v[149] == pytest.approx(0.8, abs=1e-3) and v[160] < 0.7
