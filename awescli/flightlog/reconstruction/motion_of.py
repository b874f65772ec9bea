"""The part of a log that is reconstructed: flown, valid, in stretches without gaps; and what its signals integrate to."""

from dataclasses import dataclass

import numpy as np

from awescli.flightlog.log import FlightLog, runs_of
from awescli.flightlog.phases import phases
from awescli.flightlog.smoothing import local_quadratic
from awescli.notation.frames import rotation_body_to_ned

GAP = 3
"""Samples that may be invalid in one piece within a stretch: rates and velocities are taken from the line between its ends."""
SHORTEST = 4.0
"""s a stretch must last."""
PIECE = 30.0
"""s of the pieces that stand for a log of more than MOST samples."""
MOST = 60_000
"""Samples that are integrated; of a longer log pieces from begin to end."""


@dataclass(frozen=True)
class Motion:
    """Samples of a log, one stretch after the other. rows (n,): which; restart (n,): where a stretch begins; good (n,): valid."""

    log: FlightLog
    rows: np.ndarray
    restart: np.ndarray
    good: np.ndarray

    @property
    def dt(self) -> float:
        return self.log.dt

    @property
    def time(self) -> np.ndarray:
        return self.log.time[self.rows]

    def __len__(self) -> int:
        return len(self.rows)

    def three(self, *names: str) -> np.ndarray:
        """(n, 3) of three signals."""
        return np.stack([self.log[name][self.rows] for name in names], axis=1)

    def seen(self, *names: str) -> np.ndarray:
        """(n, m) bool: valid, and a new value of its sensor."""
        return np.stack([self.good & self.log.is_new(name)[self.rows] for name in names], axis=1)

    @property
    def rotation(self) -> np.ndarray:
        """(n, 3, 3) body to NED."""
        R = rotation_body_to_ned(*self.three("phi", "theta", "psi").T)
        zero = np.zeros(len(self))
        return np.array([[zero + entry for entry in row] for row in R]).transpose(2, 0, 1)

    def steps(self, x: np.ndarray) -> np.ndarray:
        """(n, ...) integral of x (n, ...) from each sample to the next, by the cubic through four samples: fourth order. The last of a
        stretch has none (zero)."""
        last = np.append(self.restart[1:], True)
        ahead = np.concatenate([x[1:], x[-1:]])
        further, before = np.concatenate([x[2:], x[-2:]]), np.concatenate([x[:1], x[:-1]])
        inner = ~(self.restart | np.append(last[1:], True)) & ~last
        shape = (-1,) + (1,) * (x.ndim - 1)
        trapezoid = self.dt / 2 * (x + ahead)
        cubic = self.dt / 24 * (13 * (x + ahead) - before - further)
        return np.where(last.reshape(shape), 0.0, np.where(inner.reshape(shape), cubic, trapezoid))

    def run(self, steps: np.ndarray) -> np.ndarray:
        """(n, ...) sum of steps up to each sample, from zero at the begin of each stretch."""
        total = np.concatenate([0 * steps[:1], np.cumsum(steps[:-1], axis=0)])
        return total - total[np.maximum.accumulate(np.where(self.restart, np.arange(len(self)), 0))]

    def smoothed(self, x: np.ndarray, span: float, derivative: int = 0) -> np.ndarray:
        """(n, ...) x, or its rate of change (1), by local quadratics over `span` seconds within each stretch."""
        parts = np.split(x, np.flatnonzero(self.restart)[1:])
        return np.concatenate([local_quadratic(part, self.dt, span, derivative) for part in parts])


def motion_of(log: FlightLog) -> Motion | None:
    """The flown stretches of a log, at most MOST samples spread over the flight; None where there is none."""
    flown = ~np.isin(phases(log), ("ground", "hover"))
    good = log.valid & flown
    joined = good.copy()
    for first, last in runs_of(~good):
        if last - first <= GAP and 0 < first and last < len(log) and flown[first:last].all():
            joined[first:last] = True
    ranges = [(a, b) for a, b in runs_of(joined) if (b - a) * log.dt >= SHORTEST]
    if sum(b - a for a, b in ranges) > MOST:
        length = max(int(PIECE / log.dt), int(SHORTEST / log.dt) + 1)
        pieces = [(i, i + length) for a, b in ranges for i in range(a, b - length + 1, length)]
        pieces = pieces or [(a, min(b, a + length)) for a, b in ranges]
        chosen = np.unique(np.linspace(0, len(pieces) - 1, min(len(pieces), max(MOST // length, 1))).astype(int))
        ranges = [pieces[i] for i in chosen]
    if not ranges:
        return None
    rows = np.concatenate([np.arange(a, b) for a, b in ranges])
    restart = np.zeros(len(rows), bool)
    restart[np.cumsum([0, *(b - a for a, b in ranges[:-1])])] = True
    return Motion(log, rows, restart, log.valid[rows])


def turn(vectors: np.ndarray) -> np.ndarray:
    """(n, 3, 3) rotation by vectors (n, 3) [rad] (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    K = skew(vectors)
    small = angle < 1e-6
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1 - angle**2 / 6, np.sin(safe) / safe)
    b = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    return np.eye(3) + a * K + b * (K @ K)


def turned_by(R: np.ndarray) -> np.ndarray:
    """(n, 3) [rad] the inverse of `turn`, for angles well below 180 deg."""
    axis = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(R, axis1=1, axis2=2) - 1))
    return axis * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-12), 1.0)[:, None]


def skew(a: np.ndarray) -> np.ndarray:
    """(n, 3, 3) with skew(a) b = a x b."""
    zero = np.zeros(len(a))
    return np.array([[zero, -a[:, 2], a[:, 1]], [a[:, 2], zero, -a[:, 0]], [-a[:, 1], a[:, 0], zero]]).transpose(2, 0, 1)
