"""Model error: forces and moments that the model does not say, whatever they come from. The honest name of "the model lacks something"."""

from dataclasses import dataclass

from awescli.estimation.processes.base import Group, Prior, Process
from awescli.flightlog.log import FlightLog
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.disturbances import FORCES, MOMENTS

MEMORY = Prior(0.7)
"""[s] a tenth of a loop: what a model lacks of a flight changes as fast as the flight does. Held: one that lasts as long as a loop follows
a step of lift so well that the effect which is one cannot take its place."""
LEVELS = {**dict.fromkeys(FORCES, Prior(0.5, 1.5)), **dict.fromkeys(MOMENTS, Prior(0.2, 1.5))}
"""Force per mass [m/s2], angular acceleration [rad/s2]: a few per cent of what acts on a kite in a loop, within a factor of four or so."""
SPACING = 0.2


@dataclass(frozen=True)
class ModelError(Process):
    """Six axes, a level and a memory for each."""

    name = "model_error"
    doc = "forces and moments that the model does not say"
    random = True

    @classmethod
    def of(cls, declaration: KiteDeclaration, log: FlightLog) -> "ModelError":
        groups = (Group(axis, (axis,), 0.0, MEMORY.median, prior, MEMORY) for axis, prior in LEVELS.items())
        return cls(tuple(groups), SPACING)
