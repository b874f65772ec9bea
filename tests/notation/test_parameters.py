"""The table of parameters: order, bounds, names."""

import numpy as np
import pytest

from awescli.notation.errors import BadInput
from awescli.notation.parameters import Parameter, ParameterTable

TABLE = ParameterTable(
    [Parameter("a", 1.0, lower=0.0, upper=2.0, free=True), Parameter("b", -2.0), Parameter("c", 0.0, free=True, std=0.3)]
)


def test_a_table_keeps_its_order():
    """Guards the link between a vector and its names, on which every estimator relies."""
    assert list(TABLE) == ["a", "b", "c"] and TABLE.free == ("a", "c")
    assert TABLE.vector().tolist() == [1.0, -2.0, 0.0] and TABLE.vector(("c", "a")).tolist() == [0.0, 1.0]


def test_new_values_leave_everything_else():
    """Guards against a table that loses bounds, or changes in place, when values are set."""
    other = TABLE.with_values({"a": 0.5})
    assert other["a"].value == 0.5 and (other["a"].lower, other["a"].upper, other["a"].free) == (0.0, 2.0, True)
    assert TABLE["a"].value == 1.0 and other["b"] == TABLE["b"]


def test_rows_are_replaced_where_they_are_and_appended_where_they_are_not():
    """Guards the order after an effect has added its parameters."""
    other = TABLE.with_rows([Parameter("d", 4.0), Parameter("b", 5.0)])
    assert list(other) == ["a", "b", "c", "d"] and other["b"].value == 5.0


def test_wrong_values_and_names_are_refused():
    """Guards the messages: value outside its bounds, a name twice, an unknown name with the nearest known one."""
    with pytest.raises(BadInput, match="outside its bounds"):
        Parameter("a", 3.0, lower=0.0, upper=2.0)
    with pytest.raises(BadInput, match="outside its bounds"):
        Parameter("a", float("nan"), lower=0.0, upper=2.0)
    with pytest.raises(BadInput, match="twice"):
        ParameterTable([Parameter("a", 1.0), Parameter("a", 2.0)])
    with pytest.raises(BadInput, match="unknown parameter 'aa'"):
        TABLE["aa"]
    with pytest.raises(BadInput, match="outside its bounds"):
        TABLE.with_values({"a": 9.0})
    with pytest.raises(BadInput):
        TABLE.with_values({"z": 9.0})


def test_the_prior_is_stated_or_a_quarter_of_the_range_or_a_share_of_the_value():
    """Guards the order of the three sources of a prior standard deviation."""
    assert TABLE["c"].prior_std == 0.3 and TABLE["a"].prior_std == 0.5
    assert TABLE["b"].prior_std == pytest.approx(0.6) and Parameter("z", 0.0).prior_std == 1.0
    assert np.isfinite(Parameter("h", 2.0, lower=0.0).prior_std)


def test_deviations_are_of_amounts_or_of_shares():
    """Guards the prior: a relative guess is as far from twice as from half itself, with the sign of the difference, an absolute one as far
    to either side; near the guess both are the same; slopes are those of central differences."""
    table = ParameterTable([
        Parameter("a", 2.0, std=0.5), Parameter("b", 2.0, std=0.5, relative=True), Parameter("c", -3.0, std=0.6, relative=True),
    ])  # fmt: skip
    names = ("a", "b", "c")
    twice, half = (table.deviations(names, table.vector() * s)[0] for s in (2.0, 0.5))
    assert twice[1:] == pytest.approx(-half[1:]) and twice == pytest.approx([4.0, 4 * np.log(2), -5 * np.log(2)])
    assert table.deviations(names, 1.001 * table.vector())[0] == pytest.approx([0.004, 0.004, -0.005], rel=1e-3)
    x, h = np.array([2.7, 1.1, -1.4]), 1e-6
    up, down = (table.deviations(names, x + s * h)[0] for s in (1, -1))
    assert table.deviations(names, x)[1] == pytest.approx((up - down) / (2 * h), rel=1e-8)


def test_guesses_that_share_an_unknown_factor_find_it_in_the_middle():
    """Guards what no flight tells: of twenty guesses, half of them a quarter too high and half as many times too low, the factor that suits
    all best is one; amounts would say one that is too small."""
    guesses = np.where(np.arange(20) % 2, 1.25, 1 / 1.25)
    factors = np.linspace(0.8, 1.2, 401)

    def best(relative: bool) -> float:
        rows = [Parameter(f"p{i}", g, std=0.3 * g, relative=relative) for i, g in enumerate(guesses)]
        names = tuple(p.name for p in rows)
        return factors[np.argmin([(ParameterTable(rows).deviations(names, np.full(20, c))[0] ** 2).sum() for c in factors])]

    assert best(True) == pytest.approx(1.0, abs=1e-3) and best(False) < 0.97
