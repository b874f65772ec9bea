"""The declared kite beside the log, before any fit: factors that were put in come out, guesses and gusts do not stop anything."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pumped
import pytest
from kites import DEVELOPMENT

from awescli.estimation.as_declared import declared_checks
from awescli.flightlog.check_names import OF_KITE
from awescli.flightlog.read import read_flight
from awescli.physics.declaration import read_kite
from awescli.simulation.campaign_flights import dev_like, perturbed
from awescli.simulation.synthetic import as_recorded, with_effects

ROOT = Path(__file__).parents[2]


def checks(declaration, log):
    return {c.name: c for c in declared_checks(declaration, log)}


def inputs(log, **channels):
    return replace(log, inputs={**log.inputs, **channels})


@pytest.fixture(scope="module")
def flown():
    """A flight whose user's guesses are 5 to 30 % off."""
    return dev_like(DEVELOPMENT, 4711, duration=80.0)


def test_the_true_kite_answers_as_declared(calm):
    found = checks(DEVELOPMENT, calm.log)
    assert set(found) == {"surface travel", "rudder response", "load as declared"} <= set(OF_KITE)
    assert all(c.ok and not c.stops for c in found.values())
    assert found["rudder response"].value == pytest.approx(1.0, abs=0.15)
    assert found["load as declared"].value == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("factor, stops, says", [(-1.0, True, "other sign"), (4.0, False, "times the deflection"), (0.1, True, "1/")])
def test_what_was_done_to_the_rudder_is_measured_and_said(flown, factor, stops, says):
    """Guards the flipped rudder that a fit called converged at chi-square 52, from a declaration that is as wrong as a user's: the response
    is that of the log as it was, over the factor."""
    usual = checks(flown.declared, flown.log)["rudder response"]
    assert usual.ok
    found = checks(flown.declared, inputs(flown.log, rudder=factor * flown.log["rudder"]))["rudder response"]
    assert found.value == pytest.approx(usual.value / factor, rel=5e-3)
    assert not found.ok and found.stops == stops and says in found.sentence


@pytest.mark.parametrize("factor, unit", [(2.2046, "lbf"), (9.80665e-3, "kN"), (9.80665, "N taken for kgf")])
def test_a_load_in_another_unit_is_named(flown, factor, unit):
    found = checks(flown.declared, replace(flown.log, measured={**flown.log.measured, "tension": factor * flown.log["tension"]}))
    assert not found["load as declared"].ok and unit in found["load as declared"].sentence


@pytest.mark.parametrize("factor", [0.95, 1.1])
def test_a_load_cell_that_is_some_per_cent_off_stops_nothing(flown, factor):
    scaled = replace(flown.log, measured={**flown.log.measured, "tension": factor * flown.log["tension"]})
    assert not any(c.stops for c in declared_checks(flown.declared, scaled))


@pytest.mark.parametrize(
    "effects",
    [
        {"actuator_lag:rudder": {"tau": 0.2, "rate": 0.6}},
        {"turbulence": {"sigma": 0.9, "L": 150.0}},
        {"airspeed_scale": {"s": 0.93}, "heading_bias": {"b": 0.035}},
    ],
    ids=lambda e: "+".join(e),
)
def test_effects_that_are_to_be_found_stop_nothing(effects):
    flight = dev_like(DEVELOPMENT, 4712, effects, duration=60.0)
    assert not any(c.stops for c in declared_checks(flight.declared, flight.log))


@pytest.mark.parametrize(
    "effects", [{"position_latency": {"tau": 0.15}}, {"winch_length": {"s": 0.01}}, {"tether_elasticity": {"EA": 6e5, "zeta": 120.0}}],
    ids=lambda e: "+".join(e),
)  # fmt: skip
def test_a_surface_that_is_held_in_every_phase_is_not_judged(effects):
    """Guards pumping flights that were refused: with late positions the elevator seemed to work five times as declared, with a line 1 %
    too long the flaps 73 times, the other way round."""
    legs = (replace(pumped.PHASES[0], guards=(pumped.Guard("tether_length", 340.0, True),)), *pumped.PHASES[1:])
    _, flight = pumped.fly(declaration=with_effects(DEVELOPMENT, effects), phases_=legs, cycles=3)
    assert flight.ended
    log = as_recorded(flight.flown, DEVELOPMENT, pumped.wind(10.0), seed=3)
    for declaration in (DEVELOPMENT, perturbed(DEVELOPMENT, 3)):
        found = checks(declaration, log)
        assert all(found[f"{surface} response"].ok for surface in ("elevator", "flaps", "rudder"))
        assert all("Too uncertain" in found[f"{surface} response"].sentence for surface in ("elevator", "flaps"))
    assert found["rudder response"].value == pytest.approx(1.0, abs=0.4)
    found = checks(declaration, inputs(log, rudder=-log["rudder"]))["rudder response"]
    assert found.stops and "other sign" in found.sentence


def test_travel_beyond_what_is_declared(calm):
    row = DEVELOPMENT.surfaces["rudder"].model_copy(update={"lower": -0.05, "upper": 0.05})
    narrow = DEVELOPMENT.model_copy(update={"surfaces": {**DEVELOPMENT.surfaces, "rudder": row}})
    found = checks(narrow, calm.log)["surface travel"]
    assert found.value == pytest.approx(np.percentile(np.abs(calm.log["rudder"]), 99) / 0.05, rel=0.05) and not found.ok


def test_a_flight_without_wind_or_too_short_says_nothing(calm):
    assert declared_checks(DEVELOPMENT, replace(calm.log, wind=None)) == []
    assert declared_checks(DEVELOPMENT, calm.log.between(0, 100)) == []


def test_the_bundled_flight_with_its_lag_is_not_stopped():
    declared = read_kite(ROOT / "data" / "kites" / "km1_initial.yaml")
    assert all(c.ok for c in declared_checks(declared, read_flight(ROOT / "data" / "km1_demo")))
