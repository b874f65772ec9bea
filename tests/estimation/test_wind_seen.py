"""The kite as a wind sensor, on flights whose wind is known: a steeper profile than the station's, a station that is wrong, and gusts."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, flight

from awescli.estimation.known import Known
from awescli.estimation.phase_power import flown_ranges
from awescli.estimation.problem import simulator_of
from awescli.estimation.wind_seen import processes_at, wind_profile
from awescli.flightlog.phases import phases
from awescli.flightlog.reconstruction.wind import wind_of_airspeed

CALM = {"wind record": {"level": 0.05, "memory_s": 5.0}}
GUSTY = {"horizontal gusts": {"level": 0.5, "memory_s": 4.0}, "vertical gusts": {"level": 0.3, "memory_s": 1.0}}


def seen(declaration, log, levels=CALM, known=None):
    simulator = simulator_of(declaration, log)
    kite = simulator.kite
    known = known or Known(
        tuple(kite.record), np.eye(len(kite.record)) * 0.05**2, np.ones(len(kite.record), bool), np.zeros(len(kite.record))
    )
    return wind_profile(simulator, log, flown_ranges(phases(log), log.valid), processes_at(declaration, log, levels), known, {})


def test_a_profile_steeper_than_declared_is_told():
    """Guards the traced wind: an exponent of 0.2, traced, where less is declared, is in the kite's profile at every height to 1.5 %
    (entries of the record are off by 0.5 % each), and not in the station's."""
    flown = flight(seed=2, duration=60.0, noise=True, air="power", effects=(("wind_shear", (("a", 0.2),)),))
    rows = seen(flown.flown, flown.log)
    assert len(rows) >= 6
    more = 0.2 - flown.flown.wind.exponent
    truth = np.array([r["station_speed_m_s"] * (r["height_m"] / 10.0) ** more for r in rows])
    assert np.array([r["speed_m_s"] for r in rows]) == pytest.approx(truth, rel=0.015)
    assert more > 0.04 and all(r["speed_m_s"] > 1.1 * r["station_speed_m_s"] for r in rows)
    # the pitot alone, without any model of forces, says so too, within three of its standard deviations
    for row, v in zip(rows, truth, strict=True):
        assert abs(row["pitot_speed_m_s"] - v) < 3 * row["pitot_speed_std"] < 4.5


def test_a_station_that_is_wrong_is_corrected_by_what_the_kite_feels():
    """Guards the smoothed processes: all stations report 0.6 m/s too much and 2 deg off; with gusts of the fit's level the kite's wind is
    the true one, not the station's, and its band says how well that is known."""
    flown = flight(seed=1, duration=60.0, noise=True)
    wrong = replace(flown.log.wind, speed=flown.log.wind.speed + 0.6, direction=flown.log.wind.direction + np.radians(2))
    rows, true = (seen(flown.flown, log, GUSTY) for log in (replace(flown.log, wind=wrong), flown.log))
    for found, as_flown in zip(rows, true, strict=True):
        truth = as_flown["station_speed_m_s"]
        assert found["station_speed_m_s"] == pytest.approx(truth + 0.6, abs=0.02)
        assert abs(found["speed_m_s"] - truth) < max(3 * found["speed_std"], 0.15) < 0.5
        off = found["direction_deg"] - as_flown["station_direction_deg"]
        assert abs((off + 180) % 360 - 180) < max(3 * found["direction_std"], 0.5)


def test_the_band_grows_with_what_is_not_known():
    """Guards the draws: an error of the record of 0.5 m/s at all stations alike is in the band, and one that is known is not."""
    flown = flight(seed=1, duration=40.0, noise=True)
    n = len(flown.log.wind.height)
    names = tuple(f"record.speed_{i}" for i in range(n))
    wide, exact = (Known(names, np.full((n, n), v), np.ones(n, bool), np.zeros(n)) for v in (0.25, 1e-12))
    declaration = DEVELOPMENT.model_copy(update={"wind": flown.flown.wind.model_copy(update={"std": 1.0})})
    loose, tight = (seen(declaration, flown.log, {}, known) for known in (wide, exact))
    assert np.mean([r["speed_std"] for r in loose]) == pytest.approx(0.5, rel=0.35)
    assert all(r["speed_std"] < 0.1 for r in tight)


def test_without_airspeed_or_record_the_pitot_says_nothing():
    """Guards logs that lack what it asks for."""
    log = flight(seed=1, duration=40.0, noise=True).log
    along, height = np.array([1.0, 0.0]), np.array([150.0])
    assert wind_of_airspeed(log, height, along) is not None
    for less in (replace(log, wind=None), replace(log, measured={n: s for n, s in log.measured.items() if n != "V_a"})):
        assert wind_of_airspeed(less, height, along) is None
