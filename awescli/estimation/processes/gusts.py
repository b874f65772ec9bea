"""Gusts: Dryden's, whose level is what the pitot sees of them."""

from dataclasses import dataclass

import numpy as np

from awescli.estimation.processes.base import Group, Prior, Process
from awescli.flightlog.log import FlightLog
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.disturbances import GUSTS
from awescli.simulation.gusts import LENGTH, VERTICAL_SHARE, transversal

SPACING = 0.02
"""[s] What gusts do between nodes counts as noise, and is none: with nodes at 0.05 s accelerometers and load cell seemed a third noisier
than they were, and every effect with a little of their colour was welcome."""


def transversal_form(group: Group, dt: np.ndarray) -> np.ndarray:
    """Dryden's transversal covariance whose high frequencies, which a pitot sees, are those of the group's process: 3 sigma^2 a / w^2
    beside 4 level^2 a / w^2, a = V / L = 1 / (2 memory). It has a third more of low frequencies, which move a kite."""
    return 4 / 3 * group.level**2 * transversal(dt, 1 / (2 * group.memory))


@dataclass(frozen=True)
class Gusts(Process):
    """Longitudinal form on the horizontal axes, exp(-t V / L). The vertical axis is of the transversal form (1 - t V / 2 L) exp(-t V / L)
    (MIL-F-8785C, section 3.7): exp(-2 t V / L) has as much of it at low frequencies, and at 0.87 of the level as much at high ones."""

    name = "gusts"
    doc = "turbulence that moves the kite"
    random = True

    @classmethod
    def of(cls, declaration: KiteDeclaration, log: FlightLog) -> "Gusts":
        airspeed = mean_airspeed(log)
        level, length = Prior(0.5, 0.7), Prior(LENGTH / airspeed, 0.7)
        vertical = Prior(VERTICAL_SHARE * LENGTH / airspeed / 2, 0.7)
        return cls(
            (
                Group("horizontal gusts", GUSTS[:2], 0.0, length.median, level, length),
                Group("vertical gusts", GUSTS[2:], 0.0, vertical.median, level, vertical, transversal_form),
            ),
            SPACING,
        )


def mean_airspeed(log: FlightLog) -> float:
    """[m/s] over the valid part of a log; over ground where it has no airspeed."""
    if "V_a" in log:
        return max(float(log["V_a"][log.valid].mean()), 5.0)
    velocity = np.stack([log[n][log.valid] for n in ("v_n", "v_e", "v_d")])
    return max(float(np.sqrt((velocity**2).sum(axis=0).mean())), 5.0)
