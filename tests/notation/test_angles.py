"""Angles across a full turn."""

import numpy as np
import pytest

from awescli.notation.angles import mean_direction, wrap


def test_wrapped_angles_point_the_same_way():
    """Guards the range (-pi, pi] and that a whole turn is all that is taken off."""
    angle = np.linspace(-50, 50, 9999)
    wrapped = wrap(angle)
    assert wrapped.min() > -np.pi and wrapped.max() <= np.pi
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * angle), abs=1e-13)
    assert wrap(-np.pi) == np.pi and np.isnan(wrap(np.array([np.nan]))).all()


def test_angles_inside_keep_every_bit():
    """Guards recorded angles: reading a log must not round what needs no wrapping."""
    angle = np.random.default_rng(0).uniform(-3.14, 3.14, 1000)
    assert np.array_equal(wrap(angle), angle) and np.array_equal(wrap(np.append(angle, 4.0))[:-1], angle)


def test_the_mean_of_directions_does_not_mind_north():
    """Guards directions on both sides of the turn: 350 and 20 deg have the mean 5 deg."""
    assert mean_direction(np.deg2rad([350.0, 20.0])) == pytest.approx(np.deg2rad(5.0))
