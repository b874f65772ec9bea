"""Values that no model could follow: far off for a moment, or away and back at once; what a fit makes of them."""

import numpy as np
import pytest
from tracing.traced import null_model, with_errors

from awescli.estimation.outliers import _bursts, _off
from awescli.estimation.several_starts import GROSS, fit_from_starts, fit_without_outliers
from awescli.estimation.staged_fit import Flight

N = np.nan


@pytest.mark.parametrize(
    "r, dt, off",
    [
        ([0, 1, -9, 1, 0], 0.02, [2]),
        ([-1, 8, -9, 7, 2], 0.02, [1, 2, 3]),
        ([9, 0, 0, 0, 12], 0.02, [0, 4]),  # at the ends of a segment there is one side to ask
        ([0, 8, -9, 7, 8, 0], 0.02, []),  # too long for a moment,
        ([0, 8, -9, 7, 8, 0], 0.01, [1, 2, 3, 4]),  # and not where samples are twice as close
        ([0, 1, 8, 7, 0, 1], 0.05, []),  # two samples of 20 Hz are a tenth of a second
        ([0, 3.5, 5, 9, 5, 3.5, 0], 0.02, []),  # with shoulders: that is how something flies
        ([0, 3.5, 0, 9, 0, 1], 0.02, []),
        ([0, 1, 9, 0, 3.5, 0], 0.02, []),
        ([0, N, 1, N, 8, N, -9, N, 0, N, 1], 0.02, []),  # two values of a sensor of 25 Hz are 40 ms apart and last 80
        ([0, N, 1, N, 8, N, 0, N, 0, N, 1], 0.02, [4]),
        ([0, 1, 5, -25, 8, 0], 0.02, [2, 3, 4]),  # noise that holds the farthest makes the nearest look usual
        ([0, 1, 5.9, 1, 0], 0.02, []),
    ],
)  # fmt: skip
def test_what_is_far_off_for_a_moment_with_good_values_on_either_side(r, dt, off):
    assert _off(np.array(r, float), dt).tolist() == off


RISING = np.linspace(-0.5, -8.0, 10)
"""What a drift makes of the residual before a burst of 16 standard deviations."""


def residual(**changes) -> np.ndarray:
    """Noise of five seconds at 50 Hz, with `changes`: a slice as text -> what is added there."""
    r = np.random.default_rng(5).standard_normal(250)
    for where, size in changes.items():
        r[slice(*map(int, where.strip("_").split("_")))] += size
    return r


@pytest.mark.parametrize(
    "changes, dt, off",
    [
        ({}, 0.02, []),
        ({"_100_120": 14.0}, 0.02, range(100, 120)),
        ({"_100_120": 14.0, "_150_155": -20.0}, 0.02, [*range(100, 120), *range(150, 155)]),
        # a drift goes along
        ({"_90_100": RISING, "_100_110": -RISING[::-1], "_110_120": -RISING, "_120_130": RISING[::-1]}, 0.02, range(100, 120)),
        ({"_240_250": 14.0}, 0.02, range(240, 250)),  # beyond the end of the segment it may go on
        ({"_0_30": 14.0}, 0.02, range(30)),
        ({"_100_250": 14.0}, 0.02, []),  # a step is no burst
        ({"_100_160": 14.0}, 0.02, []),  # nor is what stays for longer than a second,
        ({"_100_160": 14.0}, 0.01, range(100, 160)),  # which is as many samples more at twice the rate
        ({"_100_108": 14.0}, 0.05, range(100, 108)),
        ({"_100_108": 14.0}, 0.1, []),  # at 10 Hz a kite moves between two values
        ({"_100_140": 14.0 * np.sin(np.linspace(0.0, np.pi, 40))}, 0.02, []),  # as slowly as something flies
        ({"_0_250": 200.0, "_100_120": 14.0}, 0.02, []),  # where a model has run away
        # a position that is corrected twice, before it ends
        ({"_228_236": np.linspace(0.0, 5.0, 8), "_236_244": np.linspace(-5.0, 7.0, 8), "_244_250": -9.0}, 0.02, []),
        ({"_100_101": 14.0}, 0.02, []),  # a single value is not for this rule
    ],
)  # fmt: skip
def test_what_goes_off_at_once_and_comes_back_at_once(changes, dt, off):
    assert sorted(_bursts(residual(**changes), dt)) == list(off)


def test_of_a_slow_sensor_no_burst_is_told():
    slow = np.full(250, N)
    slow[::5] = residual(_100_150=14.0)[::5]
    assert _bursts(slow, 0.02).size == 0 and _bursts(np.full(250, N), 0.02).size == 0


def fitted_to(frame, how=fit_without_outliers):
    """A fit to a frame's flight from where its user declares it."""
    return how([Flight(p, f.label) for p, f in zip(frame.problems(()), frame.flights, strict=True)], [1.0], 1, 0)


def test_gross_ones_do_not_drag_a_fit_along():
    """Guards `identify` on dirty logs: a position 4 m off for half a second moved parameters by many standard deviations, and made others
    look unknown. What is left out is what was put in, and the fit is that of the clean flight."""
    frame, _ = null_model()
    first = int(frame.problems(())[0].fitted.segments.first[1]) + 30
    dirty = with_errors(frame, {"p_e": {first + k: 40.0 for k in range(25)}, "q": {first: 9.0}})
    clean, *_ = fitted_to(frame, fit_from_starts)
    dragged, *_ = fitted_to(dirty, fit_from_starts)
    (found, _, _), (flight,), many = fitted_to(dirty)
    std = np.sqrt(np.diag(clean.covariance))
    assert many == {"p_e": 25} and 25 * 40.0**2 > GROSS > 9.0**2
    assert not flight.problem.log.is_new("p_e")[first : first + 25].any() and flight.problem.log.is_new("q").all()
    assert np.abs((dragged.solution.x - clean.solution.x) / std).max() > 2.0
    assert np.abs((found.solution.x - clean.solution.x) / std).max() < 0.5


def test_of_a_clean_flight_nothing_is_left_out():
    frame, _ = null_model()
    (found, problems, _), (flight,), many = fitted_to(frame)
    assert many == {} and found.ended and flight.problem.log is frame.flights[0].log
