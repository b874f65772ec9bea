"""Stamps that wobble: motion says whether the rows wobbled with them."""

import numpy as np
import pytest

from awescli.flightlog.regular_rows import regular_rows
from awescli.flightlog.resample import RawFlight, uniform_log
from awescli.notation.angles import wrap

DT, ROWS = 0.02, 4000
NOISE = {"p_n": 0.1, "p_e": 0.1, "phi": 0.003}
"""Standard deviations of the sensors: 0.1 m at 20 m/s hides 5 ms in one row."""


def motion(t: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """Loops of 10 s, 20 m/s, with a bank that goes over the end of its range, as sensors see them at times t."""
    random = np.random.default_rng(seed)
    turn = 2 * np.pi * t / 10
    true = {"p_n": 32 * np.sin(turn), "p_e": 32 * np.cos(turn), "phi": np.angle(np.exp(1j * (3 + 0.8 * np.sin(turn))))}
    return {n: x + NOISE[n] * random.standard_normal(t.size) for n, x in true.items()}


@pytest.mark.parametrize("wobble", [0.001, 0.003])
def test_motion_tells_regular_rows_from_true_stamps(wobble):
    """Guards both ways: the share of the wobble that motion shows is 0 where only stamps wobble and 1 where rows do, within its error."""
    even = DT * np.arange(ROWS)
    off = wobble * np.random.default_rng(1).standard_normal(ROWS)
    for seed in range(5):
        regular, true = (regular_rows(even + off, DT, motion(t, seed)) for t in (even, even + off))
        assert abs(regular.share) < 4 * regular.error and abs(true.share - 1) < 4 * true.error
        assert regular.clear and not true.clear and regular.wobble == pytest.approx(wobble, rel=0.05)


def test_noise_alone_says_nothing():
    """Guards against a choice without evidence: channels that do not move leave rows as they are stamped."""
    stamps = DT * np.arange(ROWS) + 0.003 * np.random.default_rng(2).standard_normal(ROWS)
    noise = {"p_n": np.random.default_rng(3).standard_normal(ROWS)}
    assert not regular_rows(stamps, DT, noise).clear and regular_rows(stamps, DT, {"p_n": np.ones(ROWS)}) is None
    assert regular_rows(stamps[:100], DT, {"p_n": stamps[:100]}) is None
    pairs = np.sort(np.concatenate([stamps, stamps + 1e-6]))  # no row has a turn of its own
    assert regular_rows(pairs, DT, {"p_n": pairs}) is None
    assert regular_rows(stamps, DT, motion(stamps), least=0.004) is None and regular_rows(stamps, DT, motion(stamps), least=0.002)


def test_missing_rows_and_a_slow_clock_are_followed():
    """Guards the clock: with one row in thirty missing and a clock that runs 80 ppm fast rows are put back to a tenth of what their stamps
    wobble by, none of them into another's place."""
    random, true = np.random.default_rng(4), DT * (1 + 80e-6) * np.arange(ROWS)
    kept = np.sort(random.choice(ROWS, ROWS - 130, replace=False))
    stamps = (true + 0.003 * random.standard_normal(ROWS))[kept]
    found = regular_rows(stamps, DT, motion(true[kept]))
    error = (found.times - true[kept])[found.alone]
    assert found.alone.mean() > 0.99 and found.clear
    assert error.std() < 0.0005 and np.abs(error).max() < 0.002


def test_rows_that_came_late_find_their_places():
    """Guards order: of two rows that seem to have come in one turn the first has the free turn before it. With as many late that nobody
    knows which is which, all stay as stamped."""
    random, even = np.random.default_rng(5), DT * np.arange(ROWS)
    late = np.where(random.random(ROWS) < 0.05, 1.2 * DT, 0.0) + 0.001 * random.standard_normal(ROWS)
    found = regular_rows(np.maximum.accumulate(even + late) + 1e-9 * np.arange(ROWS), DT, motion(even))
    error = (found.times - even)[found.alone]
    assert found.clear and found.alone.mean() > 0.98
    assert (np.abs(error - np.median(error)) < 0.001).mean() > 0.995  # but where two in a row came late
    for width, placed in ((0.6, True), (0.8, False), (1.0, False)):
        found = regular_rows(np.sort(even + width * DT * random.random(ROWS)), DT, motion(even))
        assert (found is not None and found.clear) is placed


def test_a_log_with_stamps_that_wobble_is_read_as_it_was_sampled():
    """Guards the reader: values stay what they were, set-points in their rows, and a sentence says so; true stamps are interpolated."""
    even = DT * np.arange(ROWS)
    stamps = even + 0.002 * np.random.default_rng(6).uniform(-1, 1, ROWS)
    values = motion(even)
    log = uniform_log(RawFlight("x", 0.0, stamps, {**values, "rudder": np.arange(ROWS)}, "x"))
    assert log.time.size == ROWS and np.array_equal(log["p_n"], values["p_n"])
    assert np.abs(wrap(log["phi"] - values["phi"])).max() < 1e-12
    assert np.array_equal(log["rudder"], np.arange(ROWS)) and log.counters["interpolated"] == 0
    assert any("Stamps wobble by 1.1 ms" in note for note in log.notes)
    other = uniform_log(RawFlight("x", 0.0, stamps, motion(stamps), "x"))
    assert other.counters["interpolated"] > ROWS / 4 and not any("wobble" in note for note in other.notes)
