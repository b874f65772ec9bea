"""Since when and in which flights an effect acts."""

from dataclasses import replace

import numpy as np
import pytest
from tracing.traced import short_flight, traced_flight

from awescli.tracing.frame import TracedFlight
from awescli.tracing.when import onset


def test_an_onset_is_where_gains_begin():
    """Guards the onset: segments before it lose by the effect, those after it gain; an effect that was always there, weak
    as it may be, has none."""
    random = np.random.default_rng(0)
    late = np.concatenate([-np.abs(random.normal(8, 3, 9)), np.abs(random.normal(30, 10, 14))])
    assert onset(late) == 9
    assert onset(np.abs(random.normal(30, 10, 20))) == 0 and onset(np.array([])) == 0
    assert sum(onset(random.normal(2, 4, 25)) > 0 for _ in range(500)) < 10


@pytest.mark.slow
def test_a_rudder_that_grows_slow_in_flight_is_dated():
    """Guards `since_s`: set-points that are logged 0.2 s before they act from the middle of a flight on (an effect put into the record) are
    dated, and not named: what came nearest acts in half of the flight only."""
    declared, log, parts = short_flight({}, seed=21, duration=80.0)
    begins, steps = 0.45 * log.time[-1], int(0.2 / log.dt)
    early = np.where(log.time < begins, log["rudder"], np.roll(log["rudder"], -steps))
    candidates = ("actuator_delay:rudder", "sideslip_drag")
    account, finding = traced_flight(declared, replace(log, inputs={**log.inputs, "rudder": early}), parts, 3.0, candidates=candidates,
                                     curriculum=(1.0,))  # fmt: skip
    (flight,) = account["flights"] or [None]
    assert flight is not None, account["verdict"]
    assert flight["effects"] == ["actuator_delay:rudder"] and account["verdict"] == "unexplained"
    assert "What came nearest, actuator_delay:rudder, gains only from" in account["sentence"] and account["effects"] == []
    assert finding.evidence.rivals == {}  # of what is no answer none is asked for
    low, high = flight["since_s"]
    assert low - 3.0 <= begins <= high + 3.0 and high - low < 30.0


def test_what_one_flight_cannot_show_several_can():
    """Guards several flights (`also`): an effect far below what one short flight shows is named from three together, and its size in each
    flight agrees with the truth."""
    size, keys = 0.35, ("sideslip_drag", "airspeed_scale", "tether_attachment", "actuator_lag:rudder")
    flights = [short_flight({"sideslip_drag": {"k": size}}, seed, 40.0, ("CL0", "CD0", "CYb", "Cnb", "dl")) for seed in (51, 52, 53)]
    declared, log, parts = flights[0]
    further = [TracedFlight(log, parts, declared, label=f"flight-{i}") for i, (_, log, parts) in enumerate(flights[1:], 2)]
    how = {"candidates": keys, "curriculum": (1.0,)}
    together, _ = traced_flight(declared, log, parts, 3.0, also=further, **how)
    assert [e["name"] for e in together["effects"]] == ["sideslip_drag"] and together["verdict"] in ("found", "cannot_tell")
    found = together["effects"][0]["parameters"]["k"]
    assert abs(found["value"] - size) < 3 * found["std"]
    each = [f["parameters"]["sideslip_drag.k"] for f in together["flights"]]
    assert len(each) == 3 and all(abs(k["value"] - size) < 3.5 * k["std"] for k in each)
    assert all(k["std"] > found["std"] for k in each)
