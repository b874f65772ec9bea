"""A loss of lift from one sample to the next: the shape of the step of `lift_drift`."""

import pytest
from kites import DEVELOPMENT, at_point

from awescli.physics.kite import Kite

HEIGHTS = (10.0, 100.0, 200.0)


def share(time: float, within: float) -> float:
    """Lift with a loss of 5 % at 60 s over lift without."""
    plain, kite = Kite(DEVELOPMENT, HEIGHTS), Kite(DEVELOPMENT, HEIGHTS, ("lift_drift",))
    kite = kite.with_values({"lift_drift.step": -0.05, "lift_drift.at": 60.0, "lift_drift.within": within})
    lost, whole = (k.instant(*at_point(k, time=time)).coefficients.CL for k in (kite, plain))
    return lost / whole


@pytest.mark.parametrize("within, reached", [(1.0, 0.7311), (0.1, 1.0), (0.0, 1.0)])
def test_damage_is_faster_than_rain(within, reached):
    """Guards a sudden loss against a step that always took a second: half of it at its time, and half a second later what tanh says
    ((1 + tanh 0.5) / 2 = 0.731 of it within 1 s, all of it within 0.1 s)."""
    after = 1 - 0.05 * reached
    assert share(60.0, within) == pytest.approx(0.975, abs=1e-12)
    assert share(60.5, within) == pytest.approx(after, abs=1e-5)
    assert share(59.5, within) == pytest.approx(2 * 0.975 - after, abs=1e-5)
