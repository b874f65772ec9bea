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


def test_of_a_value_that_stands_in_several_rows_the_first_is_the_measurement():
    """Guards against: a receiver of 4 Hz in rows of 50 Hz read as 50 late values a second. 12 or 13 rows each, and three missing rows."""
    t = np.arange(3000) * 0.02
    newest = np.floor(t / 0.25 + 1e-9) * 0.25
    rows = np.delete(np.arange(3000), [1000, 1001, 1002])
    heading = wrap(0.3 * newest)
    log = uniform_log(raw(t[rows], v_n=np.sin(newest)[rows], psi=heading[rows], p=np.sin(t)[rows], rudder=np.sign(np.sin(newest))[rows]))
    assert set(log.fresh) == {"v_n", "psi", "p"} and "v_n, psi:" in "".join(log.notes)
    assert set(np.flatnonzero(~log.fresh["p"])) == {1000, 1001, 1002}
    for name in ("v_n", "psi"):
        new = log.fresh[name]
        # the first row of each value, as it was; nothing in between counts, and between them it is on the line
        first = np.flatnonzero(np.diff(newest) > 0) + 1
        assert set(np.flatnonzero(new)) <= set(first) and len(first) - new.sum() <= 2
        assert np.array_equal(log[name][new], (np.sin(newest) if name == "v_n" else heading)[new])
    late = np.abs(log["v_n"] - np.sin(log.time))[log.valid]
    assert late.max() < 0.03  # the row in which it came, and the chord; held it would be 0.25
    assert np.array_equal(log["rudder"], np.sign(np.sin(newest))), "a set-point holds"
    assert log.valid.mean() > 0.98


def test_a_coarse_reading_is_not_held():
    """Guards against: a channel of few digits, which repeats by chance, taken for a slow one."""
    rng = np.random.default_rng(3)
    t = np.arange(3000) * 0.02
    for scale in (0.2, 0.5, 1.0):
        coarse = np.round(10 * np.sin(t) + scale * rng.standard_normal(3000))
        assert not uniform_log(raw(t, V_a=coarse)).fresh


def test_an_encoder_at_a_steady_speed_is_coarse_and_not_held():
    """Guards a length in whole decimetres that grows evenly: each value stands for six rows, and the first of them is half a step ahead."""
    t = np.arange(3000) * 0.02
    assert not uniform_log(raw(t, tether_length=np.round(250 + 0.8 * t, 1))).fresh
    assert uniform_log(raw(t, tether_length=(250 + 0.8 * t + 0.01 * np.sin(t))[np.arange(3000) // 6 * 6])).fresh


def test_a_sensor_a_little_slower_than_its_rows_shows_by_channels_that_repeat_together():
    """6.7 Hz in rows of 10 Hz: values stand in one row or two, attitude and velocity in the same ones; a coarse reading beside is left."""
    t = np.arange(2000) * 0.1
    rng = np.random.default_rng(4)
    newest = np.floor(t * 6.7) / 6.7
    noise = rng.standard_normal((2, 1340))[:, np.floor(t * 6.7).astype(int)]
    roll, coarse = 0.1 * np.sin(newest) + 0.01 * noise[0], np.round(rng.standard_normal(2000))
    log = uniform_log(raw(t, phi=roll, v_n=newest + 0.1 * noise[1], V_a=coarse))
    assert set(log.fresh) == {"phi", "v_n"} and 0.64 < log.fresh["phi"].mean() < 0.68
    assert not uniform_log(raw(t, phi=roll, V_a=coarse)).fresh


@pytest.mark.parametrize("jitter", [0.0, 0.006])
def test_what_is_on_the_line_over_missing_rows_is_no_measurement(jitter):
    """Guards against: a straight line over 0.1 s counted as five measurements of what turned in between, and a set-point that stood still
    meanwhile. Irregular stamps alone are no missing rows."""
    t, missing = np.arange(1000) * 0.02, set(range(200, 205))
    rows = np.delete(np.arange(1000), list(missing))
    p = np.sin(20 * t)
    p[400] = np.nan  # a spike that was taken out
    stamps = t + np.random.default_rng(5).uniform(-jitter, jitter, 1000)
    log = uniform_log(raw(stamps[rows], p=p[rows], q=np.cos(t)[rows], rudder=(rows > 202) * 1.0))
    assert log.valid[:-1].all() and "rudder" not in log.fresh
    stale = {n: set(np.flatnonzero(~log.fresh[n])) - {len(log) - 1} for n in ("p", "q")}
    assert missing - {200, 204} <= stale["q"] <= missing | {199, 205} and stale["p"] - stale["q"] <= {399, 400, 401}
    if not jitter:
        assert stale == {"q": missing, "p": missing | {400}}
    # a controller went on over the missing rows, and held its set-point elsewhere
    assert 0 < log["rudder"][202] < 1 and set(log["rudder"][[190, 220, 300]]) == {0.0, 1.0}
