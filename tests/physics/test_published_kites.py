"""Kite files against the published numbers, term by term, at points worked out here with the numbers as they were published."""

import math
from pathlib import Path

import pytest

from awescli.notation.quantities import SURFACES
from awescli.physics.declaration import read_kite
from awescli.physics.effects.aerodynamics import body_axes
from awescli.physics.kite import Kite

ROOT = Path(__file__).parents[2]
KITES = ROOT / "data" / "kites"
DEG = math.pi / 180


def at_point(file, alpha=0.0, beta=0.0, V=40.0, p=0.0, q=0.0, r=0.0, **setpoints):
    """Instant of a kite in still air at alpha, beta [rad], airspeed V [m/s], rates [rad/s], set-points [rad, the log's signs]."""
    kite = Kite(read_kite(KITES / file))
    velocity = (V * math.cos(beta) * math.cos(alpha), V * math.sin(beta), V * math.cos(beta) * math.sin(alpha))
    x = [300.0, 0.0, -200.0, *velocity, 0.0, 0.0, 0.0, p, q, r, *(setpoints.get(s, 0.0) for s in SURFACES)]
    inputs = {"tether_length": 360.0, "density": 1.225}
    u = [inputs.get(name, 0.0) for name in kite.input_names]
    return kite.instant(x, u, [float(v) for v in kite.parameters.vector()])


def test_every_kite_file_reads():
    files = sorted(KITES.glob("*.yaml"))
    assert {f.stem for f in files} >= {"km1_initial", "km1_identified", "ap2", "development"}
    for file in files:
        declaration = read_kite(file)
        for name in declaration.table().free:
            row = declaration.parameters[name]
            assert row.lower < row.value < row.upper, (file.name, name)


def test_km1_frees_the_25_published_parameters_and_the_drum_zero():
    initial, identified = (read_kite(KITES / f"km1_{which}.yaml") for which in ("initial", "identified"))
    assert len(initial.table().free) == 26 and "dl" in initial.table().free
    for name in initial.table().free:
        row = initial.parameters[name]
        assert row.lower <= identified.parameters[name].value <= row.upper, name
    assert initial.effects == identified.effects == ("gravity", "aerodynamics", "tether")


def test_km1_at_zero_angles():
    C = at_point("km1_identified.yaml").coefficients
    assert C.CD == pytest.approx(0.173379566122) and C.CL == pytest.approx(0.338853169267)
    assert C.Cl == pytest.approx(5.64472365244e-4) and C.Cm == pytest.approx(0.0519371456455)
    assert C.CY == C.Cn == 0


def test_km1_polynomial_is_in_degrees_and_turns_rudder_and_elevator():
    # alpha 10 deg, beta 4 deg, flaps 15, aileron -2, elevator_sp 7.5 (model: -7.5), rudder_sp 5 (model: -5)
    C = at_point("km1_initial.yaml", 10 * DEG, 4 * DEG, flaps=15 * DEG, aileron=-2 * DEG, elevator=7.5 * DEG, rudder=5 * DEG).coefficients
    a, b, f, ail, e, rud = 10.0, 4.0, 15.0, -2.0, -7.5, -5.0
    CD = (
        0.0601407231145 + 0.0025223630255 * a + 6.33096909836e-4 * a**2 - 2.24091824682e-4 * b + 6.1819395501e-5 * b**2
        + 0.0023266160334 * f + 7.6542367624e-5 * f**2 + 1.545451775e-6 * e + 1.7189016131e-5 * e**2
    )  # fmt: skip
    CY = -1.14407083448e-4 * a - 4.097380801405e-3 * b - 3.199214929e-6 * b**2 + 1.18247415372e-4 * a * b + 3.225382114448e-3 * rud
    CL = (
        0.731242284649 + 0.0982453530544 * a - 1.172087843517e-3 * a**2 - 1.55525989384e-4 * a**3 + 3.673362687e-6 * a**4
        - 6.14550894367e-4 * b - 2.37847677679e-4 * b**2 + 0.0410848156188 * f - 1.17456086622e-4 * a * f
        - 1.29584415794e-4 * a**2 * f + 2.602117206e-6 * a**3 * f - 6.981445469420e-3 * abs(ail) + 4.563921758182e-3 * e
    )  # fmt: skip
    Cl = (
        5.64472365244e-4 - 1.12565466713e-4 * a - 8.559892380e-6 * a**2 + 1.334492880e-6 * a**3 - 3.0912852e-8 * a**4
        - 7.88952517328e-4 * b + 4.680727100e-6 * b**2 + 3.16778457e-7 * b**3 + 5.541490333061e-3 * ail
        - 1.5135734314e-5 * ail * a - 1.9063405150e-5 * ail * a**2 + 4.39095862e-7 * ail * a**3
        + 1.62800776073e-4 * rud - 8.413169249e-6 * rud * b - 8.83141625e-7 * rud * b**2
    )  # fmt: skip
    Cm = (
        0.0119620945875 - 0.0102597236148 * a - 2.15542230679e-4 * a**2 + 1.205810996722e-3 * f + 3.2572976850e-5 * f**2
        + 2.8884716251e-5 * ail**2 - 1.3246875501e-5 * abs(ail) - 0.0189737551532 * e + 1.0527743305e-5 * e * a
    )  # fmt: skip
    Cn = 1.303408142587e-3 * b - 3.18079447660e-4 * ail - 0.00113701869617 * rud
    assert [C.CD, C.CY, C.CL, C.Cl, C.Cm, C.Cn] == pytest.approx([CD, CY, CL, Cl, Cm, Cn], rel=1e-9)


def test_km1_rate_derivatives():
    still, turning = (at_point("km1_identified.yaml", V=40.0, **rates).coefficients for rates in ({}, {"p": 0.3, "q": 0.2, "r": -0.5}))
    p_hat, q_hat, r_hat = 0.3 * 7.4 / 80, 0.2 * 0.431 / 80, -0.5 * 7.4 / 80
    assert turning.CY - still.CY == pytest.approx(-0.00244477743146 * p_hat + 0.00255169828626 * r_hat)
    assert turning.CL - still.CL == pytest.approx(0.0292061179047 * q_hat)
    assert turning.Cl - still.Cl == pytest.approx(-0.525463901819 * p_hat + 0.349844085882 * r_hat)
    assert turning.Cm - still.Cm == pytest.approx(-38.4601150413 * q_hat)
    assert turning.Cn - still.Cn == pytest.approx(-0.465573534976 * p_hat - 0.0436024412161 * r_hat)


@pytest.mark.parametrize("file", ["km1_initial.yaml", "km1_identified.yaml", "development.yaml"])
def test_positive_logged_rudder_turns_positive_about_z(file):
    assert at_point(file, rudder=0.1).coefficients.Cn > at_point(file).coefficients.Cn


def test_ap2_table():
    # alpha 0.1, beta -0.05 rad, p 0.3, q 0.2, r -0.4 rad/s, aileron 0.1, elevator -0.05, rudder 0.08, V 25 m/s
    at = at_point("ap2.yaml", 0.1, -0.05, 25.0, 0.3, 0.2, -0.4, aileron=0.1, elevator=-0.05, rudder=0.08)
    a, b, da, de, dr = 0.1, -0.05, 0.1, -0.05, 0.08
    ph, qh, rh = 0.3 * 5.5 / 50, 0.2 * 0.55 / 50, -0.4 * 5.5 / 50
    CX = -0.0293 + (0.4784 + 2.5549 * a) * a + (-0.6029 + 4.4124 * a) * qh + (-0.0106 + 0.1115 * a) * de
    CY = (
        (-0.1855 - 0.0299 * a + 0.0936 * a**2) * b + (-0.1022 - 0.014 * a + 0.0496 * a**2) * ph + (0.1694 + 0.1368 * a) * rh
        + (-0.0514 - 0.0024 * a + 0.0579 * a**2) * da + (0.10325 + 0.0268 * a - 0.1036 * a**2) * dr
    )  # fmt: skip
    CZ = -0.5526 + (-5.0676 + 5.7736 * a) * a + (-7.556 + 0.1251 * a + 6.1486 * a**2) * qh + (-0.315 - 0.0013 * a + 0.2923 * a**2) * de
    Cl = (
        (-0.063 - 0.0003 * a + 0.0312 * a**2) * b + (-0.5632 - 0.0247 * a + 0.2813 * a**2) * ph + (0.1811 + 0.6448 * a) * rh
        + (-0.2489 - 0.0087 * a + 0.2383 * a**2) * da + (0.00436 - 0.0013 * a) * dr
    )  # fmt: skip
    Cm = -0.0307 - 0.6027 * a + (-11.3022 - 0.0026 * a + 5.2885 * a**2) * qh + (-1.0427 - 0.0061 * a + 0.9974 * a**2) * de
    Cn = (
        (0.0577 - 0.0849 * a) * b + (-0.0565 - 0.9137 * a) * ph + (-0.0553 + 0.029 * a + 0.0257 * a**2) * rh
        + (0.01903 - 0.1147 * a) * da + (-0.0404 - 0.0117 * a + 0.04089 * a**2) * dr
    )  # fmt: skip
    C = at.coefficients
    forces = body_axes(C.CD, C.CY, C.CL, at.alpha, at.beta)
    assert [*forces, C.Cl, C.Cm, C.Cn] == pytest.approx([CX, CY, CZ, Cl, Cm, Cn], rel=1e-9)


def test_the_ap2_example_flies_the_published_kite():
    assert (ROOT / "examples" / "ampyx_ap2" / "kite.yaml").read_bytes() == (KITES / "ap2.yaml").read_bytes()
