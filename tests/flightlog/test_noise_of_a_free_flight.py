"""Noise of a free flight is no error of a sensor: it is in what is compared, and in what it is compared with."""

from dataclasses import replace

import numpy as np
import pytest
from free_flight import free_flight

from awescli.flightlog.reconstruction.air import airspeed_of_motion, lagged
from awescli.flightlog.reconstruction.airspeed_lag import airspeed_lag
from awescli.flightlog.reconstruction.flight_path import reconstruct
from awescli.flightlog.reconstruction.motion_of import motion_of
from awescli.flightlog.reconstruction.solve import solve
from awescli.notation.angles import wrap


def noisier(factor=1.0, every=1, lag=0.0, **flown):
    """A free flight with so many times its noise, an airspeed with a lag [s], and of its samples one in `every`."""
    quiet, loud = free_flight(**flown, noise=False), free_flight(**flown)
    noise = {n: loud[n] - quiet[n] for n in quiet.measured} | {n: wrap(loud[n] - quiet[n]) for n in ("phi", "psi")}
    true = dict(quiet.measured) | {"V_a": lagged(quiet["V_a"], motion_of(quiet), lag)}
    measured = {n: (true[n] + factor * noise[n])[::every] for n in true}
    inputs, valid = {n: x[::every] for n, x in quiet.inputs.items()}, quiet.valid[::every]
    return replace(quiet, dt=quiet.dt * every, time=quiet.time[::every], measured=measured, inputs=inputs, valid=valid)


@pytest.mark.parametrize("seed", [0, 3])
def test_noise_of_the_velocity_is_no_scale_of_the_airspeed(seed):
    """Guards against a wrong name: an airspeed that reads far too low where it reads right. The speed that it is compared with
    holds the velocity's noise, and a factor on that is drawn to minus one (errors in variables; Fuller, Measurement Error Models, 1987)."""
    solution = solve(airspeed_of_motion(motion_of(free_flight(seconds=100.0, seed=seed))))
    size, std = solution.values["at flown speed"], solution.std["at flown speed"]
    assert std < 0.02 and abs(size) < 3 * std, (size, std)


@pytest.mark.parametrize("seconds, seed, breeze, factor", [(120.0, 839, 6.0, 4.0), (200.0, 545, 0.0, 2.0)])
def test_noise_at_a_low_rate_is_no_delay(seconds, seed, breeze, factor):
    """Guards against wrong names: a lag of the airspeed averages the noise of the velocity, and half a sample between two accelerations
    theirs. Of 12 samples a second both passed for sensors that are late."""
    told = [e.name for e in reconstruct(noisier(factor, every=4, seconds=seconds, seed=seed, breeze=breeze)).findings]
    assert not {"airspeed_lag", "velocity latency", "acceleration latency", "position_latency"} & set(told), told


def test_a_slow_pitot_is_still_told():
    log = noisier(lag=0.6, seconds=120.0, seed=545, breeze=6.0)
    lag = airspeed_lag(motion_of(log), None)
    assert lag.clear and abs(lag.size - 0.6) < 3 * lag.std, lag


def test_backwards_in_time_a_lag_is_the_same_filter():
    motion = motion_of(free_flight(seconds=40.0, seed=3))
    signal = np.sin(np.arange(len(motion)) / 20.0)
    assert np.allclose(lagged(signal, motion, -0.5)[::-1], lagged(signal[::-1], motion, 0.5))
