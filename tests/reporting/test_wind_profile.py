"""The wind against height on the page, and the line in which evaluate says it."""

from dataclasses import replace

import pytest
from reporting.small_evidence import evidence

from awescli.artifacts import write_json
from awescli.notation.quantities import STATES
from awescli.reporting.flight import flight
from awescli.reporting.marks import blocks
from awescli.reporting.paper import table_of
from awescli.reporting.plots import Figure
from awescli.reporting.rendering import show
from awescli.reporting.wind_profile import wind_profile
from awescli.stages.wind_profile import levels_of, wind_line

LOW = {"height_m": 120.0, "seconds": 20.0, "speed_m_s": 12.0, "direction_deg": 58.0, "speed_std": 0.1, "direction_std": 0.2,
       "station_speed_m_s": 10.7, "station_direction_deg": 58.5}  # fmt: skip
PITOT = {"pitot_speed_m_s": 11.5, "pitot_speed_std": 0.4, "pitot_direction_deg": 58.2, "pitot_direction_std": 0.3}


def told(*rows):
    found = evidence()
    return replace(found, scores={**found.scores, "wind_profile": {"model": "with_effects", "rows": list(rows)}})


def test_kite_pitot_and_station_stand_side_by_side():
    """Guards the two panels: lines by height, bars of 90 %, all of it as CSV with half-widths."""
    found = told(LOW | PITOT, {**LOW, **PITOT, "height_m": 180.0, "seconds": 10.0})
    speed, direction = (piece for piece in blocks(wind_profile(found)) if isinstance(piece, Figure))
    station, pitot, kite = speed.data
    assert station["x"] == [10.7, 10.7] and station["y"] == kite["y"] == [120.0, 180.0]
    assert kite["error_x"]["array"] == pytest.approx([0.1645] * 2) and pitot["error_x"]["array"] == pytest.approx([0.658] * 2)
    assert b'"station, as declared",10.7,120.0' in table_of(speed, {}) and direction.data[0]["x"] == [58.5, 58.5]
    assert 'id="fig-wind-speed"' in show(flight(found))


def test_without_a_pitot_the_kite_stands_alone():
    """Guards logs without airspeed, and artifacts without a profile."""
    speed, _ = (piece for piece in blocks(wind_profile(told(LOW))) if isinstance(piece, Figure))
    assert len(speed.data) == 2 and wind_profile(evidence()) == ""


def test_the_line_names_the_height_that_is_flown_most():
    """Guards the end of evaluate: kite, pitot and station, with the kite's interval."""
    line = wind_line([{**LOW, "seconds": 5.0, "height_m": 300.0}, LOW | PITOT])
    assert line == "wind at 120 m: the kite says 12.0 m/s (90 %: +-0.2) from 58 deg, pitot 11.5 +-0.7 m/s; station 10.7 m/s from 58 deg"


def test_levels_are_those_of_the_stage_that_made_the_model(tmp_path):
    """Guards where processes come from: the tracer's effects.json, identify's metrics.json, and none where a fit left none."""

    class Run:
        def upstream(self, stage):
            return tmp_path / stage

    part = {n: 0.1 for n in (*STATES, "mean")}
    left = {
        "outcome": "converged", "chi2": 1.0, "method": "filter error", "surfaces": "recorded", "horizon_s": 5.0, "outputs": ["p"],
        "nrmse": dict.fromkeys(("train", "validation", "test"), part), "noise_factors": {"p": 1.1},
        "processes": {"wind record": {"level": 0.07, "unit": "m/s"}},
    }  # fmt: skip
    write_json(tmp_path / "identify" / "metrics.json", left)
    levels, factors = levels_of(Run(), "identified")
    assert levels["wind record"]["level"] == 0.07 and factors == {"p": 1.1}
    assert levels_of(Run(), "with_effects") == (None, {})
