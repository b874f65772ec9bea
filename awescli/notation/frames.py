"""Rotations between body, NED and wind axes, written once for floats, arrays, tensors and recorded scalars."""

from collections.abc import Sequence

from awescli.notation.scalars import Scalar, cos, sin

Vector = tuple[Scalar, Scalar, Scalar]
Rotation = tuple[Vector, Vector, Vector]


def rotation_body_to_ned(phi: Scalar, theta: Scalar, psi: Scalar) -> Rotation:
    """Rows of R_b2i (ZYX Euler angles [rad]); v_ned = R v_body. docs/equations.md (1); Beard & McLain eq. 2.5 transposed."""
    s_f, c_f, s_t, c_t, s_p, c_p = sin(phi), cos(phi), sin(theta), cos(theta), sin(psi), cos(psi)
    return (
        (c_t * c_p, s_f * s_t * c_p - c_f * s_p, c_f * s_t * c_p + s_f * s_p),
        (c_t * s_p, s_f * s_t * s_p + c_f * c_p, c_f * s_t * s_p - s_f * c_p),
        (-s_t, s_f * c_t, c_f * c_t),
    )


def rotate(R: Sequence[Sequence[Scalar]], a: Sequence[Scalar]) -> Vector:
    """R a for a 3x3 nested tuple R and a 3-tuple a: body -> NED with R = R_b2i."""
    return tuple(row[0] * a[0] + row[1] * a[1] + row[2] * a[2] for row in R)


def rotate_back(R: Sequence[Sequence[Scalar]], a: Sequence[Scalar]) -> Vector:
    """R^T a: NED -> body with R = R_b2i."""
    return tuple(R[0][i] * a[0] + R[1][i] * a[1] + R[2][i] * a[2] for i in range(3))


def cross(a: Sequence[Scalar], b: Sequence[Scalar]) -> Vector:
    """a x b for 3-tuples."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """a . b for 3-tuples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def add(a: Sequence[Scalar], b: Sequence[Scalar]) -> Vector:
    """a + b for 3-tuples."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def scale(s: Scalar, a: Sequence[Scalar]) -> Vector:
    """s a for a number s and a 3-tuple a."""
    return (s * a[0], s * a[1], s * a[2])
