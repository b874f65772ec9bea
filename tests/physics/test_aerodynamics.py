"""The table of aerodynamic terms, its units, and wind against body axes."""

import numpy as np
import pytest
from kites import DEVELOPMENT, at_point, declared

from awescli.notation.errors import BadInput
from awescli.physics.effects.aerodynamics import body_axes, parse_monomial, wind_axes
from awescli.physics.kite import Kite


def coefficients(declaration, **state):
    kite = Kite(declaration)
    return kite.instant(*at_point(kite, **state))


def test_monomials_are_read():
    """Guards the little language of kite files."""
    assert parse_monomial("1") == []
    assert parse_monomial("alpha") == [("alpha", False, 1)]
    assert parse_monomial("alpha^2*abs(beta)*flaps") == [("alpha", False, 2), ("beta", True, 1), ("flaps", False, 1)]
    assert parse_monomial(" p_hat * abs(beta)^3 ") == [("p_hat", False, 1), ("beta", True, 3)]


@pytest.mark.parametrize("text", ["alfa", "alpha**2", "abs(alpha", "alpha)", "alpha^x", "alpha+beta", "", "2*alpha", "abs(alpha^2)"])
def test_what_is_no_monomial_is_refused(text):
    """Guards against a term that is silently read as another one."""
    with pytest.raises(BadInput, match="cannot read"):
        parse_monomial(text)


def test_every_term_of_the_table_counts_once():
    """Guards the sum: each coefficient equals its terms, written out by hand."""
    at = coefficients(DEVELOPMENT)
    v, z, d = at.values, at.z, at.deflections
    p, q, r = z.p * v["b"] / (2 * at.V_a), z.q * v["c"] / (2 * at.V_a), z.r * v["b"] / (2 * at.V_a)
    a, b = at.alpha, at.beta
    assert at.coefficients.CL == pytest.approx(v["CL0"] + v["CLa"] * a + v["CLq"] * q + v["CLde"] * d["elevator"] + v["CLdf"] * d["flaps"])
    assert at.coefficients.CD == pytest.approx(v["CD0"] + v["CDa"] * a + v["CDa2"] * a * a + v["CDdf"] * d["flaps"])
    assert at.coefficients.CY == pytest.approx(v["CYb"] * b + v["CYp"] * p + v["CYr"] * r + v["CYdr"] * d["rudder"])
    assert at.coefficients.Cl == pytest.approx(
        v["Clb"] * b + v["Clp"] * p + v["Clr"] * r + v["Clda"] * d["aileron"] + v["Cldr"] * d["rudder"]
    )
    assert at.coefficients.Cm == pytest.approx(v["Cm0"] + v["Cma"] * a + v["Cmq"] * q + v["Cmde"] * d["elevator"] + v["Cmdf"] * d["flaps"])
    assert at.coefficients.Cn == pytest.approx(
        v["Cnb"] * b + v["Cnp"] * p + v["Cnr"] * r + v["Cnda"] * d["aileron"] + v["Cndr"] * d["rudder"]
    )
    assert at.coefficients.CL_alpha_part == pytest.approx(v["CLa"] * a)


def test_degrees_are_radians_with_other_numbers():
    """Guards units of the monomials: a table in degrees whose slopes are pi/180 of the radian ones is the same kite. Rates have no unit."""
    terms = DEVELOPMENT.aerodynamics.terms
    factor = {}
    for coefficient in terms.values():
        for monomial, name in coefficient.items():
            power = sum(n for variable, _, n in parse_monomial(monomial) if not variable.endswith("_hat"))
            factor[name] = DEVELOPMENT.parameters[name].value * (np.pi / 180) ** power
    in_degrees = declared(aerodynamics={"angles": "deg", "terms": terms}, **factor)
    for found, expected in zip(coefficients(in_degrees).coefficients, coefficients(DEVELOPMENT).coefficients, strict=True):
        assert found == pytest.approx(expected, rel=1e-13)


def test_a_surface_with_the_other_sign():
    """Guards the one place where the log's sign of a surface becomes the table's."""
    surfaces = {n: s.model_dump() | ({"sign": -1} if n == "rudder" else {}) for n, s in DEVELOPMENT.surfaces.items()}
    flipped = DEVELOPMENT.__class__.model_validate(DEVELOPMENT.model_dump() | {"surfaces": surfaces})
    assert coefficients(flipped, rudder=-0.12).coefficients == coefficients(DEVELOPMENT, rudder=0.12).coefficients
    assert coefficients(flipped).coefficients.Cn != coefficients(DEVELOPMENT).coefficients.Cn


def test_wind_axes_and_body_axes_there_and_back():
    """Guards the inverse of the matrix of f_a, which body-axes tables (AP2) need."""
    random = np.random.default_rng(0)
    for _ in range(20):
        C, alpha, beta = random.standard_normal(3), random.uniform(-1, 1), random.uniform(-1, 1)
        assert wind_axes(*body_axes(*C, alpha, beta), alpha, beta) == pytest.approx(C, abs=1e-14)
        # drag opposes the flow, lift is normal to it
        flow = np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
        assert np.dot(body_axes(1.0, 0.0, 0.0, alpha, beta), flow) == pytest.approx(-1.0)
        assert np.dot(body_axes(0.0, 0.0, 1.0, alpha, beta), flow) == pytest.approx(0.0, abs=1e-15)
    assert body_axes(0.0, 0.0, 1.0, 0.0, 0.0) == pytest.approx((0, 0, -1))  # lift points up, body z down


def test_a_table_in_body_axes_gives_the_same_force():
    """Guards frame: body: constant C_X, C_Y, C_Z come out as the force they are."""
    rows = {
        **{n: r.model_dump() for n, r in DEVELOPMENT.parameters.items()},
        "CX0": {"value": -0.1},
        "CY0": {"value": 0.02},
        "CZ0": {"value": -0.9},
    }
    document = DEVELOPMENT.model_dump() | {
        "parameters": rows, "aerodynamics": {"frame": "body", "terms": {"CX": {"1": "CX0"}, "CY": {"1": "CY0"}, "CZ": {"1": "CZ0"}}},
        "effects": ("aerodynamics",),
    }  # fmt: skip
    kite = Kite(DEVELOPMENT.__class__.model_validate(document))
    at = kite.instant(*at_point(kite))
    assert at.applied.force == pytest.approx(np.array([-0.1, 0.02, -0.9]) * at.dynamic_pressure * 3.0)
    assert at.applied.moment == (0, 0, 0)


def test_moments_take_span_and_chord():
    """Guards m_a = qbar S (b Cl, c Cm, b Cn)."""
    kite = Kite(DEVELOPMENT.model_copy(update={"effects": ("aerodynamics",)}))
    at = kite.instant(*at_point(kite))
    C, v, qS = at.coefficients, at.values, at.dynamic_pressure * at.values["S"]
    assert at.applied.moment == pytest.approx((qS * v["b"] * C.Cl, qS * v["c"] * C.Cm, qS * v["b"] * C.Cn))
    assert at.dynamic_pressure == pytest.approx(0.5 * 1.22 * at.V_a**2)
