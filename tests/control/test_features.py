"""Features against independent geometry in numpy, and the pattern's invariances."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from awescli.control.features import FEATURES, evaluate
from awescli.control.pattern import Pattern
from awescli.notation.errors import BadInput

RANDOM = np.random.default_rng(3)


def states(n=40):
    z = {"p_n": RANDOM.uniform(150, 300, n), "p_e": RANDOM.uniform(-60, 60, n), "p_d": RANDOM.uniform(-250, -100, n)}
    z |= {k: RANDOM.normal(10, 10, n) for k in "uvw"} | {k: RANDOM.uniform(-1, 1, n) for k in ("phi", "theta", "p", "q", "r")}
    return z | {"psi": RANDOM.uniform(-3, 3, n), "tether_length": np.full(n, 300.0), "reel_out_speed": np.ones(n), "wind_direction": 3.0}


PATTERN = Pattern(0.6, 0.1, 50.0, -1.0)


@pytest.mark.parametrize("name", FEATURES)
def test_same_on_floats_and_arrays(name):
    z = states(5)
    array = np.broadcast_to(FEATURES[name].function(z, PATTERN), 5)
    for i in range(5):
        one = {k: float(v[i]) if np.ndim(v) else float(v) for k, v in z.items()}
        assert FEATURES[name].function(one, PATTERN) == pytest.approx(array[i], rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("name", FEATURES)
def test_can_be_recorded(name):
    """The engine's recorded scalars give the same program."""
    record = pytest.importorskip("awescli.engine.record")
    tape = record.Tape()
    keys = list(states(1))
    z = dict(zip(keys, tape.inputs("x", len(keys)), strict=True))
    assert isinstance(FEATURES[name].function(z, PATTERN), record.Scalar)


def test_course_and_radius_error_against_vector_geometry():
    z = states()
    P = np.stack([z["p_n"], z["p_e"], z["p_d"]], 1)
    V = np.stack(evaluate(("v_n", "v_e", "v_d"), z, None), 1)
    hat = P / np.linalg.norm(P, axis=1)[:, None]
    c = np.array([np.cos(0.6) * np.cos(0.1), np.cos(0.6) * np.sin(0.1), -np.sin(0.6)])
    angle = np.arccos(hat @ c)
    outward = hat * np.cos(angle)[:, None] - c
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    # clockwise seen from the winch: right, with up = -down
    around = np.cross(hat, outward)
    radius, course = evaluate(("radius_error", "course_error"), z, PATTERN)
    np.testing.assert_allclose(radius, np.linalg.norm(P, axis=1) * angle - 50.0, atol=1e-5)
    np.testing.assert_allclose(course, np.arctan2((V * outward).sum(1), -(V * around).sum(1)), atol=1e-6)


def test_pattern_features_do_not_see_where_north_is():
    z = states()
    turn = 0.8
    c, s = np.cos(turn), np.sin(turn)
    turned = z | {"p_n": c * z["p_n"] - s * z["p_e"], "p_e": s * z["p_n"] + c * z["p_e"], "psi": z["psi"] + turn}
    names = ("radius_error", "course_error", "sin_phase", "cos_phase", "speed", "radial_speed", "wing_along_line", "crab_angle")
    for a, b in zip(evaluate(names, z, PATTERN), evaluate(names, turned, Pattern(0.6, 0.1 + turn, 50.0, -1.0)), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-10)


def test_crab_angle_against_vector_geometry():
    """A kite whose nose points along its velocity has none; turned about the line, it has the angle it was turned by, clockwise as the
    winch sees it, whatever the nose does along the line."""
    z = states()
    P, V = np.stack([z["p_n"], z["p_e"], z["p_d"]], 1), np.stack(evaluate(("v_n", "v_e", "v_d"), z, None), 1)
    line = P / np.linalg.norm(P, axis=1)[:, None]
    across = V - (V * line).sum(1)[:, None] * line
    for crab in (0.0, 0.3, -1.2):
        nose = Rotation.from_rotvec(crab * line).apply(across / np.linalg.norm(across, axis=1)[:, None]) + 0.4 * line
        heading = {"psi": np.arctan2(nose[:, 1], nose[:, 0]), "theta": np.arctan2(-nose[:, 2], np.hypot(nose[:, 0], nose[:, 1]))}
        body = Rotation.from_euler("ZYX", np.stack([heading["psi"], heading["theta"], z["phi"]], 1)).inv().apply(V)
        turned = z | heading | dict(zip("uvw", body.T, strict=True))
        np.testing.assert_allclose(evaluate(("crab_angle",), turned, None)[0], crab, atol=1e-9)


def test_errors_say_what_to_do():
    with pytest.raises(BadInput, match="needs a pattern"):
        evaluate(("course_error",), states(2), None)
    with pytest.raises(BadInput, match="wind_direction"):
        evaluate(("downwind_azimuth",), {k: v for k, v in states(2).items() if k != "wind_direction"}, None)
