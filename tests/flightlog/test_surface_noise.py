"""Surfaces that were read with noise: the motion under it, what is not known of that, and nothing where the surface itself moved."""

import numpy as np
import pytest
from scipy.signal import lfilter

from awescli.flightlog.log import FlightLog
from awescli.flightlog.smooth_motion import DIFFERENCE, density, not_known, step_of
from awescli.flightlog.surface_noise import answered, with_smooth_surfaces

DT, N = 0.02, 6000
TIME = DT * np.arange(N)
SEEN = np.ones(N, bool)
RUDDER = 0.09 * np.sin(2 * np.pi * TIME / 9) + 0.02 * np.sin(2 * np.pi * TIME / 2.5)
GYRO = 0.003
DEG = np.pi / 180


def noise(size: float, seed: int = 0) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(N)


def log_of(recorded: np.ndarray, flown: np.ndarray, valid: np.ndarray = SEEN) -> FlightLog:
    """A log whose kite answers the rudder that it flew with: yaw acceleration of 30 1/s2 times it, behind an actuator of 50 ms, damped."""
    behind = lfilter([DT / 0.05], [1, DT / 0.05 - 1], flown)
    r = lfilter([30 * DT], [1, 5 * DT - 1], behind)
    rates = {"p": 0.2 * r + noise(GYRO, 11), "q": noise(GYRO, 12), "r": r + noise(GYRO, 13)}
    return FlightLog("x", 0.0, DT, TIME, rates, {"rudder": recorded.copy()}, valid)


@pytest.mark.parametrize("size", [0.1, 0.3, 1.0])
def test_noise_returns_and_what_is_left_of_it_is_told(size):
    """Guards the levels: the noise within 5 %, and the error of the motion within 30 % of what is said to be unknown, much below it."""
    log = with_smooth_surfaces(log_of(RUDDER + noise(size * DEG), RUDDER))
    error = log["rudder"] - RUDDER
    (note,) = log.notes
    assert float(note.split("noise of ")[1].split(" deg")[0]) == pytest.approx(size, rel=0.05)
    assert error.std() == pytest.approx(log.unknown["rudder"].std, rel=0.3) and error.std() < 0.35 * size * DEG


def test_what_is_not_known_is_that_of_dense_matrices():
    """Guards the closed form: standard deviation in the middle of a long record, and the area under the error's covariance (its density at
    low frequencies), against the inverse of the dense normal matrix."""
    n, size, jerk = 800, 0.005, 0.02
    third = np.zeros((n - 3, n))
    for i in range(n - 3):
        third[i, i : i + 4] = DIFFERENCE / DT**3
    covariance = np.linalg.inv(np.eye(n) / size**2 + third.T @ third / jerk**2)
    told = not_known(size, jerk, DT)
    assert told.std == pytest.approx(np.sqrt(covariance[n // 2, n // 2]), rel=0.02)
    assert 2 * told.std**2 * told.memory == pytest.approx(DT * covariance[n // 2].sum(), rel=0.02)


def test_a_surface_that_moved_so_is_left():
    """Guards commands that are noisy because a controller is: the kite answers them, and the log stays as it is."""
    shaken = RUDDER + noise(0.3 * DEG)
    log = log_of(shaken, shaken)
    assert with_smooth_surfaces(log) is log
    assert answered(shaken - RUDDER, [log[n] for n in "pqr"], DT, SEEN) < 0.01


@pytest.mark.parametrize("recorded", [RUDDER, RUDDER + noise(0.02 * DEG), RUDDER + lfilter([0.02], [1, -0.98], noise(30 * DEG))])
def test_little_noise_and_quick_motion_are_left(recorded):
    """Guards exact set-points, to the bit, and a controller's quick ones."""
    log = log_of(recorded, RUDDER)
    assert with_smooth_surfaces(log) is log


@pytest.mark.parametrize("size", [0.1, 0.3])
def test_a_surface_that_steps_is_not_bent(size):
    """Guards flaps that change from phase to phase, which no rate answers: 4 deg of a step were smoothed away."""
    log = log_of(np.where(TIME > 60, 10 * DEG, 0.0) + noise(size * DEG), RUDDER)
    assert with_smooth_surfaces(log) is log


def test_chance_answers_as_often_as_it_says():
    """Guards the test of independence: of a hundred noises that nothing answers, few come below 5 %."""
    log = log_of(RUDDER, RUDDER)
    found = [answered(noise(0.3 * DEG, seed), [log[n] for n in "pqr"], DT, SEEN) for seed in range(100, 200)]
    assert np.mean(np.array(found) < 0.05) <= 0.12 and np.mean(found) == pytest.approx(0.5, abs=0.1)


def test_a_coarse_record_keeps_its_steps_as_unknown():
    """Guards rounding: what it takes off goes with the motion and comes again in each loop, so smoothing does not take it away."""
    coarse = np.round(RUDDER / (0.5 * DEG)) * (0.5 * DEG)
    assert step_of(coarse) == pytest.approx(0.5 * DEG) and step_of(RUDDER) == 0.0 and step_of(np.zeros(5)) == 0.0
    log = with_smooth_surfaces(log_of(coarse, RUDDER))
    assert log.unknown["rudder"].std == pytest.approx(0.5 * DEG / np.sqrt(12), rel=0.1)
    assert (log["rudder"] - RUDDER).std() < 0.6 * (coarse - RUDDER).std()


def test_density_is_that_of_an_autoregression():
    """Guards coloured noise: x' = a x + e has (1 + a) / (1 - a) times the density of a white one of its size."""
    assert density(noise(1.0)) == pytest.approx(1.0, abs=0.15)
    assert density(lfilter([1], [1, -0.5], noise(1.0))) == pytest.approx(3.0, rel=0.15)


def test_a_gap_and_a_short_log_are_read():
    """Guards what was not recorded: a gap of 20 s does no harm, and nothing is said of less than 20 s."""
    gap = (TIME > 30) & (TIME < 50)
    log = with_smooth_surfaces(log_of(np.where(gap, 0.0, RUDDER + noise(0.3 * DEG)), RUDDER, ~gap))
    assert (log["rudder"] - RUDDER)[~gap].std() < 0.1 * DEG
    whole = log_of(RUDDER + noise(0.3 * DEG), RUDDER)
    for seconds, read in ((15, False), (25, True)):
        n = int(seconds / DT)
        first = {name: whole[name][:n].copy() for name in "pqr"}
        short = FlightLog("x", 0.0, DT, TIME[:n], first, {"rudder": whole["rudder"][:n].copy()}, SEEN[:n])
        assert bool(with_smooth_surfaces(short).notes) == read
    nothing = log_of(RUDDER, RUDDER, ~SEEN)
    assert with_smooth_surfaces(nothing) is nothing
