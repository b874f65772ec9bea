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
