"""Sensor drift: errors of a channel that wander, as those of an inertial navigation system do."""

from dataclasses import dataclass, replace

from awescli.estimation.processes.base import Group, Prior, Process
from awescli.estimation.processes.model_error import SPACING
from awescli.flightlog.log import FlightLog
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.sizes import growth

DEG = 3.14159265358979 / 180
CHANNELS: dict[str, tuple[tuple[str, ...], Prior, str]] = {
    "roll and pitch drift": (("phi", "theta"), Prior(0.3 * DEG, 0.8), ""),
    "yaw drift": (("psi",), Prior(0.5 * DEG, 0.8), ""),
    "position drift": (("p_n", "p_e", "p_d"), Prior(0.5, 0.8), ""),
    "airspeed drift": (("V_a",), Prior(0.5, 0.8), ""),
    "load drift": (("tension",), Prior(50.0, 0.8), "N"),
}
"""Group -> its channels, what is known of its level, and the unit with which that grows from kite to kite (`sizes.growth`): attitude of a
MEMS system 0.2-1 deg, GNSS position 0.5 m, on kites of any size; a load cell for some 5 kN 50 N, and a larger one more."""
MEMORY = Prior(6.0)
"""[s] 2 to 20 s are usual. Held: one that lasts as long as a flight is a bias or a scale, which effects of the library are."""


@dataclass(frozen=True)
class Drift(Process):
    """A group for every kind of channel that a log has. Its nodes lie as close as those of model error, so that they stay where they are
    when that goes: a drift may stand for something quicker, which a position that is 0.15 s late is."""

    name = "drift"
    doc = "errors of sensors that wander"

    @classmethod
    def of(cls, declaration: KiteDeclaration, log: FlightLog) -> "Drift":
        groups = []
        for name, (channels, level, unit) in CHANNELS.items():
            if there := tuple(c for c in channels if c in log):
                usual = replace(level, median=level.median * growth(unit, declaration))
                groups.append(Group(name, there, 0.0, MEMORY.median, usual, MEMORY))
        return cls(tuple(groups), SPACING)
