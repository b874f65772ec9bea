"""Roll gusts: the gradient of the vertical gust along the span."""

from dataclasses import dataclass

from awescli.estimation.processes.base import Group, Prior, Process
from awescli.estimation.processes.gusts import SPACING, mean_airspeed
from awescli.flightlog.log import FlightLog
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.disturbances import GUST_RATES
from awescli.simulation.gusts import roll_corner


@dataclass(frozen=True)
class RollGusts(Process):
    """MIL-F-8785C's p_g: level free, lasting 4 b / (pi V)."""

    name = "roll_gusts"
    doc = "turbulence that rolls the kite"
    random = True

    @classmethod
    def of(cls, declaration: KiteDeclaration, log: FlightLog) -> "RollGusts":
        memory = 1 / roll_corner(mean_airspeed(log), declaration.parameters["b"].value)
        return cls((Group("roll gusts", GUST_RATES[:1], 0.0, memory, Prior(0.1, 1.0), Prior(memory)),), SPACING)
