"""Rotations against scipy's, there and back, and on complex numbers."""

import numpy as np
import pytest
from oracles import body_to_ned

from awescli.notation.frames import add, cross, dot, rotate, rotate_back, rotation_body_to_ned, scale

RANDOM = np.random.default_rng(0)
ANGLES = RANDOM.uniform(-3.1, 3.1, (20, 3))


@pytest.mark.parametrize("euler", ANGLES)
def test_the_rotation_is_zyx(euler):
    """Guards order and signs of the three elementary rotations (body to NED), against an independent composition."""
    assert np.array(rotation_body_to_ned(*euler)) == pytest.approx(body_to_ned(*euler), abs=1e-15)


@pytest.mark.parametrize("euler", ANGLES)
def test_there_and_back(euler):
    """Guards `rotate_back` being the transpose, and the matrix being orthogonal."""
    R, a = rotation_body_to_ned(*euler), tuple(RANDOM.standard_normal(3))
    assert rotate_back(R, rotate(R, a)) == pytest.approx(a, abs=1e-15)
    assert np.array(R) @ np.array(R).T == pytest.approx(np.eye(3), abs=1e-15)


def test_known_attitudes():
    """Guards the meaning: nose up lifts body x against down; a right bank puts body y down; heading east puts body x east."""
    assert rotate(rotation_body_to_ned(0.0, np.pi / 2, 0.0), (1.0, 0.0, 0.0)) == pytest.approx((0, 0, -1), abs=1e-15)
    assert rotate(rotation_body_to_ned(np.pi / 2, 0.0, 0.0), (0.0, 1.0, 0.0)) == pytest.approx((0, 0, 1), abs=1e-15)
    assert rotate(rotation_body_to_ned(0.0, 0.0, np.pi / 2), (1.0, 0.0, 0.0)) == pytest.approx((0, 1, 0), abs=1e-15)


def test_the_rotation_is_differentiable_through_complex_numbers():
    """Guards against an abs or a real cast in the rotation: d R / d phi by complex step is the analytic one."""
    phi, theta, psi = 0.3, -0.4, 1.2
    d = np.imag(np.array(rotation_body_to_ned(phi + 1e-200j, theta, psi))) / 1e-200
    # dR/dphi = R [e_x]x
    assert d == pytest.approx(body_to_ned(phi, theta, psi) @ np.array([[0, 0, 0], [0, 0, -1], [0, 1, 0]]), abs=1e-15)


def test_vector_algebra():
    """Guards signs of the cross product (x cross y is z) and the small helpers."""
    a, b = tuple(RANDOM.standard_normal(3)), tuple(RANDOM.standard_normal(3))
    assert cross((1, 0, 0), (0, 1, 0)) == (0, 0, 1)
    assert cross(a, b) == pytest.approx(np.cross(a, b), abs=1e-15)
    assert (
        dot(a, b) == pytest.approx(np.dot(a, b))
        and add(a, b) == pytest.approx(np.add(a, b))
        and scale(2.0, a) == (2 * a[0], 2 * a[1], 2 * a[2])
    )
