"""A sensor that changes in flight is no drift: "nothing is missing" is not said of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from tracing.traced import short_flight, traced_flight

from awescli.tracing.criteria import CRITERIA


def half_way(log, random):
    """From half of the flight on 6 % too little."""
    return np.where(log.time > log.time[-1] / 2, 0.94, 1.0) * log["V_a"]


def wandering(log, random):
    """With a drift of 0.5 m/s that forgets within 6 s (Ornstein-Uhlenbeck)."""
    kept = np.exp(-log.dt / 6.0)
    return log["V_a"] + 0.5 * np.sqrt(1 - kept**2) * lfilter([1.0], [1.0, -kept], random.standard_normal(len(log)))


@pytest.mark.parametrize("change, verdict", [(half_way, "unexplained"), (wandering, "none")])
def test_a_pitot_that_changes_half_way_is_told(change, verdict):
    """Guards against "nothing is missing" where a pitot reads 6 % low from half of the flight on: its drift grew, and took all of it. What
    a drift that forgets within seconds does is no change of a sensor."""
    declared, log, parts = short_flight({}, 33, 120.0)
    log = replace(log, measured={**log.measured, "V_a": change(log, np.random.default_rng(5))})
    told, finding = traced_flight(declared, log, parts, 5.0)
    going_on = finding.evidence.drifts_go_on
    assert going_on is not None and (going_on.share["V_a"] > CRITERIA.drift_goes_on) == (change is half_way) and told["effects"] == []
    assert told["verdict"] == verdict, told["sentence"]
    assert verdict == "none" or "the drift of V_a goes on from loop to loop" in told["sentence"]
