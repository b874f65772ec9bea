"""What all models of a trace share."""

import pytest
from tracing.traced import short_flight

from awescli.notation.parameters import Parameter
from awescli.tracing.frame import BEYOND, Frame, TracedFlight


@pytest.mark.parametrize(
    "lower, upper, kept",
    [(0.0, 0.12, "lower"), (0.05, 0.12, "lower"), (-0.12, 0.0, "upper"), (-0.12, 0.2, None)],
)
def test_parameters_leave_their_bounds_but_not_the_sign_that_these_say(lower, upper, kept):
    """Guards a drag at zero lift that was free to be negative: a bound of zero says a sign. What a parameter is drawn to stays."""
    declared, log, parts = short_flight({}, 61, 30.0, ())
    value = (lower + upper) / 2
    row = Parameter("CD0", value, "-", lower, upper, free=True)
    frame = Frame((TracedFlight(log, parts, declared.with_parameters(declared.table().with_rows([row]))),), 2.0, tuple(log.measured))
    wider = frame.beyond(["CD0"]).declared.table()
    before, after = frame.declared.table()["CD0"], wider["CD0"]
    far = BEYOND * before.prior_std
    assert after.lower == (0.0 if kept == "lower" else value - far) and after.upper == (0.0 if kept == "upper" else value + far)
    assert (after.value, after.prior_std) == (value, before.prior_std) and wider["CLa"] == declared.table()["CLa"]
