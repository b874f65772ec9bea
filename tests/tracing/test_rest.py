"""What is left: what repeats from loop to loop is seen, what does not is not called so; noise does not grow to hide it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from tracing.traced import null_model

from awescli.estimation.processes.base import Group
from awescli.tracing.criteria import CRITERIA
from awescli.tracing.rest import (
    BINS,
    FEWEST,
    Repetition,
    Rest,
    gusts_of,
    gusty,
    lasting,
    paid,
    repeated,
    repetition_of,
    rest_of,
    step_of,
)

LOOPS = 10
STEP = 0.8
GUST = Group.known("gusts", ("gust_n",), 0.7, 6.0)


def smooth(seed: int, rows: int = LOOPS) -> np.ndarray:
    """(rows, BINS) of rows that are smooth along the loop, each with a phase of its own: what a slow process leaves."""
    white = np.random.default_rng(seed).standard_normal((rows, BINS))
    return sum(np.roll(white, k, axis=1) for k in range(4)) / 2


def test_a_pattern_in_noise_is_found():
    """Guards the test for what repeats: a pattern with half of the variance is seen with its share, whatever the rows' means."""
    pattern = np.sqrt(2) * np.sin(2 * np.pi * np.arange(BINS) / BINS)
    shares = []
    for seed in range(10):
        offsets = 3 * np.random.default_rng(seed).standard_normal((LOOPS, 1))
        share, p = repeated(pattern + smooth(seed) + offsets)
        shares.append(share)
        assert p < 0.01
        assert Repetition({"force_z": share}, {"force_z": p}, LOOPS).repeats()
    assert np.mean(shares) == pytest.approx(0.55, abs=0.1)  # means of rows taken off, noise loses a part of its variance


def test_smooth_chance_is_not_called_a_pattern():
    """Guards the false alarm: of rows that are smooth and do not repeat p is uniform, and a share of nothing is near zero."""
    found = np.array([repeated(smooth(100 + seed), seed) for seed in range(80)])
    assert stats.kstest(found[:, 1], "uniform").pvalue > 0.01
    assert found[:, 0].mean() < 0.1 and (found[:, 1] < 0.01).sum() <= 3


def with_gaps(table: np.ndarray, seed: int) -> np.ndarray:
    """The table with a third of each loop not seen, wherever a segment ended."""
    begins = np.random.default_rng(seed).integers(0, BINS, len(table))
    unseen = (np.arange(BINS) - begins[:, None]) % BINS < BINS // 3
    return np.where(unseen, np.nan, table)


def test_loops_that_were_flown_in_part_count():
    """Guards short segments on longer loops: of 19 loops two were whole, and nothing could be said of what repeats (JSBSim, own wake). A
    pattern is seen through the gaps, and chance is not."""
    pattern = np.sqrt(2) * np.sin(2 * np.pi * np.arange(BINS) / BINS)
    found = [repeated(with_gaps(pattern + smooth(seed), seed)) for seed in range(10)]
    assert np.mean([share for share, _ in found]) == pytest.approx(0.5, abs=0.12) and sum(p < 0.01 for _, p in found) >= 8
    chance = np.array([repeated(with_gaps(smooth(300 + seed), seed), seed) for seed in range(80)])
    assert stats.kstest(chance[:, 1], "uniform").pvalue > 0.01
    assert chance[:, 0].mean() < 0.1 and (chance[:, 1] < 0.01).sum() <= 3


def gusts_in_loops(seed: int, group: Group = GUST, loops: int = LOOPS) -> np.ndarray:
    """(loops, BINS) of an Ornstein-Uhlenbeck process, STEP apart, from loop to loop without a break."""
    kept, random, path = np.exp(-STEP / group.memory), np.random.default_rng(seed), [0.0]
    for step in random.standard_normal(loops * BINS) * group.level * np.sqrt(1 - kept**2):
        path.append(kept * path[-1] + step)
    return np.reshape(path[1:], (loops, BINS))


def test_what_a_process_pays_for_a_pattern_is_what_a_term_that_says_it_gains():
    """Guards the worth of what repeats, against dense generalised least squares: the quadratic form of the pattern in the process's own
    covariance. With gaps it is paid where it was seen; of chance it is next to nothing."""
    times = STEP * np.arange(LOOPS * BINS)
    covariance = GUST.level**2 * np.exp(-np.abs(np.subtract.outer(times, times)) / GUST.memory)
    for size in (0.4, 0.8):
        pattern = size * np.sin(2 * np.pi * np.arange(BINS) / BINS)
        exact = np.tile(pattern, LOOPS) @ np.linalg.solve(covariance, np.tile(pattern, LOOPS))
        tables = [pattern + gusts_in_loops(seed) for seed in range(100)]
        assert np.mean([paid(table, STEP, GUST) for table in tables]) == pytest.approx(exact, rel=0.1)
        assert np.mean([paid(with_gaps(t, i), STEP, GUST) for i, t in enumerate(tables)]) == pytest.approx(2 / 3 * exact, rel=0.2)
    assert np.mean([paid(gusts_in_loops(seed), STEP, GUST) for seed in range(100)]) < 4


def test_what_grows_or_breaks_is_seen_to_go_on():
    """Guards random for what is not: ice that grows through a flight and a tip that breaks at a third of it are the same in no two loops,
    repeat at no phase, and were called chance (JSBSim)."""
    loops = np.arange(15)
    for course in (np.sqrt(3) * np.linspace(-1, 1, len(loops)), np.where(loops < 5, -1.4, 0.7)):
        tables = [2 * course[:, None] + smooth(seed, len(loops)) for seed in range(10)]
        found = [lasting(table) for table in tables]
        assert all(p < 0.01 for _, p in found)
        assert all(Repetition({"moment_y": share}, {"moment_y": p}, len(loops)).repeats() for share, p in found)
        assert np.mean([repeated(table)[0] for table in tables]) < 0.15


def test_chance_is_not_said_to_go_on():
    """Guards the false alarm: of loops in no order p is uniform, gaps or not."""
    for table in (smooth, lambda seed: with_gaps(smooth(seed), seed)):
        found = np.array([lasting(table(500 + seed), seed) for seed in range(80)])
        assert stats.kstest(found[:, 1], "uniform").pvalue > 0.01
        assert found[:, 0].mean() < 0.05 and (found[:, 1] < 0.01).sum() <= 3


@pytest.mark.parametrize("memory", [2.0, 6.0, 20.0, 60.0])
@pytest.mark.parametrize("loops", [4, 8, 20])
def test_a_drift_that_wanders_does_not_step(memory, loops):
    """Guards the false alarm: of drifts of any memory, in few loops or many, gaps or not, the largest step is a few of the usual ones."""
    drift = Group.known("airspeed drift", ("V_a",), 0.5, memory)
    for gaps in (False, True):
        tables = [gusts_in_loops(seed, drift, loops) for seed in range(100)]
        found = np.array([step_of(with_gaps(table, seed) if gaps else table) for seed, table in enumerate(tables)])
        assert 1.0 < np.median(found) < 4.0 and (found > CRITERIA.drift_step).sum() <= 1


def test_a_sensor_that_changes_in_flight_steps():
    """Guards what a sensor does once, wherever in the flight, its own drift beside; and that level and unit do not matter."""
    drift = Group.known("airspeed drift", ("V_a",), 0.5, 6.0)
    for seed, part in enumerate((0.25, 0.5, 0.75)):
        table = gusts_in_loops(seed, drift, 16)
        path = np.arange(table.size).reshape(table.shape) >= part * table.size
        assert step_of(table) < 5.0 < CRITERIA.drift_step < step_of(0.2 * table + 2.0 * path)
        assert step_of(100.0 * table) == pytest.approx(step_of(table))
    assert step_of(np.zeros((8, BINS))) == 0.0 and step_of(np.full((8, BINS), np.nan)) == 0.0


def test_many_axes_must_not_repeat_by_their_number():
    """Guards Bonferroni over the axes: one of six at 0.005 is chance."""
    axes = [f"axis {i}" for i in range(6)]
    assert not Repetition(dict.fromkeys(axes, 0.5), {**dict.fromkeys(axes, 0.5), "axis 0": 0.005}, 8).repeats()
    assert Repetition({"force_z": 0.5}, {"force_z": 0.005}, 8).repeats()
    assert not Repetition({"force_z": 0.1}, {"force_z": 0.001}, 8).repeats()  # for sure, and yet next to nothing


def test_noise_does_not_grow_to_hide_what_is_missing():
    """Guards "1 is noise alone": without model error a flight with an effect that is missing leaves far more than the noise that was found
    with it, in all and on the channels where it shows; a clean flight leaves noise."""
    frame, null = null_model((("sideslip_drag", (("k", 2.5),)),), seed=32)
    assert null.rest
    _, left = rest_of(frame, null)
    assert left.chi2 > 1.5 and left.channels[left.largest] > 2 and left.worth > 100
    frame, null = null_model()
    bare, left = rest_of(frame, null)
    assert bare is null and left.chi2 == pytest.approx(1.0, abs=0.06) and left.worth == 0 and left.repetition is None


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_of_several_flights_the_one_is_asked_where_something_is_left(order):
    """Guards against an error: a trace of five flights ended where the first of them left nothing and another did."""
    both = null_model(), null_model((("sideslip_drag", (("k", 2.5),)),), seed=32, duration=120.0)
    frames, models = zip(*(both[i] for i in order), strict=True)
    of_both = SimpleNamespace(
        problems=[m.problems[0] for m in models], judged=[m.judged[0] for m in models],
        fit=SimpleNamespace(flights=[m.fit.flights[0] for m in models]),
    )  # fmt: skip
    frame, model = both[1]
    axes = [(axis, axis) for axis in model.rest]
    found = repetition_of(SimpleNamespace(flights=[f.flights[0] for f in frames]), of_both, axes, repeated)
    assert axes and found == repetition_of(frame, model, axes, repeated) and found.loops >= FEWEST


def test_of_several_flights_the_strongest_gusts_count():
    """Guards "nothing is missing" of two flights of which the second is in gusts: only the first was asked for its air."""
    air = [SimpleNamespace(processes=[SimpleNamespace(certain=False, groups=(replace(GUST, level=level),))]) for level in (0.05, 0.6)]
    both = SimpleNamespace(problems=air)
    assert gusty(both) and [g.level for g in gusts_of(both)] == [0.6] and [g.level for g in gusts_of(both, 0)] == [0.05]
    assert not gusty(SimpleNamespace(problems=air[:1]))


def test_a_slow_channel_may_leave_more_by_chance():
    """Guards against: a receiver of 5 Hz beside rates of 50 Hz is above its floor by chance alone."""
    left = Rest(0.0, 1.0, {"p": 1.12, "p_n": 1.2}, {}, None, 2200, by_channel={"p": 2000.0, "p_n": 200.0})
    assert left.floor_of("p_n") == pytest.approx(1.1 + 2 * 0.1) and left.floor_of("p") == pytest.approx(1.1 + 2 * 0.0316, abs=1e-4)
    assert left.largest == "p" and left.floor_of("another") == pytest.approx(1.1 + 2 * (2 / 1100) ** 0.5)
