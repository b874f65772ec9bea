"""Wind at the kite's height and the air-relative velocity: V_a, alpha, beta."""

from collections.abc import Mapping, Sequence

from awescli.notation.frames import rotate_back
from awescli.notation.scalars import Scalar, atan2, cos, exp, log, maximum, select, sin, sqrt
from awescli.physics.declaration import WindLaw
from awescli.physics.instant import Wind

HEIGHT_FLOOR = 1.0
"""[m] below this the profile laws are held constant: they have no meaning at the ground."""
AIRSPEED_FLOOR = 1.0
"""[m/s] V_a is never taken smaller, so that rates over V_a stay finite in hover."""


def interpolate(x: Scalar, knots: Sequence[float], values: Sequence[Scalar]) -> Scalar:
    """Piecewise linear interpolation, constant outside the knots (floats); written with hinges so that it can be recorded."""
    total = values[0]
    for left, right, y0, y1 in zip(knots, knots[1:], values, values[1:], strict=False):
        inside = maximum(0.0 * x, x - left)
        inside = inside - maximum(0.0 * x, x - right)
        total = total + (y1 - y0) * (inside / (right - left))
    return total


def declared_wind(law: WindLaw, heights: Sequence[float], height: Scalar, inputs: Mapping[str, Scalar]) -> tuple[Scalar, Scalar, Scalar]:
    """The declared wind profile at `height` [m] above the winch -> (speed [m/s], direction it comes from [rad], down [m/s]).

    law: `declaration.WindLaw`; inputs holds wind_speed_i, wind_direction_i, wind_down_i at the record's `heights`.
    table: linear in height between the stations; power: v_r (h/h_r)^a; log: v_r ln(h/z0)/ln(h_r/z0); uniform: as recorded.
    """
    speeds, directions, downs = ([inputs[f"wind_{kind}_{i}"] for i in range(len(heights))] for kind in ("speed", "direction", "down"))
    if law.law == "table":
        speed, direction, down = (interpolate(height, heights, values) for values in (speeds, directions, downs))
        return speed, direction, down
    h = maximum(height, HEIGHT_FLOOR + 0.0 * height)
    factor = 1.0
    if law.law == "power":
        factor = exp(law.exponent * log(h / law.reference_height))
    elif law.law == "log":
        factor = log(h / law.roughness) / log(law.reference_height / law.roughness)
    return speeds[0] * factor, directions[0], downs[0]


def wind_vector(speed: Scalar, direction: Scalar, down: Scalar, density: Scalar) -> Wind:
    """Wind that comes FROM `direction` (clockwise from north) as a velocity in NED."""
    return Wind(-speed * cos(direction), -speed * sin(direction), down, density)


def air_data(R: tuple, v_ned: tuple, wind: Wind) -> tuple[tuple, Scalar, Scalar, Scalar]:
    """v_r = R^T (v_ned - v_wind) [m/s, body], V_a = |v_r|, alpha = atan2(w_r, u_r), beta = asin(v_r / V_a) (Beard & McLain eq. 2.8)."""
    velocity = rotate_back(R, (v_ned[0] - wind.n, v_ned[1] - wind.e, v_ned[2] - wind.d))
    return velocity, *flow_angles(velocity)


def flow_angles(velocity: tuple) -> tuple[Scalar, Scalar, Scalar]:
    """(V_a [m/s], alpha, beta [rad]) of an air-relative velocity in body axes."""
    u_r, v_r, w_r = velocity
    square = u_r * u_r + v_r * v_r + w_r * w_r
    V_a = sqrt(select(square - AIRSPEED_FLOOR**2, square, AIRSPEED_FLOOR**2 + 0.0 * square))
    # asin(v_r/V_a), in the form that keeps its derivative finite when the flow comes from the side
    return V_a, atan2(w_r, u_r), atan2(v_r, sqrt(u_r * u_r + w_r * w_r))
