"""Formulas of the foreign kinds: read as arithmetic and nothing else, and the same as numbers and inside JSBSim."""

from xml.etree import ElementTree

import pytest
from foreign_formula import number, xml

from awescli.notation.errors import BadInput

VALUES = {"k": 0.5, "x": -2.0, "tau": 0.15}


@pytest.mark.parametrize(
    "formula, value",
    [
        ("1 + k", 1.5), ("-k * x ** 2", -2.0), ("where(x > 0, 1 - k, 1)", 1.0), ("max(0, x) + abs(x)", 2.0), ("1e-3", 0.001),
        ("2 - 3 - 4", -5.0), ("8 / 4 / 2", 1.0), ("atan2(x, 0) / asin(1)", -1.0), ("sqrt(k * 2) * exp(0) + sin(0) * cos(0)", 1.0),
        ("where(k <= 0.5, min(1, 2), tau)", 1.0),
    ],
)  # fmt: skip
def test_numbers(formula, value):
    assert number(formula, VALUES) == pytest.approx(value, abs=1e-15)


@pytest.mark.parametrize(
    "formula",
    ["open('a')", "__import__('os')", "k.real", "[k]", "k if x else 1", "lambda: 1", "True", "'a'", "k +", "sin(k, foo=1)", "1 < k < 2"],
)
def test_anything_else_is_refused(formula):
    for read in (lambda: number(formula, VALUES), lambda: xml(formula, {}, VALUES)):
        with pytest.raises(BadInput):
            read()


def test_an_unknown_name_is_told_with_the_nearest():
    with pytest.raises(BadInput, match="unknown name 'tua'") as e:
        number("1 / tua", VALUES)
    assert "tau" in e.value.do
    with pytest.raises(BadInput, match="unknown name"):
        xml("alpha", {"beta": "aero/beta-rad"}, {})


def test_elements_hold_properties_and_numbers_to_the_last_bit():
    element = ElementTree.fromstring(xml("k * max(0, alpha - 0.1) ** 2", {"alpha": "aero/alpha-rad"}, {"k": 1 / 3}))
    assert element.tag == "product" and float(element[0].text) == 1 / 3
    assert [e.text for e in element.iter("property")] == ["aero/alpha-rad"] and [e.tag for e in element.iter()][2] == "pow"
