"""A winch that is recorded with noise: the motion that length and speed share, and nothing where they contradict each other."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from flightlog.synthetic import circle, write_folder

from awescli.flightlog.log import FlightLog
from awescli.flightlog.read import read_flight
from awescli.flightlog.smooth_motion import DIFFERENCE, FAINT, SmoothMotion
from awescli.flightlog.winch_motion import winch_motion, with_smooth_winch

DT, N = 0.02, 4000
TIME = DT * np.arange(N)
LENGTH = 200 + 1.5 * TIME + 0.8 * np.sin(2 * np.pi * TIME / 9) + 0.1 * np.sin(2 * np.pi * TIME / 2.5)
SPEED = 1.5 + 0.8 * 2 * np.pi / 9 * np.cos(2 * np.pi * TIME / 9) + 0.1 * 2 * np.pi / 2.5 * np.cos(2 * np.pi * TIME / 2.5)
SEEN = [np.ones(N, bool)] * 2


def noise(size: float, seed: int = 0) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(N)


def log_of(length: np.ndarray, speed: np.ndarray, valid: np.ndarray = SEEN[0]) -> FlightLog:
    return FlightLog("x", 0.0, DT, TIME, {}, {"tether_length": length.copy(), "reel_out_speed": speed.copy()}, valid)


def test_the_likelihood_is_that_of_dense_matrices():
    """Guards the bands: cost, log determinant and the likeliest length against dense algebra, some samples not seen."""
    n, random = 25, np.random.default_rng(1)
    length, speed = 100 + np.cumsum(random.standard_normal(n)), random.standard_normal(n)
    seen = random.random((2, n)) < 0.8
    at, rate, jerk = np.diag(np.where(seen[0], 1.0, FAINT**0.5)), np.zeros((n, n)), np.zeros((n - 3, n))
    for i in range(1, n - 1):
        rate[i, [i - 1, i + 1]] = -0.5 / DT, 0.5 / DT
    rate = rate[seen[1] & np.r_[False, np.ones(n - 2, bool), False]]
    for i in range(n - 3):
        jerk[i, i : i + 4] = DIFFERENCE / DT**3
    told = {}
    for levels in ((0.1, 0.5, 30.0), (0.3, 0.2, 3000.0)):
        w = 1 / np.square(levels)
        A = w[0] * at.T @ at + w[1] * rate.T @ rate + w[2] * jerk.T @ jerk
        inner = speed[1:-1][seen[1][1:-1]]
        best = np.linalg.solve(A, w[0] * at.T @ at @ length + w[1] * rate.T @ inner)
        cost = w[0] * ((at @ (length - best)) ** 2).sum() + w[1] * ((inner - rate @ best) ** 2).sum() + w[2] * ((jerk @ best) ** 2).sum()
        counts = seen[0].sum(), len(rate), len(jerk)
        deviance, found = SmoothMotion.of(length, speed, DT, *seen).solve(np.array(levels))
        assert np.allclose(found, best, atol=1e-6)
        told[levels] = deviance, cost + np.linalg.slogdet(A)[1] - np.log(w) @ counts
    (a, b), (c, d) = told.values()
    assert a - c == pytest.approx(b - d, abs=1e-6)


@pytest.mark.parametrize("of_length, of_speed", [(0.03, 0.02), (0.005, 0.1), (0.0, 0.05), (0.03, 0.0)])
def test_noise_returns_and_the_motion_is_found(of_length, of_speed):
    """Guards the levels (within a tenth) and what they are for: a tenth of either noise is left, or less than a line feels."""
    motion = winch_motion(LENGTH + noise(of_length), SPEED + noise(of_speed, 1), DT, SEEN)
    assert motion.noisy
    for found, true in ((motion.noise_length, of_length), (motion.noise_speed, of_speed)):
        assert found == pytest.approx(true, rel=0.1) if true else found < 0.001
    assert (motion.length - LENGTH).std() < max(0.12 * of_length, 0.0012) and (motion.speed - SPEED).std() < max(0.12 * of_speed, 0.006)


@pytest.mark.parametrize("gap", [10.0, 60.0, 76.0])
def test_a_long_gap_is_crossed_on_the_line(gap):
    """Guards logs with minutes missing: nothing at all over 60 s was a matrix that could not be factorised, and a log that was not read."""
    silent = (TIME > 2) & (TIME < 2 + gap)
    log = with_smooth_winch(log_of(np.where(silent, 0.0, LENGTH + noise(0.03)), np.where(silent, 0.0, SPEED + noise(0.02, 1)), ~silent))
    if gap < 76:
        assert log.notes and np.abs(log["tether_length"] - LENGTH)[silent].max() < 5
        assert (log["tether_length"] - LENGTH)[~silent].std() < 0.006
    else:
        assert not log.notes  # less than 5 s are left to say anything


@pytest.mark.parametrize("dt", [DT, 0.1])
def test_a_winch_that_stands_still_or_hardly_moves_is_read(dt):
    """Guards the reader: where the motion leaves nothing of a length, or a running sum rounds below nothing, a log could not be read."""
    time = dt * np.arange(4000)
    for length in (np.full(4000, 250.0), np.round(250 + 0.01 * np.sin(time), 2), np.round(250 + 0.8 * time, 1)):
        for speed in (np.gradient(length, dt), noise(0.05)):
            with np.errstate(all="raise"):
                motion = winch_motion(length, speed, dt, SEEN)
            assert np.isfinite(motion.length).all() and np.isfinite(motion.speed).all() and np.abs(motion.length - length).max() < 0.3


def test_a_motion_that_follows_steps_is_known_no_better_than_rounding_leaves_it():
    """Guards the usual encoder of 3 cm: at 1.5 m/s every row is a step, which a motion follows, and noise of 4 mm seemed to be all."""
    length = 200 + 1.5 * TIME - 0.03 * np.cos(2 * np.pi * TIME / 9)
    coarse = np.round(length / 0.03) * 0.03
    motion = winch_motion(coarse, np.gradient(coarse, DT), DT, SEEN)
    off = (motion.length - length).std()
    assert motion.noisy and 0.7 * off < motion.unknown.std < 2 * off


@pytest.mark.parametrize("step", [0.01, 0.1])
def test_a_coarse_encoder_and_a_speed_from_its_differences(step):
    """Guards the commonest winch of all: a length in whole centimetres or decimetres, and its differences as the speed."""
    coarse = np.round(LENGTH / step) * step
    for speed, left in ((SPEED, 0.005), (np.gradient(coarse, DT), 0.5 * step)):
        log = with_smooth_winch(log_of(coarse, speed))
        assert (log["tether_length"] - LENGTH).std() < 0.2 * step and (log["reel_out_speed"] - SPEED).std() < left
        assert any("recorded its length with noise" in note for note in log.notes)


def test_a_winch_without_noise_keeps_every_bit():
    """Guards logs that are good: four decimals are no noise."""
    log = log_of(np.round(LENGTH, 4), np.round(SPEED, 4))
    assert with_smooth_winch(log) is log
    alone = replace(log, inputs={"tether_length": LENGTH + noise(0.05)})
    assert with_smooth_winch(alone) is alone


@pytest.mark.parametrize("factor", [-1.0, 0.9, 1.2])
def test_a_speed_that_is_not_that_of_the_length_is_left_for_the_checks(factor):
    """Guards against hiding a mistake: a sign, a unit or a scale outlasts a second, and noise does not."""
    log = log_of(LENGTH + noise(0.02), factor * SPEED)
    assert with_smooth_winch(log) is log


def test_what_is_not_valid_does_not_count():
    """Guards gaps and dropouts: what a silent encoder says bends nothing beside it."""
    silent = np.zeros(N, bool)
    silent[1500:1600] = True
    length, speed = LENGTH + noise(0.02), SPEED + noise(0.02, 1)
    fine, log = (
        with_smooth_winch(log_of(np.where(silent, x, length), np.where(silent, y, speed), ~silent))
        for x, y in ((length, speed), (0.0, 0.0))
    )
    assert log.notes and np.allclose(log["tether_length"][~silent], fine["tether_length"][~silent], atol=1e-6)


def test_a_flight_is_read_with_a_smooth_winch(tmp_path):
    """Guards the reader: a folder whose winch is noted in whole decimetres gives the motion, before anything asks the log."""
    flight = write_folder(tmp_path / "flight", circle(), lambda table: table.with_columns(pl.col("tether_length").round(1)))
    log = read_flight(flight)
    assert np.abs(log["tether_length"] - (250 + 0.8 * log.time))[50:-50].max() < 0.01
    said = next(note for note in log.notes if "recorded its length with noise" in note)
    assert float(said.partition("noise of ")[2].split()[0]) == pytest.approx(100 / np.sqrt(12), rel=0.1)  # a step's, in mm


def test_what_cannot_be_factorised_is_no_likelihood_and_no_abort():
    """Guards the reader: levels that leave nothing but rounding are infinitely unlikely, and the log is read as it is."""
    deviance, _ = SmoothMotion.of(LENGTH, SPEED, DT, *(~SEEN[0], ~SEEN[0])).solve(np.array([1e6, 1e6, 1e-9]))
    assert deviance == np.inf


@pytest.mark.parametrize("within", [0.1, 0.4, 1.5])
def test_a_quick_reel_in_is_not_bent(within):
    """Guards cycles: minutes of steady reel-out and then a drum that turns within a second, in whole decimetres, with its differences as
    the speed. A jerk of one level cut the corner by 0.2 m, and the log stayed as it was: a clean flight was said to have a slow winch."""
    time = DT * np.arange(20_000)
    speed = 1.5 + 0.02 * np.sin(2 * np.pi * time / 9) - 4 * (1 + np.tanh((time - 370) / within))
    length = 200 + np.cumsum(speed) * DT
    coarse, seen = np.round(length, 1), [np.ones(len(time), bool)] * 2
    for recorded in (np.gradient(coarse, DT), speed + 0.02 * np.random.default_rng(0).standard_normal(len(time))):
        motion = winch_motion(coarse, recorded, DT, seen)
        steady = (motion.length - length)[1000:15_000].std()
        assert motion.noisy and steady < 0.002 and 1 < motion.unknown.std / steady < 4
        assert np.abs(motion.length - length)[18_000:-500].max() < 0.06
