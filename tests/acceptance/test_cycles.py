"""Whole pumping cycles, as a winch of little resolution records them."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT
from pumped import fly, wind

from awescli.api import identify, read_flight, read_kite, trace
from awescli.flightlog.kitemill_csv import to_kitemill_csv
from awescli.physics.declaration import kite_text
from awescli.simulation.campaign_flights import perturbed
from awescli.simulation.made_wind import as_measured
from awescli.simulation.synthetic import as_recorded


@pytest.mark.campaign
def test_cycles_of_a_coarse_winch_lack_nothing(tmp_path):
    """Guards winches that turn: a length in whole decimetres and its differences as the speed, on a drum that reverses within two seconds.
    Its motion was cut short at corners, which a stiff line feels as hundreds of newtons."""
    _, pumped = fly(9.5, duration=720.0, cycles=3)
    log = as_recorded(pumped.flown, DEVELOPMENT, as_measured(wind(9.5), 2), seed=1, name="cycles")
    length = log["tether_length"]
    coarse = np.round(length, 1)
    written = replace(log, inputs={**log.inputs, "tether_length": coarse, "reel_out_speed": np.gradient(coarse, log.dt)})
    for name, text in zip(("kite.csv", "wind.csv"), to_kitemill_csv(written), strict=True):
        (tmp_path / name).write_text(text)
    (tmp_path / "kite.yaml").write_text(kite_text(perturbed(DEVELOPMENT, 1)))
    flight = read_flight(tmp_path)
    assert np.abs(flight.log["tether_length"] - length).max() < 0.06
    found = trace(identify(flight, read_kite(tmp_path / "kite.yaml"), split={"of": "cycles"}))
    assert found.verdict == "none" and not found.effects
