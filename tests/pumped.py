"""Pumping cycles that many tests share: the development kite, a law and a winch that nobody fitted, four phases."""

from dataclasses import replace

import numpy as np
from kites import DEVELOPMENT

from awescli.control.held import Held
from awescli.control.path_following import PathFollowing
from awescli.control.pattern import Pattern
from awescli.notation.quantities import STATES, SURFACES
from awescli.physics.kite import Kite
from awescli.simulation.made_wind import wind_record
from awescli.simulation.pumping import Pumping, PumpingPhase, with_winch
from awescli.simulation.rollout import inputs_of
from awescli.simulation.switching import Guard
from awescli.simulation.synthetic import Commanded, circle_starts

DEG = np.pi / 180
DT, LENGTH = 0.02, 270.0
HEIGHTS = np.array([10.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0, 400.0])
DRUM = {"tau": 0.3, "v_max": 10.0, "a_max": 5.0}
CIRCLE = Pattern(35.5 * DEG, 0.0, 52.0, -1.0)
LAW = PathFollowing(CIRCLE, k_radius=0.7, k_course=1.5, k_rate=3.0, limit=0.44, trims={"elevator": -1.4 * DEG, "flaps": 3.8 * DEG})
HIGH = replace(LAW, pattern=replace(CIRCLE, elevation=60 * DEG))
REELING_IN = Held(HIGH, {"elevator": 3 * DEG, "flaps": 0.0})
TAUT = {"k": 0.002, "f_low": 300.0, "f_high": 6000.0}


def setpoints(law):
    def of(x, u, c):
        told = law.deflections(dict(zip(STATES, x, strict=False)))
        return [told[s] for s in SURFACES]

    return of


PHASES = (
    PumpingPhase("traction", setpoints(LAW), {"kv": 0.045, **TAUT}, (Guard("tether_length", 400.0, True),)),
    PumpingPhase("transition", setpoints(HIGH), TAUT, (Guard("time_in_phase", 5.0, True),)),
    PumpingPhase("retraction", setpoints(REELING_IN), {"v": -5.0, "k": 0.004, "f_low": 300.0, "f_high": 1500.0},
                 (Guard("tether_length", 280.0, False),)),
    PumpingPhase("transition", setpoints(LAW), TAUT, (Guard("time_in_phase", 3.0, True),)),
)  # fmt: skip
NAMES = [p.name for p in PHASES]


def wind(speed: float):
    return wind_record(HEIGHTS, speed * (HEIGHTS / 10) ** 0.12, np.pi, 700.0)


def start() -> np.ndarray:
    """(12,) on the circle, crosswind at 42 m/s over ground."""
    kite = Kite(DEVELOPMENT, HEIGHTS)
    line = {"tether_length": np.full(50, LENGTH), "reel_out_speed": np.zeros(50)}
    inputs = inputs_of(Commanded(DT * np.arange(50), DT, line, wind(9.0)), kite)
    return circle_starts(CIRCLE, kite, inputs[0], {n: i for i, n in enumerate(kite.input_names)})[8]


def fly(speed=10.0, declaration=DEVELOPMENT, phases_=PHASES, **how):
    kite = Kite(with_winch(declaration, DRUM), HEIGHTS)
    how = {"duration": 600.0, "cycles": 2, "load": 2000.0} | how
    return kite, Pumping.of(kite, phases_).fly(wind(speed), start=start(), length=LENGTH, dt=DT, **how)
