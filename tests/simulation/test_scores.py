"""One metric per function, against hand-computed values."""

import numpy as np
import pytest
from kites import DEVELOPMENT

from awescli.notation.angles import wrap
from awescli.simulation import scores
from awescli.simulation.segments import noise_std


def test_nrmse_is_the_error_over_the_range():
    """Guards the definition of docs/equations.md (30): RMSE / (max - min) of the measured signal."""
    e = np.array([[3.0, -4.0], [0.0, 0.0]])
    assert scores.rmse(e) == 2.5 and scores.nrmse(e, 10.0) == 0.25
    assert scores.span(np.array([-2.0, 8.0])) == 10.0
    assert scores.span(np.zeros(3)) == 1.0  # a dead channel must not divide by zero


def test_angle_errors_are_wrapped():
    """Guards a heading near north: 359 degrees against 1 degree is an error of 2, not 358; other channels are left alone."""
    a, b = np.radians([179.0, -179.0, 10.0]), np.radians([-179.0, 179.0, 370.0])
    assert np.degrees(scores.error(a, b, "psi")) == pytest.approx([-2.0, 2.0, 0.0], abs=1e-9)
    assert scores.error(a, b, "p_n") == pytest.approx(a - b)
    assert wrap(np.pi) == pytest.approx(np.pi) and wrap(-np.pi) == pytest.approx(np.pi)
    assert np.abs(wrap(np.linspace(-50, 50, 999))).max() <= np.pi


def test_r_squared_and_theil():
    """Guards the two relatives: 1 and 0 for a perfect model, 0 for one that knows only the mean, 1 for the wrong sign."""
    y = np.array([1.0, 2.0, 3.0, 4.0])
    assert scores.r_squared(0 * y, y) == 1.0 and scores.r_squared(y - y.mean(), y) == pytest.approx(0.0)
    assert scores.r_squared(y, 0 * y + 2.0) == 0.0
    assert scores.theil(0 * y, y, y) == 0.0 and scores.theil(2 * y, y, -y) == pytest.approx(1.0)
    assert scores.theil(0 * y, 0 * y, 0 * y) == 0.0


def test_every_channel_has_the_noise_of_the_kite_file():
    """Guards the weights of the fit: each channel its own noise, the load its share of itself with a floor."""
    noise, signal = DEVELOPMENT.noise, np.array([1000.0, 3000.0, 0.0])
    for name, value in {"p_n": 0.1, "p_d": 0.15, "v_e": 0.05, "theta": 0.00349, "q": 0.00524, "a_z": 0.2, "V_a": 0.3}.items():
        assert (noise_std(noise, name, signal) == value).all(), name
    load = noise_std(noise, "tension", signal)
    assert load[:2] == pytest.approx([10.0, 30.0]) and 0 < load[2] < 2.0


def test_an_interval_over_loops_holds_the_share_as_often_as_it_says():
    """Guards the interval of few loops: in 2000 draws of 5 loops with errors of 5 % each, 95 % hold the true share; resampling loops,
    the usual other way, would hold it in 84 %."""
    random, held, resampled, draws = np.random.default_rng(0), 0, 0, 2000
    for _ in range(draws):
        measured = 1000 * (1 + 0.1 * random.standard_normal(5))
        simulated = measured * (0.9 + 0.05 * random.standard_normal(5))
        low, high = scores.share_interval(measured, simulated)
        held += low <= -0.1 <= high
        again = random.integers(0, 5, (500, 5))
        low, high = np.percentile(simulated[again].sum(axis=1) / measured[again].sum(axis=1) - 1, [2.5, 97.5])
        resampled += low <= -0.1 <= high
    assert held / draws == pytest.approx(0.95, abs=0.015) and resampled / draws < 0.88


def test_an_interval_needs_two_loops_and_something_to_share():
    """Guards one loop, and loops whose energies cancel."""
    assert scores.share_interval(np.array([5.0]), np.array([4.0])) is None
    assert scores.share_interval(np.array([5.0, -5.0]), np.array([4.0, 1.0])) is None
