"""How a law's set-points reach the surfaces, and what the loop makes of disturbances."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kites import flight

from awescli.control.linear_law import LinearLaw
from awescli.controller_fit.config import ControllerConfig
from awescli.controller_fit.fit import fit_controller
from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import split
from awescli.notation.quantities import STATES, SURFACES
from awescli.physics.declaration import read_kite
from awescli.physics.kite import Kite
from awescli.simulation.closed_loop import loop, with_setpoint_dynamics, with_what_was_found, without_setpoint_dynamics
from awescli.simulation.rollout import Segments, Simulator
from awescli.simulation.segments import observe
from awescli.simulation.survival import Amplified, gain_margin
from awescli.simulation.synthetic import with_effects
from awescli.stages.controller_artifact import wind_direction
from awescli.tracing.frame import TracedFlight

KITE = read_kite(Path(__file__).parents[2] / "data" / "kites" / "development.yaml")
STEP = LinearLaw(surfaces=("rudder",), features=("r",), centre=(0.0,), scale=(1.0,), limits={"rudder": (-1.0, 1.0)},
                 affine=np.array([[0.0, 0.0]]))  # fmt: skip


def test_delay_and_rate_limit_are_effects_of_the_kite_that_is_flown():
    law = replace(STEP, delay_s=0.1, rate_limits={"rudder": 0.5})
    once = with_setpoint_dynamics(KITE, law)
    assert {"actuator_delay:rudder", "actuator_lag:rudder"} <= set(once.effects)
    assert once.table()["actuator_delay:rudder.tau"].value == 0.1 and once.table()["actuator_lag:rudder.rate"].value == 0.5
    twice = with_setpoint_dynamics(once, replace(law, rate_limits={"rudder": 0.3}))
    assert twice.effects == once.effects
    assert twice.table()["actuator_delay:rudder.tau"].value == pytest.approx(0.2)
    assert twice.table()["actuator_lag:rudder.rate"].value == 0.3
    assert with_setpoint_dynamics(KITE, STEP) is KITE


def test_the_kite_that_was_fitted_as_a_law_drives_it_is_handed_on_alone():
    """Fitted values stay, the law's delay and limiter go, and what the kite itself declares of both is as it was."""
    law = replace(STEP, delay_s=0.1, rate_limits={"rudder": 0.5})
    own = with_effects(KITE, {"actuator_delay:rudder": {"tau": 0.03}})
    for declared in (KITE, own):
        fitted = with_setpoint_dynamics(declared, law)
        fitted = fitted.with_parameters(fitted.table().with_values({"CLa": 4.321}))
        alone = without_setpoint_dynamics(fitted, declared)
        assert alone == declared.with_parameters(declared.table().with_values({"CLa": 4.321}))


def test_a_limited_surface_follows_a_step_no_faster_than_its_limit():
    """The law asks for 0.2 rad from 0.2 s on; its surface gets there at 0.5 rad/s, 0.4 s later: slope and arrival in closed form."""
    law = replace(STEP, rate_limits={"rudder": 0.5})
    kite = Kite(with_setpoint_dynamics(KITE, law), (10.0,))
    n = 51
    step = np.zeros((1, n, len(SURFACES)))
    step[0, 10:, SURFACES.index("rudder")] = 0.2
    at = {name: i for i, name in enumerate(kite.input_names)}
    inputs = np.zeros((1, n, len(at)))
    inputs[:, :, at["tether_length"]], inputs[:, :, at["density"]], inputs[:, :, at["wind_speed_0"]] = 300.0, 1.225, 8.0
    start = np.array([[240.0, 0.0, -180.0, 30.0, 0.0, 1.0, 0.0, 0.6, 1.5, 0.0, 0.0, 0.0]])
    simulator = Simulator(kite, (), law=loop(law, kite, 0.0, disturbed=True), step=0.005)
    flown = simulator.rollout(Segments(np.zeros(1, int), start, step, inputs, 0.02))
    deflection = flown.states[0, :, kite.x_names.index("actuator_lag:rudder.deflection")]
    assert deflection[10] == pytest.approx(0.0, abs=1e-9)
    assert deflection[11:28] == pytest.approx(0.01 * np.arange(1, 18), abs=1e-6)
    assert deflection[-1] == pytest.approx(0.2, abs=1e-3)


def test_a_law_with_another_gain():
    """Guards what a gain margin flies: the answer about the trim is amplified, and still saturates."""
    law = replace(STEP, affine=np.array([[0.1, 1.0]]), limits={"rudder": (-0.5, 0.5)})
    for factor, r, expected in ((1.0, 0.2, 0.3), (2.0, 0.2, 0.5), (2.0, 0.0, 0.1), (0.5, 0.2, 0.2), (-1.0, 0.2, -0.1)):
        assert Amplified(law, factor, {"rudder": 0.1}).deflections({"r": r})["rudder"] == pytest.approx(expected), factor


def test_the_gain_margin_is_what_flies():
    """Guards the margin on a flight: the law that flew it lies inside, the same law turned round flies with no gain at all."""
    campaign = flight(duration=40.0)
    log = campaign.log
    parts = split(find_loops(log), log=log)
    law = fit_controller(log, parts.train, parts.validation, ControllerConfig(kind="linear", few_loops="blocks")).law
    margin = gain_margin(campaign.flown, law, log, wind_direction(log), 8.0)
    assert margin["lower"] < 1.0 < margin["upper"]
    turned = replace(law, affine=-np.asarray(law.affine))
    assert gain_margin(campaign.flown, turned, log, wind_direction(log), 8.0) == {"lower": None, "upper": None}


def test_what_tracing_adds_is_handed_on_without_the_laws_delay():
    """Guards trace-residual in closed loop: the effect it found keeps its size, what belongs to the law's set-points goes."""
    law = replace(STEP, delay_s=0.1, rate_limits={"rudder": 0.5})
    driven = with_setpoint_dynamics(KITE, law)
    found = with_effects(driven, {"airspeed_scale": {"s": 0.93}})
    found = found.with_parameters(found.table().with_values({"CLa": 4.321}))
    alone = with_what_was_found(found, driven, KITE)
    expected = with_effects(KITE, {"airspeed_scale": {"s": 0.93}})
    assert alone == expected.with_parameters(expected.table().with_values({"CLa": 4.321}))


def test_a_traced_flight_is_flown_by_the_law_whatever_effects_it_has():
    """Guards the law's place among the states: effects with states of their own stand between the kite's and the set-points."""
    campaign = flight(duration=20.0)
    log = campaign.log
    parts = split(find_loops(log), log=log)
    law = replace(STEP, affine=np.array([[0.02, 0.05]]))
    plain = TracedFlight(log, parts, KITE, closes=lambda kite: loop(law, kite, 0.0))
    for keys in ((), ("actuator_lag:rudder", "unsteady_lift")):
        simulator = plain.simulator(keys)
        observed = observe(log, simulator.kite, np.array([100, 300]), 50, ("r",))
        run = simulator.rollout(observed.segments)
        np.testing.assert_allclose(run["rudder"], 0.02 + 0.05 * run.states[:, :, STATES.index("r")], atol=1e-9)
