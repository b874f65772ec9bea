"""What all models of a trace share."""

from types import SimpleNamespace

import numpy as np
import pytest
from tracing.traced import short_flight

from awescli.notation.parameters import Parameter
from awescli.tracing.frame import BEYOND, ONSETS, Frame, TracedFlight


@pytest.mark.parametrize(
    "lower, upper, kept",
    [(0.0, 0.12, "lower"), (0.05, 0.12, "lower"), (-0.12, 0.0, "upper"), (-0.12, 0.2, None)],
)
def test_parameters_leave_their_bounds_but_not_the_sign_that_these_say(lower, upper, kept):
    """Guards a drag at zero lift that was free to be negative: a bound of zero says a sign; and a moment of inertia that was free to be
    zero, which ended a trace with an error. What a parameter is drawn to stays."""
    declared, log, parts = short_flight({}, 61, 30.0, ())
    value = (lower + upper) / 2
    row = Parameter("CD0", value, "-", lower, upper, free=True)
    frame = Frame((TracedFlight(log, parts, declared.with_parameters(declared.table().with_rows([row]))),), 2.0, tuple(log.measured))
    wider = frame.beyond(["CD0"]).declared.table()
    before, after = frame.declared.table()["CD0"], wider["CD0"]
    far = BEYOND * before.prior_std
    assert after.lower == (0.01 * lower if kept == "lower" else value - far)
    assert after.upper == (0.01 * upper if kept == "upper" else value + far)
    assert (after.value, after.prior_std) == (value, before.prior_std) and wider["CLa"] == declared.table()["CLa"]


def test_where_something_may_begin():
    """Spread over all loops that are looked at, closer between two moments, and once in the middle of what is not: of a loss of lift in
    unseen loops no moment beside them is near. What lies at the end of a fitted stretch is not told by it."""
    log = SimpleNamespace(time=np.arange(5000) * 0.02)
    parts = SimpleNamespace(train=((0, 500), (2500, 3000)), validation=((3000, 3500),))
    frame = Frame((SimpleNamespace(log=log, split=parts),), 5.0, ())
    every, closer = frame.onsets(), frame.onsets((50.0, 56.0))
    assert every == sorted(every) and len(every) == ONSETS + 1 and every[ONSETS // 3] == pytest.approx(29.99)
    assert all(t < 10 or t == every[ONSETS // 3] or 50 < t < 70 for t in every) and max(np.diff(every[5:])) < 3.0
    assert len(closer) == ONSETS and all(50 < t < 56 for t in closer)
    assert [frame.fits(t) for t in (5.0, 9.5, 30.0, 52.0, 59.5, 65.0)] == [True, False, False, True, False, False]
