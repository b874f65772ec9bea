"""Local quadratics through a signal."""

import numpy as np
import pytest

from awescli.flightlog.smoothing import local_quadratic


@pytest.mark.parametrize("dt", [0.01, 0.02, 0.1])
def test_a_quadratic_is_its_own_local_quadratic(dt):
    """Guards values and rates, at the ends too, whatever the clock, on several columns."""
    t = np.arange(200) * dt
    y = np.stack([1 + 2 * t - 3 * t**2, 0.5 * t], axis=1)
    slope = np.stack([2 - 6 * t, 0.5 + 0 * t], axis=1)
    assert local_quadratic(y, dt, 0.3) == pytest.approx(y, abs=1e-9)
    assert local_quadratic(y, dt, 0.3, derivative=1) == pytest.approx(slope, abs=1e-8)


def test_noise_is_averaged_over_the_span():
    """Guards the window: in its middle a quadratic through n points leaves 9/4n of the noise's variance (Savitzky & Golay), n = 17 here."""
    noise = np.random.default_rng(0).standard_normal(50_000)
    assert local_quadratic(noise, 0.02, 0.3)[20:-20].var() == pytest.approx(9 / (4 * 17), rel=0.05)


def test_what_is_shorter_than_a_window_is_left_alone():
    """Guards logs of a few samples."""
    y = np.array([1.0, 2.0, 4.0])
    assert np.array_equal(local_quadratic(y, 0.02, 0.3), y)
    assert np.array_equal(local_quadratic(y, 0.02, 0.3, derivative=1), np.gradient(y, 0.02))
