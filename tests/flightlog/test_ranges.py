"""Ranges of the parts, and the split that makes them alike: against reaches that can be counted, and flights whose edges are known."""

from dataclasses import replace

import numpy as np
import pytest
from flightlog.synthetic import circle
from hypothesis import given
from hypothesis import strategies as st

from awescli.flightlog.loops import Loops, find_loops
from awescli.flightlog.quality import data_quality
from awescli.flightlog.ranges import FARTHEST, LoopRanges, farthest, loop_ranges, part_ranges, ranges_check
from awescli.flightlog.split import PARTS, split


def one(low, high, kind="amplitude", least=0.1) -> LoopRanges:
    return LoopRanges("rudder rate", "deg/s", kind, np.array(low, float), np.array(high, float), least)


def mask(text: str) -> np.ndarray:
    return np.array([c == "x" for c in text])


def test_an_amplitude_reaches_in_times_of_the_largest_magnitude():
    """Guards both signs: -19 against 10 is 1.9 times; less is less; what train hardly moved counts as the least."""
    r = one([-10, -5, -19], [8, 10, 3])
    assert r.reach(mask("xx."), mask("..x")) == pytest.approx(1.9) and r.reach(mask("..x"), mask("xx.")) == pytest.approx(10 / 19)
    assert one([0, -1], [0, 2]).reach(mask("x."), mask(".x")) == pytest.approx(20)


def test_a_level_reaches_by_the_range_of_both_together():
    """Guards quantities without a zero: train 30 to 50 m/s, test 25 to 52 m/s: 27 over 20; inside it is 1."""
    r = one([30, 25, 35], [50, 52, 45], "level")
    assert r.reach(mask("x.."), mask(".x.")) == pytest.approx(27 / 20) and r.reach(mask("x.."), mask("..x")) == 1.0


def flown(samples=2000, late=1.0):
    """A log of circles whose rudder swings `late` times as wide and fast in its last fifth; ten loops of 4 s."""
    log = circle(seconds=40.0, period=4.0)
    time = log.time
    swing = 0.1 * np.sin(2 * np.pi * time / 2.0) * np.where(time > 0.8 * time[-1], late, 1.0)
    log = replace(log, inputs={**log.inputs, "rudder": swing})
    edges = np.linspace(0, len(log), 11).astype(int)
    return log, Loops("loops", np.column_stack([edges[:-1], edges[1:]]), "ten loops")


def test_the_check_names_what_the_test_part_reaches():
    """Guards the sentence: with the widest loops at the end, a chronological test reaches three times train's rudder rate, which is
    2 pi / 2 s times the deflection; the balanced one stays inside."""
    log, loops = flown(late=3.0)
    rows = part_ranges(loop_ranges(log, loops.bounds), loops.bounds, split(loops, order="chronological").stretches)
    rate = next(row for row in rows if row.name == "rudder rate")
    assert rate.train[1] == pytest.approx(np.rad2deg(0.1) * np.pi, rel=0.05) and rate.test_reach == pytest.approx(3.0, rel=0.05)
    check = ranges_check([rate])
    assert (check.name, check.ok) == ("ranges", False) and "Test reaches 3.0 times the rudder rate that train flew" in check.sentence
    balanced = part_ranges(loop_ranges(log, loops.bounds), loops.bounds, split(loops, log=log).stretches)
    assert ranges_check([r for r in balanced if r.name.startswith("rudder")]).ok
    assert next(r for r in balanced if r.name == "rudder rate").train[1] == pytest.approx(3 * np.rad2deg(0.1) * np.pi, rel=0.05)


def test_a_level_is_told_by_its_ranges():
    """Guards the other kind of sentence: where a line only gets longer, a chronological test part flies a length that train did not."""
    log, loops = flown()
    log = replace(log, inputs={**log.inputs, "tether_length": 200 + 4 * log.time})
    rows = part_ranges(loop_ranges(log, loops.bounds), loops.bounds, split(loops, order="chronological").stretches)
    check = ranges_check([r for r in rows if r.name == "tether length"])
    assert not check.ok and "Test flies tether length 312 to 360 m, train 200 to 280 m" in check.sentence


def test_quality_compares_ranges_once_it_knows_the_parts():
    """Guards the way into `awes check` and the report: the named check and its table, only with parts."""
    log, loops = flown(late=3.0)
    assert not data_quality(log).ranges and "ranges" not in [c.name for c in data_quality(log).checks]
    found = find_loops(log)
    quality = data_quality(log, parts=split(found, order="chronological"))
    assert {r.name for r in quality.ranges} >= {"rudder", "rudder rate"} and quality.checks[-1].name == "ranges"
    assert quality.as_dict()["ranges"][0]["train"] and not quality.checks[-1].ok


def test_spikes_and_invalid_samples_are_no_range():
    """Guards one bad sample, and filled ones: they neither widen a range, nor one of a rate, nor move loops between parts."""
    log, loops = flown()
    rudder, yaw_rate, valid = log["rudder"].copy(), log["r"].copy(), log.valid.copy()
    valid[1500:1520] = False
    rudder[1500:1520], yaw_rate[1000] = 9.0, 50.0
    hit = replace(log, measured={**log.measured, "r": yaw_rate}, inputs={**log.inputs, "rudder": rudder}, valid=valid)
    for clean, dirty in zip(*(loop_ranges(x, loops.bounds) for x in (log, hit)), strict=True):
        assert dirty.high == pytest.approx(clean.high, rel=0.1, abs=0.3), clean.name
    assert split(loops, log=hit) == split(loops, log=log)


# --- the balanced split ---


def pattern(parts, loops: Loops) -> str:
    """One letter per loop."""
    owner = {(a, b): c for name, c in zip(PARTS, "tvx", strict=True) for a, b in getattr(parts, name)}
    return "".join(next(c for (a, b), c in owner.items() if a <= first and last <= b) for first, last in loops.bounds)


def equal(count, length=100):
    first = np.arange(count) * length
    return Loops("loops", np.column_stack([first, first + length]), "equal")


def test_two_mirrored_stretches_where_nothing_asks_for_more():
    """Guards contiguity: 18 loops are three stretches of train and two of each other part, train at both ends."""
    assert pattern(split(equal(18)), equal(18)) == "ttvvxxxttttxxvvttt"
    assert pattern(split(equal(10)), equal(10)) == "tvxxttxvtt"


@given(st.integers(8, 80), st.floats(-3, 3), st.floats(0, 1))
def test_any_trend_is_alike_in_all_parts(count, slope, curve):
    """Guards what a line that gets longer does: of a quantity that runs through the flight, train flies both ends, and the parts' means
    differ by a quarter of its whole way at most."""
    parts = split(equal(count))
    at = (np.arange(count) + 0.5) / count
    signal = slope * (at + curve * at**2)
    mean = [signal[[c == k for c in pattern(parts, equal(count))]].mean() for k in "tvx"]
    assert max(mean) - min(mean) <= 0.25 * np.ptp(signal) + 1e-12
    assert pattern(parts, equal(count))[0] == pattern(parts, equal(count))[-1] == "t"


def test_more_stretches_where_a_middle_loop_goes_farthest():
    """Guards the search: the widest loop in a place that two stretches give to the test part is given to train, and as few stretches as
    do so are taken."""
    log, loops = flown()
    plain = split(loops, log=log)
    widest = pattern(plain, loops).index("x")
    a, b = loops.bounds[widest]
    rudder = log["rudder"].copy()
    rudder[a:b] *= 4
    wide = replace(log, inputs={**log.inputs, "rudder": rudder})
    ranges = loop_ranges(wide, loops.bounds)
    number = lambda parts: np.array(["tvx".index(c) for c in pattern(parts, loops)])  # noqa: E731
    assert farthest(ranges, number(plain)) > 3
    found = split(loops, log=wide)
    assert farthest(ranges, number(found)) <= FARTHEST and pattern(found, loops)[widest] == "t"


def test_small_changes_of_a_log_leave_the_split_alone():
    """Guards stability: noise on every channel, at the size of the sensors', moves no loop."""
    log, loops = flown(late=1.5)
    random = np.random.default_rng(0)
    for scale in (0.001, 0.003):
        noisy = replace(log, measured={n: s + scale * np.abs(s).max() * random.standard_normal(len(s)) for n, s in log.measured.items()})
        assert split(loops, log=noisy) == split(loops, log=log)
