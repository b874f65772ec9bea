"""What is usual of the drift of sensors, on kites of any size."""

from dataclasses import replace

import pytest
from kites import DEVELOPMENT, flight

from awescli.estimation.processes.drift import CHANNELS, Drift
from awescli.simulation.campaign_flights import similar


@pytest.mark.parametrize("length, by", [(0.25, 1.0), (1.0, 1.0), (4.0, 64 * 50 / 54)])
def test_the_drift_of_a_load_cell_grows_with_what_it_weighs_and_no_other(length, by):
    """Guards a large kite: 50 N are a hundredth of what a kite of 50 kg pulls, and next to nothing of 250 kN. A receiver and an attitude
    are no worse on it."""
    log = flight(duration=12.0).log
    there = {g.name: g for g in Drift.of(similar(DEVELOPMENT, length), log).groups}
    assert set(there) == set(CHANNELS)
    for name, (_, listed, _) in CHANNELS.items():
        grown = by if name == "load drift" else 1.0
        assert there[name].of_level == replace(listed, median=pytest.approx(listed.median * grown))
        assert there[name].level == 0.0


def test_a_channel_that_is_not_logged_has_no_drift():
    log = flight(duration=12.0).log
    silent = replace(log, measured={n: v for n, v in log.measured.items() if n not in ("tension", "V_a")})
    assert {g.name for g in Drift.of(DEVELOPMENT, silent).groups} == set(CHANNELS) - {"load drift", "airspeed drift"}
