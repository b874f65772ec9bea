"""Linear constraints as a kite file writes them."""

import pytest

from awescli.notation.constraints import parse_constraint
from awescli.notation.errors import BadInput

INF = float("inf")


@pytest.mark.parametrize(
    ("text", "factors", "lower", "upper"),
    [
        ("Jx + Jz >= Jy", {"Jx": 1, "Jz": 1, "Jy": -1}, 0, INF),
        ("Jx+Jz>=Jy", {"Jx": 1, "Jz": 1, "Jy": -1}, 0, INF),
        ("-2*CYb + 0.1 <= 1.5e-1*CYp - 3", {"CYb": -2, "CYp": -0.15}, -INF, -3.1),
        ("actuator_lag:rudder.tau = 0.5*Cl.1", {"actuator_lag:rudder.tau": 1, "Cl.1": -0.5}, 0, 0),
        ("a - a + 2*b == 4", {"b": 2}, 4, 4),
        ("custom_term:m_y*alpha.k <= 1", {"custom_term:m_y*alpha.k": 1}, -INF, 1),
    ],
)
def test_what_is_written_is_what_is_meant(text, factors, lower, upper):
    """Guards signs, factors and constants on both sides of the relation."""
    found = parse_constraint(text)
    assert found.factors == pytest.approx(factors) and (found.lower, found.upper) == pytest.approx((lower, upper))
    assert found.value(dict.fromkeys(factors, 2.0)) == pytest.approx(2 * sum(factors.values()))


@pytest.mark.parametrize(
    "text", ["", "Jx", "Jx <= Jy <= Jz", "Jx Jy <= 1", "Jx <=", "3 >= 2", "a - a <= 1", "Jx < 3", "2 ** a <= 1", "a/b <= 1"]
)
def test_what_is_not_linear_is_refused_with_the_way_to_write_it(text):
    """Guards the message: the text, and how a constraint is written."""
    with pytest.raises(BadInput) as caught:
        parse_constraint(text)
    assert f"'{text}'" in caught.value.what and "NUMBER*PARAMETER" in caught.value.do
