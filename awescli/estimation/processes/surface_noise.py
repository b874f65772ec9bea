"""What is not known of control surfaces that were read with noise."""

from dataclasses import dataclass

from awescli.estimation.processes.base import Group, Process
from awescli.flightlog.log import FlightLog
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.disturbances import RECORDED
from awescli.physics.kite import surfaces_used

SPACING = 0.1
"""[s] between nodes at most: what smoothing leaves unknown of a motion lasts as long or longer."""


@dataclass(frozen=True)
class SurfaceNoise(Process):
    """A group for every surface that drives the kite, with the noise that the smooth motion of its record still has."""

    name = "surface_noise"
    doc = "noise of recorded control surfaces"
    random = True
    certain = True

    @classmethod
    def of(cls, declaration: KiteDeclaration, log: FlightLog) -> "SurfaceNoise":
        used = surfaces_used(declaration)
        groups = (
            Group.known(f"{name} noise", (axis,), log.unknown[name].std, log.unknown[name].memory)
            for name, axis in RECORDED.items()
            if name in log.unknown and name in used
        )
        return cls(tuple(groups), SPACING)
