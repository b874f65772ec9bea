"""The line's length as the winch does not say it: stretch, sag and slack, slip on the drum."""

from dataclasses import dataclass

import numpy as np

from awescli.estimation.processes.base import Group, Prior, Process
from awescli.flightlog.log import FlightLog
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.disturbances import LINE
from awescli.physics.kite import has_line
from awescli.simulation.segments import Observed

LEAST, SPREAD, MEMORY = 0.3, 1.0, Prior(2.0)
"""[m], its spread, [s] A line of 400 m stretches by 0.3 m per kN (EA 0.6 MN), and follows the pull as it changes over a loop; slack, it
sags by metres."""
SPACING = 0.2
POSITION = ("p_n", "p_e", "p_d")


@dataclass(frozen=True, eq=False)
class Longer:
    """What every sample of a log says that the line is longer than its usual offset from what was paid out. values: (N,) [m]. A line that
    begins slack where the kite flew on a taut one pulls at nothing, and so says nothing of how slack it is."""

    values: np.ndarray

    def __call__(self, observed: Observed, nodes: np.ndarray) -> np.ndarray:
        """(K, L + 1) at the nodes of segments."""
        return self.values[observed.segments.first[:, None] + nodes]


@dataclass(frozen=True)
class LineLength(Process):
    """Of a kite on a line. What the distance scatters about the length paid out is what is known of its level beforehand."""

    name = "line"
    doc = "length of the line that the winch does not say"

    @classmethod
    def of(cls, declaration: KiteDeclaration, log: FlightLog) -> "LineLength":
        if "tether_length" not in log.inputs or not has_line(declaration):
            return cls((), SPACING)
        longer = np.linalg.norm([log[n] for n in POSITION], axis=0) - log["tether_length"]
        longer = longer - np.median(longer[log.valid])
        level = Prior(max(float(np.std(longer[log.valid])), LEAST), SPREAD)
        return cls((Group("line length", (LINE,), 0.0, MEMORY.median, level, MEMORY, begins=Longer(longer)),), SPACING)
