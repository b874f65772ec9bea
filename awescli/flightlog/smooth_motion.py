"""A smooth motion under recorded noise: the likeliest signal whose third derivative is white noise (Wahba 1985; Rue & Held, Gaussian Markov
Random Fields, ch. 3), and its likelihood, in banded matrices."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize

FAINT = 1e-4
"""Weight of a sample that was not recorded, beside one that was: on the line between its neighbours it keeps a long gap from being nothing
at all, which no matrix can hold."""

DIFFERENCE = np.array([-1.0, 3.0, -3.0, 1.0])
"""Third difference: what a smooth motion has none of, and white noise sqrt(20) times of."""

AVERAGE = 1.0
"""[s] over which noise averages out, and what does not is something else: a scale, a sign, another clock."""


LEVELS_FROM = 10_000
"""Samples from which the noise is estimated: 200 s at 50 Hz."""


def hardest(signal: np.ndarray, dt: float) -> slice:
    """The part of a signal, `LEVELS_FROM` samples at most, about where it changes most: its motion there is that of the whole flight, what
    is quick among it."""
    width = max(1, int(round(AVERAGE / dt)))
    at = int(np.abs(np.diff(uniform_filter1d(signal, width))).argmax())
    first = int(np.clip(at - LEVELS_FROM // 2, 0, max(len(signal) - LEVELS_FROM, 0)))
    return slice(first, first + LEVELS_FROM)


def likeliest(deviance: Callable[[np.ndarray], float], guess: Sequence[float], least: Sequence[float], most: Sequence[float]) -> np.ndarray:
    """The levels between `least` and `most` at which a deviance is smallest, searched from a guess, in logarithms."""
    bounds, until = np.log(np.transpose([least, most])), {"xatol": 0.02, "fatol": 0.5}
    return np.exp(minimize(lambda logs: deviance(np.exp(logs)), np.log(guess), method="Nelder-Mead", bounds=bounds, options=until).x)


def lasting(left: np.ndarray, dt: float, seen: np.ndarray) -> tuple[float, float]:
    """(RMS, largest size) of what is left of a signal after `AVERAGE`."""
    width = max(1, int(round(AVERAGE / dt)))
    weight = uniform_filter1d(seen.astype(float), width)
    mean = uniform_filter1d(np.where(seen, left, 0.0), width)[seen] / weight[seen]
    return float(np.sqrt((mean**2).mean())), float(np.abs(mean).max())


def roughness(x: np.ndarray) -> float:
    """Standard deviation that white noise has at most in a signal."""
    return float(np.sqrt((np.convolve(x, DIFFERENCE, "valid") ** 2).mean() / 20))


@dataclass(frozen=True)
class SmoothMotion:
    """The likelihood of a recorded length and speed for any levels: lower bands (4, N) of the normal equations' three parts."""

    at: np.ndarray
    rate: np.ndarray
    jerk: np.ndarray
    right_at: np.ndarray
    right_rate: np.ndarray
    squares: tuple[float, float]
    counts: tuple[int, int, int]
    ramp: np.ndarray

    @classmethod
    def of(cls, length: np.ndarray, speed: np.ndarray, dt: float, seen_length: np.ndarray, seen_speed: np.ndarray) -> "SmoothMotion":
        n, rows = len(length), np.arange(len(length))
        ramp = np.polynomial.Polynomial.fit(rows, length, 1)(rows)  # taken off for the rounding's sake
        weight, y, v = np.where(seen_length, 1.0, FAINT), length - ramp, speed - np.gradient(ramp, dt)
        inner = rows[1:-1][seen_speed[1:-1]]
        right = np.zeros(n)
        for side in (-1, 1):
            np.add.at(right, inner + side, side * v[inner] / (2 * dt))
        at = np.zeros((4, n))
        at[0] = weight
        rate = _products(np.array([-0.5, 0.0, 0.5]) / dt, inner - 1, n)
        jerk = _products(DIFFERENCE / dt**3, rows[:-3], n)
        squares, counts = (float(y @ (weight * y)), float(v[inner] @ v[inner])), (int(seen_length.sum()), len(inner), n - 3)
        return cls(at, rate, jerk, weight * y, right, squares, counts, ramp)

    def solve(self, levels: np.ndarray) -> tuple[float, np.ndarray]:
        """(-2 log likelihood but for a constant, the likeliest length (N,)) with noise of length and speed, and jerk; infinite where a
        drum so steady, and noise so large, cannot be told from a singular matrix."""
        w = 1 / np.asarray(levels) ** 2
        try:
            factor = cholesky_banded(w[0] * self.at + w[1] * self.rate + w[2] * self.jerk, lower=True)
        except np.linalg.LinAlgError:
            return np.inf, self.ramp
        right = w[0] * self.right_at + w[1] * self.right_rate
        found = cho_solve_banded((factor, True), right)
        cost = w[:2] @ self.squares - right @ found
        return float(cost + 2 * np.log(factor[0]).sum() - np.log(w) @ self.counts), found + self.ramp


def _products(stencil: np.ndarray, begins: np.ndarray, n: int) -> np.ndarray:
    """Lower bands (4, n) of D'D, each row of D a stencil that begins at one of `begins`."""
    bands = np.zeros((4, n))
    for i, a in enumerate(stencil):
        for j, b in enumerate(stencil[i:]):
            np.add.at(bands[j], begins + i, a * b)
    return bands
