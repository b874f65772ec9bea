"""The axes of processes: independent Ornstein-Uhlenbeck processes, and how they get from node to node."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Axes:
    """The W axes of all processes of a fit, independent Ornstein-Uhlenbeck processes.

    acts: (W,) the disturbance, by its place among those of the links, that an axis adds to, or -1; drifts: (W,) the drifting channel of the
    links that it adds to, or -1; level, memory: (W,) standard deviation and correlation time [s].
    """

    acts: np.ndarray
    drifts: np.ndarray
    level: np.ndarray
    memory: np.ndarray

    def __len__(self) -> int:
        return len(self.level)

    def decay(self, dt: float | np.ndarray) -> np.ndarray:
        """(..., W) F over time differences dt (...) [s]."""
        return np.exp(-np.asarray(dt)[..., None] / self.memory)

    def variance(self, dt: float | np.ndarray) -> np.ndarray:
        """(..., W) Q over time differences dt (...) [s]."""
        return -(self.level**2) * np.expm1(-2 * np.asarray(dt)[..., None] / self.memory)

    def slope(self, dt: float | np.ndarray) -> np.ndarray:
        """(..., W) dF / d log memory over time differences dt (...) [s]; none over an endless one."""
        spans = np.where(np.isfinite(dt), dt, 0.0)[..., None] / self.memory
        return spans * np.exp(-spans)

    def summed(self, path: np.ndarray, onto: np.ndarray, count: int) -> np.ndarray:
        """(..., count, c) of `path` (..., W, c): what the axes add up to on `count` places, onto (W,) naming the place of each or -1."""
        S = np.zeros((count, len(self)))
        used = np.flatnonzero(onto >= 0)
        S[onto[used], used] = 1.0
        return np.matmul(S, path)


def gap_between(last: float | np.ndarray, first: float | np.ndarray) -> np.ndarray:
    """[s] from the last node of a segment to the first one of the next: 0 where they are one node. Segments that overlap, as they do where
    somebody cuts them so, share no process: the gap is endless."""
    gap = np.asarray(first) - np.asarray(last)
    return np.where(gap < -1e-9, np.inf, np.where(gap < 1e-9, 0.0, gap))
