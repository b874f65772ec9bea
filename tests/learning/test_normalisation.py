"""Which inputs a network may not have, however loops are dealt to the parts."""

import numpy as np
import pytest
from kites import flight

from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import ORDERS, split
from awescli.learning.network_inputs import DEFAULT_INPUTS
from awescli.learning.normalisation import _order_in_time, drifting
from awescli.physics.kite import Kite


@pytest.mark.parametrize("order", ORDERS)
def test_a_line_that_only_gets_longer_is_no_input(order):
    """Guards against a network that learns the wind of the day from the tether length: it tells the time also where validation lies
    between training loops, and no range is left; nothing else of this flight does."""
    campaign = flight(duration=60.0)
    loops, kite = find_loops(campaign.log), Kite(campaign.flown, campaign.log.wind.height)
    parts = split(loops, order=order, log=campaign.log)
    assert drifting(campaign.log, kite, DEFAULT_INPUTS, parts.train, parts.validation) == ("tether_length",)


def test_the_order_in_time_is_spearmans():
    """Guards the rank correlation: 1 for what only grows, whatever its shape, -1 for what only falls, near 0 for a swing, 0 for nothing."""
    t = np.linspace(0, 1, 2000)
    found = _order_in_time(np.stack([np.exp(5 * t), -t, np.sin(60 * t), 0 * t], axis=1))
    assert found == pytest.approx([1.0, -1.0, 0.0, 0.0], abs=0.05)
