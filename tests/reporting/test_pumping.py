"""What the page says of pumping cycles, and the power curve as a figure and as files."""

from dataclasses import replace

from reporting.small_evidence import evidence

from awescli.reporting.free_flight import free_flight, sentence
from awescli.reporting.marks import plain
from awescli.reporting.paper import table_of
from awescli.reporting.pumping import cycles, power_curve
from awescli.reporting.rendering import show

PART = {
    "cycle": 1,
    "from_s": 0.0,
    "to_s": 40.0,
    "energy_J": 88e3,
    "mean_W": 2200.0,
    "mean_tension_N": 1900.0,
    "from_m": 270.0,
    "to_m": 400.0,
}
POINT = {"wind_m_s": 8.0, "mean_W": 2000.0, "low_W": 1500.0, "high_W": 2500.0, "flown": 4, "draws": 4}
LOST = {"wind_m_s": 6.0, "mean_W": None, "low_W": None, "high_W": None, "flown": 0, "draws": 4}


def pumped():
    found = evidence()
    more = {
        "mean_cycle_interval_W": [1800.0, 2600.0], "draws_flown": 9,
        "phases": [PART | {"phase": "traction", "ended_by": "tether_length"}], "cycles": [PART], "mean_cycle_W": 2200.0,
        "power_curve": {"initial": [LOST, POINT], "identified": [LOST, POINT | {"mean_W": 1800.0}]},
    }  # fmt: skip
    return replace(found, flown={**found.flown, **more})


def test_cycles_stand_on_the_page():
    """Guards the sentence, the row of each phase and cycle, and the figure's place."""
    found = pumped()
    html = show(free_flight(found))
    said = plain(sentence(found))
    assert "1 pumping cycle, mean power 2.20 kW (90 % of 9 kites that might be this one and fly: 1.80 to 2.60)" in said
    assert "only the wind of the flight" in said
    for piece in ("cycle 1, traction", "cycle 1, whole", "tether length", "270 to 400", "fig-power-curve"):
        assert piece in html, piece


def test_a_lost_wind_is_a_gap():
    """Guards the curve: kilowatts against wind, a gap where the kite is lost, the band only where there is one, and all of it as CSV."""
    figure = power_curve(pumped())
    low, high, mean = figure.data[:3]
    assert (mean["x"], mean["y"]) == ([6.0, 8.0], [None, 2.0]) and (low["x"], low["y"], high["y"]) == ([8.0], [1.5], [2.5])
    assert "4 kites" in figure.note and b"identified,8.0,1.8" in table_of(figure, {})


def test_without_phases_there_is_nothing():
    """Guards flights of before."""
    assert cycles(evidence()) == ("", "")
