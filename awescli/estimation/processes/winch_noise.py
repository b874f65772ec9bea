"""What is not known of a line's length that was read with noise, or in coarse steps."""

from dataclasses import dataclass

from awescli.estimation.processes.base import Group, Process
from awescli.flightlog.log import FlightLog
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.disturbances import LINE
from awescli.physics.kite import has_line

SPACING = 0.1
"""[s] between nodes at most: what smoothing leaves unknown of a motion lasts as long or longer."""


@dataclass(frozen=True)
class WinchNoise(Process):
    """Of a kite on a line: the noise that the smooth motion of its winch's record still has."""

    name = "winch_noise"
    doc = "noise of the recorded line length"
    certain = True

    @classmethod
    def of(cls, declaration: KiteDeclaration, log: FlightLog) -> "WinchNoise":
        left = log.unknown.get("tether_length")
        if left is None or not has_line(declaration):
            return cls((), SPACING)
        return cls((Group.known("winch noise", (LINE,), left.std, left.memory),), SPACING)
