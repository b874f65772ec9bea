"""What an effect must lead another one by."""

import pytest

from awescli.tracing.criteria import CRITERIA, Criteria


def test_what_explains_much_must_lead_by_a_share_of_it():
    """Guards a wrong name on a world that is not ours: a constant wind led the power law that had blown by 42 in deviance, and both gained
    2500: that is within what approximate models are worth."""
    assert CRITERIA.lead(2518.0) > 42.3
    assert CRITERIA.lead(100.0) == CRITERIA.decisive == CRITERIA.lead(0.0)
    assert Criteria(approximate=0.1).lead(1000.0) == pytest.approx(100.0)


def test_what_may_win_is_fitted_to_the_end():
    """Guards a race that ends before its leaders do: whoever is within twice the lead that is asked runs on."""
    assert CRITERIA.in_reach(CRITERIA.finalists, 100.0) == CRITERIA.finalists
    assert CRITERIA.in_reach(CRITERIA.finalists, 2423.0) > 2423.0 - 2378.0
