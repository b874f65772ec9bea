"""Pattern: the circle in the sky that a flight follows, and the kite's place relative to it, written in scalars.

The circle's centre is a direction seen from the winch; its radius is metric, measured along the sphere around the winch
(a kite that reels out keeps its turning radius in metres, not in degrees).
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

from awescli.notation.frames import Vector, rotate, rotation_body_to_ned
from awescli.notation.scalars import Scalar, atan2, cos, sin, sqrt


@dataclass(frozen=True)
class Pattern:
    """elevation, azimuth: direction of the centre seen from the winch [rad], azimuth from north over east;
    radius: along the sphere [m]; turn: +1 where the phase grows (clockwise seen from the winch looking out), -1 otherwise.
    """

    elevation: float
    azimuth: float
    radius: float
    turn: float = 1.0

    def to_dict(self) -> dict:
        return asdict(self)


def position(z: Mapping[str, Scalar]) -> Vector:
    """p NED [m], 3-tuple."""
    return (z["p_n"], z["p_e"], z["p_d"])


def velocity_ned(z: Mapping[str, Scalar]) -> Vector:
    """v_ned = R (u, v, w) [m/s], docs/equations.md (1)."""
    return rotate(rotation_body_to_ned(z["phi"], z["theta"], z["psi"]), (z["u"], z["v"], z["w"]))


def distance(z: Mapping[str, Scalar]) -> Scalar:
    """|p| [m]."""
    n, e, d = position(z)
    return sqrt(n * n + e * e + d * d)


def in_pattern_axes(a: Vector, pattern: Pattern) -> Vector:
    """A NED 3-tuple in the pattern's axes: outward along the centre direction, right of it (horizontal), up (across)."""
    s_e, c_e, s_a, c_a = sin(pattern.elevation), cos(pattern.elevation), sin(pattern.azimuth), cos(pattern.azimuth)
    horizontal = a[0] * c_a + a[1] * s_a
    return (c_e * horizontal - s_e * a[2], a[1] * c_a - a[0] * s_a, -(s_e * horizontal) - c_e * a[2])


def place(z: Mapping[str, Scalar], pattern: Pattern) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """(along, right, up, across): the kite in the pattern's axes [m] and its distance from the centre axis [m]."""
    along, right, up = in_pattern_axes(position(z), pattern)
    # 1 mm^2 keeps the root differentiable at the centre, where the phase has no meaning anyway
    return along, right, up, sqrt(right * right + up * up + 1e-6)


def tangent_velocity(z: Mapping[str, Scalar], pattern: Pattern) -> tuple[Scalar, Scalar]:
    """(outward, around): velocity in the tangent plane of the sphere, away from the centre and in the sense of `turn` [m/s]."""
    along, right, up, across = place(z, pattern)
    v_along, v_right, v_up = in_pattern_axes(velocity_ned(z), pattern)
    v_across = (v_right * right + v_up * up) / across
    outward = (along * v_across - across * v_along) / distance(z)
    # phase = atan2(right, up): its rate times the distance from the axis
    around = (v_right * up - v_up * right) / across
    return outward, pattern.turn * around


def arc(z: Mapping[str, Scalar], pattern: Pattern) -> Scalar:
    """Distance of the kite from the centre along the sphere [m]."""
    along, _, _, across = place(z, pattern)
    return distance(z) * atan2(across, along)
