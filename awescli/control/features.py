"""FEATURES: what a controller may look at, each a plain function of scalars.

The same source runs on floats, on arrays (N,) and on recorded scalars: only + - * / and `notation.scalars`, no branching on values.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from awescli.control.pattern import Pattern, arc, distance, place, position, tangent_velocity, velocity_ned
from awescli.notation.errors import BadInput, did_you_mean
from awescli.notation.frames import Vector, cross, dot, rotate, rotation_body_to_ned
from awescli.notation.quantities import STATES, UNITS
from awescli.notation.scalars import Scalar, atan2, cos, sin, sqrt


@dataclass(frozen=True)
class Feature:
    """One number a controller looks at.

    function: (z, pattern) -> scalar, z a mapping from STATES (plus `needs`) to scalars in SI, pattern a Pattern or None;
    needs: keys beyond the 12 states; of_pattern: does it need the fitted circle; periodic: an angle that wraps, unfit for regression.
    """

    function: Callable
    unit: str
    doc: str
    needs: tuple[str, ...] = ()
    of_pattern: bool = False
    periodic: bool = False


def _speed(z: Mapping[str, Scalar]) -> Scalar:
    return sqrt(z["u"] * z["u"] + z["v"] * z["v"] + z["w"] * z["w"])


def _horizontal(z: Mapping[str, Scalar]) -> Scalar:
    return sqrt(z["p_n"] * z["p_n"] + z["p_e"] * z["p_e"])


def _course(z: Mapping[str, Scalar]) -> Vector:
    """(right, up, norm): velocity in the tangent plane against the local horizontal and the local meridian [m/s]."""
    (n, e, d), (v_n, v_e, v_d) = position(z), velocity_ned(z)
    h, length = _horizontal(z), distance(z)
    right = (v_e * n - v_n * e) / h
    up = (d * (n * v_n + e * v_e) / h - h * v_d) / length
    return right, up, sqrt(right * right + up * up + 1e-12)


def _line(z: Mapping[str, Scalar], axis: int) -> Scalar:
    """Component of body axis 0, 1, 2 along the line, winch to kite: the attitude against the line, wherever the kite is."""
    R = rotation_body_to_ned(z["phi"], z["theta"], z["psi"])
    return dot(tuple(row[axis] for row in R), position(z)) / distance(z)


def turn_rate(z: Mapping[str, Scalar]) -> Scalar:
    """Rotation of the kite about the line, positive outward [rad/s]: what a rudder makes, wherever the kite is and however it is banked."""
    R = rotation_body_to_ned(z["phi"], z["theta"], z["psi"])
    return dot(rotate(R, (z["p"], z["q"], z["r"])), position(z)) / distance(z)


def _crab(z: Mapping[str, Scalar]) -> Scalar:
    """Crab angle (Beard & McLain, section 2.4) in the tangent plane, (-pi, pi]: from the course to the nose, positive to the right as the
    winch sees it. The wind across and the sideslip in one, without an air data probe."""
    R = rotation_body_to_ned(z["phi"], z["theta"], z["psi"])
    nose, velocity, line = tuple(row[0] for row in R), velocity_ned(z), position(z)
    length = distance(z)
    along = dot(nose, velocity) - dot(nose, line) * dot(velocity, line) / (length * length)
    return atan2(dot(cross(velocity, nose), line) / length, along)


def _downwind(z: Mapping[str, Scalar]) -> Scalar:
    """Azimuth of the kite from the downwind direction, (-pi, pi]; z['wind_direction'] is where the wind comes FROM."""
    s, c = -sin(z["wind_direction"]), -cos(z["wind_direction"])
    return atan2(c * z["p_e"] - s * z["p_n"], c * z["p_n"] + s * z["p_e"])


def _course_error(z: Mapping[str, Scalar], pattern: Pattern) -> Scalar:
    outward, around = tangent_velocity(z, pattern)
    return atan2(outward, around)


def _state(name: str) -> Feature:
    return Feature(lambda z, _: z[name], UNITS[name], f"state {name}", periodic=name in ("phi", "theta", "psi"))


FEATURES: dict[str, Feature] = {
    **{name: _state(name) for name in STATES},
    "sin_phi": Feature(lambda z, _: sin(z["phi"]), "-", "sine of the roll angle"),
    "cos_phi": Feature(lambda z, _: cos(z["phi"]), "-", "cosine of the roll angle"),
    "sin_theta": Feature(lambda z, _: sin(z["theta"]), "-", "sine of the pitch angle"),
    "cos_theta": Feature(lambda z, _: cos(z["theta"]), "-", "cosine of the pitch angle"),
    "sin_psi": Feature(lambda z, _: sin(z["psi"]), "-", "sine of the heading"),
    "cos_psi": Feature(lambda z, _: cos(z["psi"]), "-", "cosine of the heading"),
    "v_n": Feature(lambda z, _: velocity_ned(z)[0], "m/s", "velocity north: cleaner in a log than u, v, w, which carry the Euler noise"),
    "v_e": Feature(lambda z, _: velocity_ned(z)[1], "m/s", "velocity east"),
    "v_d": Feature(lambda z, _: velocity_ned(z)[2], "m/s", "velocity down"),
    "speed": Feature(lambda z, _: _speed(z), "m/s", "ground speed"),
    "inverse_speed": Feature(lambda z, _: 1.0 / _speed(z), "s/m", "1 / ground speed: how a rudder's authority over the path is scheduled"),
    "radial_speed": Feature(lambda z, _: dot(position(z), velocity_ned(z)) / distance(z), "m/s", "speed along the line, outward"),
    "range": Feature(lambda z, _: distance(z), "m", "distance from the winch"),
    "inverse_range": Feature(lambda z, _: 1.0 / distance(z), "1/m", "1 / distance from the winch"),
    "height": Feature(lambda z, _: -z["p_d"], "m", "height above the winch"),
    "elevation": Feature(lambda z, _: atan2(-z["p_d"], _horizontal(z)), "rad", "elevation of the line"),
    "azimuth": Feature(lambda z, _: atan2(z["p_e"], z["p_n"]), "rad", "azimuth of the line from north", periodic=True),
    "downwind_azimuth": Feature(lambda z, _: _downwind(z), "rad", "azimuth of the line from downwind", needs=("wind_direction",)),
    "sin_course": Feature(lambda z, _: _course(z)[0] / _course(z)[2], "-", "sine of the course in the tangent plane, 0 = up"),
    "cos_course": Feature(lambda z, _: _course(z)[1] / _course(z)[2], "-", "cosine of the course in the tangent plane"),
    "crab_angle": Feature(lambda z, _: _crab(z), "rad", "course to nose in the tangent plane: wind across and sideslip"),
    "turn_rate": Feature(lambda z, _: turn_rate(z), "rad/s", "rotation about the line"),
    "curvature": Feature(lambda z, _: turn_rate(z) / _speed(z), "1/m", "rotation about the line per distance flown"),
    "nose_along_line": Feature(lambda z, _: _line(z, 0), "-", "body x along the line"),
    "wing_along_line": Feature(lambda z, _: _line(z, 1), "-", "body y along the line: bank against the line"),
    "belly_along_line": Feature(lambda z, _: _line(z, 2), "-", "body z along the line"),
    "tether_length": Feature(lambda z, _: z["tether_length"], "m", "paid-out line", needs=("tether_length",)),
    "reel_out_speed": Feature(lambda z, _: z["reel_out_speed"], "m/s", "winch speed", needs=("reel_out_speed",)),
    "radius_error": Feature(lambda z, c: arc(z, c) - c.radius, "m", "distance from the circle, outward", of_pattern=True),
    "course_error": Feature(_course_error, "rad", "course against the circle's tangent, outward", of_pattern=True),
    "sin_course_error": Feature(lambda z, c: sin(_course_error(z, c)), "-", "sine of the course error", of_pattern=True),
    "sin_phase": Feature(lambda z, c: place(z, c)[1] / place(z, c)[3], "-", "sine of the phase, 0 = top, right > 0", of_pattern=True),
    "cos_phase": Feature(lambda z, c: place(z, c)[2] / place(z, c)[3], "-", "cosine of the phase on the circle", of_pattern=True),
}  # fmt: skip

FEATURE_SETS: dict[str, tuple[str, ...]] = {
    "state": ("p_n", "p_e", "p_d", "u", "v", "w", "sin_phi", "cos_phi", "sin_theta", "sin_psi", "cos_psi", "p", "q", "r"),
    "state_ned": ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "sin_phi", "cos_phi", "sin_theta", "sin_psi", "cos_psi", "p", "q", "r"),
    "invariant": ("radius_error", "course_error", "sin_phase", "cos_phase", "speed", "radial_speed", "p", "q", "r"),
    "curvature": ("radius_error", "course_error", "sin_phase", "cos_phase", "speed", "radial_speed", "curvature", "p", "q", "r"),
    "heading": ("radius_error", "course_error", "sin_phase", "cos_phase", "speed", "radial_speed", "curvature", "p", "q", "r",
                "crab_angle", "cos_course"),
}  # fmt: skip
"""`state`: the state z, its wrapping angles as sine and cosine (theta stays within +-90 deg: the sine alone tells it);
`state_ned`: the same with the cleaner velocity; `invariant`: the same wherever the circle stands and however far it is;
`curvature`: the same, and how tightly the kite turns; `heading`: the same, where the nose points beside the course and which way gravity
pulls across it. A line that reels out takes the kite beyond the known loops, so what counts is what predicts the loops after them: on
the flights that the method was developed on those two lowered the error there by a tenth."""


def check_features(names: Sequence[str]) -> None:
    """Raise BadInput for the first unknown name."""
    for name in names:
        if name not in FEATURES:
            raise BadInput(f"unknown feature '{name}'", do=did_you_mean(name, FEATURES))


def evaluate(names: Sequence[str], z: Mapping[str, Scalar], pattern: Pattern | None) -> tuple:
    """The features `names` at z: a tuple of scalars (floats, arrays or recorded scalars, as z holds)."""
    for name in names:
        for key in FEATURES[name].needs:
            if key not in z:
                raise BadInput(f"feature '{name}' needs '{key}'", do=f"Provide '{key}' beside the states, or drop the feature.")
        if FEATURES[name].of_pattern and pattern is None:
            raise BadInput(f"feature '{name}' needs a pattern", do="Fit one (fit_pattern), or choose features: state.")
    return tuple(FEATURES[name].function(z, pattern) for name in names)
