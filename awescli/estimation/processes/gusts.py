"""Gusts: Dryden's, whose level is what the pitot sees of them."""

from dataclasses import dataclass

import numpy as np

from awescli.estimation.processes.base import Group, Prior, Process
from awescli.physics.disturbances import GUSTS
from awescli.simulation.gusts import LENGTH, VERTICAL_SHARE

SPACING = 0.05
"""[s] 2 m of air at 40 m/s. What gusts do between nodes counts as noise: with nodes at 0.1 s, lags of a sample explain a part of it."""


@dataclass(frozen=True)
class Gusts(Process):
    """Longitudinal form on the horizontal axes, exp(-t V / L); the vertical axis the same with a length of its own: an estimator of so few
    loops does not tell its form from the transversal one (MIL-F-8785C, section 3.7)."""

    name = "gusts"
    doc = "turbulence that moves the kite"
    random = True

    @classmethod
    def of(cls, declaration, log) -> "Gusts":
        airspeed = mean_airspeed(log)
        level, length = Prior(0.5, 0.7), Prior(LENGTH / airspeed, 0.7)
        vertical = Prior(VERTICAL_SHARE * LENGTH / airspeed, 0.7)
        return cls(
            (
                Group("horizontal gusts", GUSTS[:2], 0.0, length.median, level, length),
                Group("vertical gusts", GUSTS[2:], 0.0, vertical.median, level, vertical),
            ),
            SPACING,
        )


def mean_airspeed(log) -> float:
    """[m/s] over the valid part of a log; over ground where it has no airspeed."""
    if "V_a" in log:
        return max(float(log["V_a"][log.valid].mean()), 5.0)
    return max(float(np.sqrt(sum(log[n][log.valid] ** 2 for n in ("v_n", "v_e", "v_d")).mean())), 5.0)
