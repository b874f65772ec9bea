"""Uniform clock: what is regular stays as it is, what is missing is marked."""

import numpy as np
import pytest

from awescli.flightlog.clocks import clock_offset
from awescli.flightlog.resample import RawFlight, sample_interval, uniform_log, usable_stamps
from awescli.notation.angles import wrap
from awescli.notation.errors import BadInput


def raw(stamps, **signals):
    return RawFlight("x", 1e9, np.asarray(stamps, float), {k: np.asarray(v, float) for k, v in signals.items()}, "x.csv")


def test_regular_samples_keep_every_bit():
    rng = np.random.default_rng(1)
    for rate in (10, 30, 50, 100, 400):
        stamps = np.round(np.arange(1000) / rate, 3)
        x = rng.standard_normal(1000)
        log = uniform_log(raw(stamps, p_n=x, psi=wrap(x), rudder=x))
        assert abs(1 / log.dt - rate) < 1e-9 and np.array_equal(log["p_n"], x) and np.array_equal(log["rudder"], x) and log.valid.all()


def test_irregular_samples_are_interpolated_and_set_points_held():
    rng = np.random.default_rng(2)
    stamps = np.arange(2000) * 0.02 + rng.uniform(-0.006, 0.006, 2000)
    angle = 3.0 * stamps
    log = uniform_log(raw(stamps, p_n=stamps - stamps[0], psi=wrap(angle - angle[0]), rudder=np.arange(2000)))
    assert np.abs(log["p_n"] - log.time).max() < 0.0011
    assert np.abs(wrap(log["psi"] - 3.0 * log.time)).max() < 0.0033 and np.abs(log["psi"]).max() <= np.pi
    assert np.all(log["rudder"] == np.round(log["rudder"]))


def test_bad_stamps_are_removed_and_counted():
    stamps = np.arange(500) * 0.02
    stamps[100] = stamps[99]
    stamps[200] = 1e6
    stamps[300] -= 0.05
    stamps[400] = np.nan
    keep, removed = usable_stamps(stamps)
    assert removed == {"unreadable": 1, "stray": 1, "repeated": 1, "backward": 1}
    assert set(range(500)) - set(keep.tolist()) == {100, 200, 300, 400}
    log = uniform_log(raw(stamps, p_n=np.arange(500)))
    assert log.valid.all() and np.allclose(log["p_n"], np.arange(500))


def test_gaps_are_marked_and_short_ones_filled():
    stamps = np.delete(np.arange(1000) * 0.02, [*range(200, 205), *range(600, 650)])
    log = uniform_log(raw(stamps, p_n=stamps), max_gap=0.2)
    assert len(log) == 1000 and np.allclose(log["p_n"], log.time)
    assert np.array_equal(np.flatnonzero(~log.valid), np.arange(600, 650)) and log.counters["gaps"] == 1


def test_clocks_of_groups_are_moved():
    t = np.arange(500) * 0.02
    log = uniform_log(RawFlight("x", 0.0, t, {"p_n": t.copy(), "tether_length": t - 1.0}, "x", {"tether_length": "winch"}, {"winch": 1.0}))
    assert np.allclose(log["tether_length"][log.valid], log.time[log.valid]) and (~log.valid).sum() == 50 and not log.valid[-1]


def test_impossible_clocks_are_refused():
    with pytest.raises(BadInput, match="spread over"):
        uniform_log(raw([*np.arange(10) * 0.02, *(1e9 + np.arange(10) * 0.02)], p_n=np.zeros(20)))
    with pytest.raises(BadInput, match="At least 3"):
        uniform_log(raw(np.zeros(100), p_n=np.zeros(100)))
    assert sample_interval(np.round(np.arange(100) / 30, 3)) == 1 / 30


def test_clock_offset_is_found():
    rng = np.random.default_rng(3)
    t = np.arange(3000) * 0.02
    slow = np.sin(0.9 * t) * 3 + np.sin(0.23 * t) * 2
    late = np.sin(0.9 * (t - 1.7)) * 3 + np.sin(0.23 * (t - 1.7)) * 2
    seen = clock_offset(slow + 0.2 * rng.standard_normal(t.size), late, 0.02)
    assert seen.clear and abs(seen.late - 1.7) < 0.05
    assert clock_offset(np.ones(500), late[:500], 0.02) is None
