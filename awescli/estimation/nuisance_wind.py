"""Nuisance wind: what the recorded wind leaves out, as unknowns of a segment with a Gaussian prior.

Two kinds: the error of the record in calm air, and gusts. Both are linear in time between nodes (a step at a node would make any lag
look like an explanation).
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.optimize import minimize_scalar

from awescli.simulation.gusts import LENGTH, VERTICAL_SHARE, longitudinal, roll_corner, roll_level, transversal

SETTLED_WINDOW = 0.05
"""[s] between the nodes of a gust once the parameters are near: 2 m of air at 40 m/s. Between nodes a gust is taken for noise: with nodes
at 0.1 s, lags of a sample would explain a part of it."""
LENGTHS = (20.0, 800.0)
"""[m] between which the length scale of gusts is looked for: MIL-F-8785C has 60 m to 530 m."""


@dataclass(frozen=True)
class RecordError:
    """The recorded wind's own error: per axis with standard deviation `std` [m/s], nodes some `window` seconds apart, correlated as
    exp(-|dt| / memory). A window longer than the segment: one constant. std 0: no nuisance wind.
    """

    std: float
    window: float = np.inf
    memory: float = 3.0
    random: ClassVar[bool] = False
    """Are there so many nodes, each known so badly, that a fit has to integrate them out (see `information.integrated`)?"""

    def correlation(self, time) -> np.ndarray:
        """(axes, ...) correlation per axis over a time difference [s]."""
        return np.stack([np.exp(-np.abs(time) / self.memory)] * 3)

    @property
    def axes(self) -> str:
        """North, east, down [m/s]; p is the roll gust [rad/s]."""
        return "ned"

    @property
    def stds(self) -> np.ndarray:
        """(axes,) standard deviation per axis."""
        return np.full(3, self.std)

    def nodes(self, steps: int, dt: float) -> np.ndarray:
        """Samples of the nodes: evenly spaced over a segment, ends included; the first alone for a constant."""
        if self.std <= 0:
            return np.zeros(0, int)
        count = int(round(steps * dt / self.window)) if np.isfinite(self.window) else 0
        return np.round(np.linspace(0, steps, count + 1)).astype(int) if count else np.zeros(1, int)

    def hats(self, steps: int, dt: float) -> np.ndarray:
        """(N+1, n_nodes) weights of the nodes at every sample."""
        nodes = self.nodes(steps, dt)
        rows = [np.interp(np.arange(steps + 1), nodes, row) for row in np.eye(len(nodes))]
        return np.stack(rows, axis=1) if rows else np.zeros((steps + 1, 0))

    def precision(self, steps: int, dt: float) -> np.ndarray:
        """Prior precision of the nodes, in the order [node, axis]."""
        time = self.nodes(steps, dt) * dt
        n = len(self.axes)
        result = np.zeros((n * len(time),) * 2)
        for axis, C in enumerate(self.correlation(time[:, None] - time) if len(time) else ()):
            result[axis::n, axis::n] = np.linalg.inv(C + self._lasting(axis, C, steps * dt)) / self.stds[axis] ** 2
        return result

    def _lasting(self, axis: int, C: np.ndarray, length: float) -> float:
        """Further variance of the mean over a segment of `length` [s], over that of the axis."""
        return 0.0

    def between_nodes(self, steps: int, dt: float) -> np.ndarray:
        """(axes,) standard deviation per axis of what the wind does beside the best line from node to node [m/s]: the trace of the process'
        covariance outside of the space of the hats."""
        q, _ = np.linalg.qr(self.hats(steps, dt))
        time = np.arange(steps + 1) * dt
        C = self.correlation(time[:, None] - time)
        return self.stds * np.sqrt(np.maximum(1 - np.einsum("ti,ats,si->a", q, C, q) / len(time), 0.0))


@dataclass(frozen=True)
class Gusts(RecordError):
    """Dryden gusts: the horizontal axes with the longitudinal form, the vertical one with the transversal (`simulation.gusts`).

    std: of every axis [m/s]; length, vertical_length: scales [m]; airspeed: through the field [m/s]; span: of the wing [m]; roll: standard
    deviation of the roll gust over that of the specification, 0: none.
    """

    airspeed: float = 40.0
    length: float = LENGTH
    vertical_length: float = VERTICAL_SHARE * LENGTH
    span: float = 5.0
    roll: float = 0.0
    random: ClassVar[bool] = True

    @property
    def axes(self) -> str:
        return "nedp" if self.roll else "ned"

    @property
    def stds(self) -> np.ndarray:
        rolling = [self.roll * self.std * roll_level(self.span, self.vertical_length)] if self.roll else []
        return np.array([self.std, self.std, self.std, *rolling])

    def correlation(self, time) -> np.ndarray:
        time = np.abs(time)
        horizontal = longitudinal(time, self.airspeed / self.length)
        rolling = [longitudinal(time, roll_corner(self.airspeed, self.span))] if self.roll else []
        return np.stack([horizontal, horizontal, transversal(time, self.airspeed / self.vertical_length), *rolling])

    def _lasting(self, axis: int, C: np.ndarray, length: float) -> float:
        """Gusts last from one segment into the next, and segments are fitted as if they were independent: the mean over a segment gets
        the variance that makes its mean over many segments right, integral of the correlation / length."""
        slow = (2 * self.length, 2 * self.length, self.vertical_length, 8 * self.span / np.pi)
        integral = slow[axis] / self.airspeed
        return max(integral / length - float(C.mean()), 0.0)

    @property
    def possible(self) -> bool:
        """Are the lengths those of air, and not at the short end of where they are looked for?"""
        return min(self.length, self.vertical_length) > 1.05 * LENGTHS[0]

    def likeliest(self, moments: np.ndarray, steps: int, dt: float) -> "Gusts":
        """The lengths, and the level of roll gusts, under which estimated gusts are likeliest; moments: (axes, n, n) E[g g'] per axis, mean
        over segments.

        Only differences between neighbours count, as in restricted maximum likelihood: a slow error of the wind is no gust.
        """
        time = self.nodes(steps, dt) * dt
        D = np.diff(np.eye(len(time)), axis=0)
        tau = np.abs(time[:, None] - time)

        def length(form, S: np.ndarray) -> float:
            def deviance(log_length: float) -> float:
                C = self.std**2 * D @ form(tau, self.airspeed / np.exp(log_length)) @ D.T
                return np.linalg.slogdet(C)[1] + np.trace(np.linalg.solve(C, D @ S @ D.T))

            return float(np.exp(minimize_scalar(deviance, bounds=np.log(LENGTHS), method="bounded", options={"xatol": 1e-3}).x))

        horizontal = length(longitudinal, (moments[0] + moments[1]) / 2)
        found = replace(self, length=horizontal, vertical_length=length(transversal, moments[2]))
        if not self.roll:
            return found
        C = longitudinal(tau, roll_corner(self.airspeed, self.span))
        level = np.sqrt(np.trace(np.linalg.solve(C, moments[3])) / len(time))
        return replace(found, roll=float(level / (self.std * roll_level(self.span, found.vertical_length))))
