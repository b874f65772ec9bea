"""Pitch and yaw gusts: the gradients of the vertical and of the lateral gust along the fuselage."""

from dataclasses import dataclass

from awescli.estimation.processes.base import Group, Prior, Process
from awescli.estimation.processes.gusts import SPACING, mean_airspeed
from awescli.flightlog.log import FlightLog
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.disturbances import GUST_RATES
from awescli.simulation.gusts import roll_corner, yaw_corner


@dataclass(frozen=True)
class PitchYawGusts(Process):
    """MIL-F-8785C's q_g and r_g: levels free, lasting 4 b / (pi V) and 3 b / (pi V), where their spectra fall off. In the specification
    they are gradients of the gusts themselves; here they are of their own, as the air at the tail is not that at the vanes."""

    name = "pitch_yaw_gusts"
    doc = "turbulence that pitches and yaws the kite"
    random = True

    @classmethod
    def of(cls, declaration: KiteDeclaration, log: FlightLog) -> "PitchYawGusts":
        airspeed, span = mean_airspeed(log), declaration.parameters["b"].value
        corners = roll_corner(airspeed, span), yaw_corner(airspeed, span)
        return cls(
            tuple(
                Group(name, (axis,), 0.0, 1 / corner, Prior(0.1, 1.0), Prior(1 / corner))
                for name, axis, corner in zip(("pitch gusts", "yaw gusts"), GUST_RATES[1:], corners, strict=True)
            ),
            SPACING,
        )
