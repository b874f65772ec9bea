"""A sensor that changes in flight is no drift: "nothing is missing" is not said of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from tracing.traced import short_flight, traced_flight

from awescli.tracing.criteria import CRITERIA


def changing(channel, by):
    """From half of the flight on it reads otherwise."""
    return lambda log, random: {channel: np.where(log.time > log.time[-1] / 2, by(log[channel]), log[channel])}


def wandering(spread, memory):
    """Channels with a drift (Ornstein-Uhlenbeck) of some standard deviation that forgets within `memory` [s]."""

    def drift(log, random):
        kept = np.exp(-log.dt / memory)
        steps = np.sqrt(1 - kept**2) * random.standard_normal((len(spread), len(log)))
        return {n: log[n] + s * lfilter([1.0], [1.0, -kept], own) for (n, s), own in zip(spread.items(), steps, strict=True)}

    return drift


ATTITUDE = dict.fromkeys(("phi", "theta", "psi"), np.deg2rad(0.5))


@pytest.mark.parametrize("steps, change", [
    ("V_a", changing("V_a", lambda V: 0.94 * V)), ("psi", changing("psi", lambda psi: psi + 0.03)),
    ("tension", changing("tension", lambda T: 1.06 * T)),
    ("", wandering({"V_a": 0.5}, 6.0)), ("", wandering(ATTITUDE, 18.0)),
])  # fmt: skip
def test_a_sensor_that_changes_half_way_is_told(steps, change):
    """Guards "nothing is missing" where a pitot reads 6 % low from half of the flight on: its drift grew, and took all of it. A drift that
    wanders is no change of a sensor, however long it lasts."""
    declared, log, parts = short_flight({}, 33, 120.0)
    log = replace(log, measured={**log.measured, **change(log, np.random.default_rng(5))})
    told, finding = traced_flight(declared, log, parts, 5.0)
    found = finding.evidence.drift_steps
    assert found is not None and [n for n, size in found.items() if size > CRITERIA.drift_step] == ([steps] if steps else []), found
    assert told["effects"] == [] and told["verdict"] == ("unexplained" if steps else "none"), told["sentence"]
    assert not steps or f"the drift of {steps} steps" in told["sentence"]
    assert steps or max(found.values()) < 6.0


@pytest.mark.parametrize("channels, change, answer", [
    (("phi",), lambda phi: phi + 0.0873, "attitude_bias"), (("tether_length", "reel_out_speed"), lambda x: 0.97 * x, "winch_length"),
    (("psi",), lambda psi: psi + 0.436, ""),
])  # fmt: skip
def test_a_sensor_that_is_off_all_the_time_is_told(channels, change, answer):
    """Guards "nothing is missing" where a roll angle is 5 deg off, or a drum counts 3 % too little: the drift of an attitude, or of a
    position, had taken all of it. Of a heading that is 25 deg off drift still does, and it is told by how much."""
    declared, log, parts = short_flight({}, 34, 120.0)
    changed = {n: change(log[n]) for n in channels}
    log = replace(
        log, measured={**log.measured, **{n: s for n, s in changed.items() if n in log.measured}},
        inputs={**log.inputs, **{n: s for n, s in changed.items() if n in log.inputs}},
    )  # fmt: skip
    told, finding = traced_flight(declared, log, parts, 5.0)
    assert told["verdict"] != "none"
    if answer:
        assert told["verdict"] == "found" and [e["name"] for e in told["effects"]] == [answer], told["sentence"]
        return
    ((size, words),) = finding.evidence.drift_offsets.values()
    assert told["verdict"] == "unexplained" and words in told["sentence"]
    assert words == f"psi is off by {size:.3g} rad on average" and size == pytest.approx(0.436, rel=0.05)
