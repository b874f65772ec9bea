"""A smooth motion under recorded noise: the likeliest signal whose third derivative is white noise, of one level or a changing one (Wahba
1985; Rue & Held, Gaussian Markov Random Fields, ch. 3), and its likelihood, in banded matrices."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize

from awescli.flightlog.log import Unknown

FAINT = 1e-4
"""Weight of a sample that was not recorded, beside one that was: on the line between its neighbours it keeps a long gap from being nothing
at all, which no matrix can hold."""

DIFFERENCE = np.array([-1.0, 3.0, -3.0, 1.0])
"""Third difference: what a smooth motion has none of, and white noise sqrt(20) times of."""

RATE = np.array([-0.5, 0.0, 0.5])
"""Central difference."""

AVERAGE = 1.0
"""[s] over which noise averages out, and what does not is something else: a scale, a sign, another clock."""


DIGITS = 1e-6
"""Of the diagonal of a factor, smallest over largest, from which a likelihood has digits left."""

HOPELESS = 1e30
"""Deviance of levels that leave no digits, for a search that takes differences."""

REST = 0.1
"""Share of its usual jerk that a motion at rest is thought to have at least: less would hold it to a parabola."""

WHOLE = 1e-3
"""Share of a step by which a value may miss a whole one."""

SAME = 1e-7
"""By which values that are the same may differ."""

LEVELS_FROM = 10_000
"""Samples from which the noise is estimated: 200 s at 50 Hz."""


def hardest(signal: np.ndarray, dt: float) -> slice:
    """The part of a signal, `LEVELS_FROM` samples at most, about where it changes most: its motion there is that of the whole flight, what
    is quick among it."""
    width = max(1, int(round(AVERAGE / dt)))
    at = int(np.abs(np.diff(uniform_filter1d(signal, width))).argmax())
    first = int(np.clip(at - LEVELS_FROM // 2, 0, max(len(signal) - LEVELS_FROM, 0)))
    return slice(first, first + LEVELS_FROM)


def likeliest(
    deviance: Callable[[np.ndarray], float], guess: np.ndarray | Sequence[float], least: Sequence[float], most: Sequence[float],
) -> np.ndarray:  # fmt: skip
    """The levels between `least` and `most` at which a deviance is smallest, searched from a guess, in logarithms."""
    bounds, first = np.log(np.transpose([least, most])), np.log(guess)
    how = {"xatol": 0.02, "fatol": 0.5, "initial_simplex": np.vstack([first, first + np.eye(len(first))])}
    return np.exp(minimize(lambda logs: min(deviance(np.exp(logs)), HOPELESS), first, method="Nelder-Mead", bounds=bounds, options=how).x)


def lasting(left: np.ndarray, dt: float, seen: np.ndarray) -> tuple[float, float]:
    """(RMS, largest size) of what is left of a signal after `AVERAGE`."""
    width = max(1, int(round(AVERAGE / dt)))
    weight = uniform_filter1d(seen.astype(float), width)
    mean = uniform_filter1d(np.where(seen, left, 0.0), width)[seen] / weight[seen]
    return float(np.sqrt((mean**2).mean())), float(np.abs(mean).max())


def effort_of(motion: np.ndarray, dt: float) -> np.ndarray:
    """(N,) how hard a motion works about each sample, beside its usual: RMS of its third differences over `AVERAGE`, `REST` at least."""
    square = np.zeros(len(motion))
    square[1:-2] = np.convolve(motion, DIFFERENCE, "valid") ** 2
    if not square.any():
        return np.ones(len(motion))
    # a running sum may round to a little less than nothing
    return np.sqrt(np.maximum(uniform_filter1d(square, max(1, int(round(AVERAGE / dt)))) / square.mean(), REST**2))


def roughness(x: np.ndarray) -> float:
    """Standard deviation that white noise has at most in a signal."""
    return float(np.sqrt((np.convolve(x, DIFFERENCE, "valid") ** 2).mean() / 20))


def not_known(noise: float, jerk: float, dt: float, times: float = 1.0) -> Unknown:
    """What the likeliest motion may be off; times: density of the noise at low frequencies over that of a white one of its size. Where
    noise of density n and a motion of density q / w^6 meet, at w_c, the error's density falls from n as n / (1 + (w / w_c)^6) (Wiener): its
    variance is n w_c / 3, and at low frequencies it is that of a process of memory 3 / (2 w_c)."""
    corner = (jerk / noise) ** (1 / 3)
    return Unknown(float(noise * np.sqrt(times * dt * corner / 3)), float(3 / (2 * corner)))


def density(left: np.ndarray) -> float:
    """Density at low frequencies of a noise (N,) over that of a white one of its size, 1 at least: twice the sum of its autocorrelation
    while that is positive (Geyer, Statistical Science 7, 1992)."""
    left = left - left.mean()
    total, square = 1.0, float(left @ left)
    for lag in range(1, len(left) if square else 1):
        share = float(left[lag:] @ left[:-lag]) / square
        if share <= 0:
            break
        total += 2 * share
    return total


def step_of(signal: np.ndarray) -> float:
    """The step of a record (N,) all of whose values are whole steps; 0 where they are not."""
    values = np.unique(signal)
    between = np.diff(values)
    if not (between > SAME).any():
        return 0.0
    step = float(between[between > SAME].min())
    whole = (values - values[0]) / step
    return step if np.abs(whole - np.round(whole)).max() < WHOLE else 0.0


@dataclass(frozen=True)
class SmoothMotion:
    """The likelihood of a recorded length and speed for any levels. length (N,), beside a straight line (N,), and its weights (N,); speed
    (R,), beside that line's, recorded at the samples `inner` (R,); effort (N - 3,) of the jerk; bands: lower ones (4, N) of the normal
    equations' three parts."""

    length: np.ndarray
    line: np.ndarray
    weight: np.ndarray
    speed: np.ndarray
    inner: np.ndarray
    effort: np.ndarray
    dt: float
    bands: tuple[np.ndarray, np.ndarray, np.ndarray]

    @classmethod
    def of(
        cls, length: np.ndarray, speed: np.ndarray, dt: float, seen_length: np.ndarray, seen_speed: np.ndarray,
        effort: np.ndarray | None = None,
    ) -> "SmoothMotion":  # fmt: skip
        """effort (N,): factor on the level of jerk at each sample (`effort_of`); None: the same everywhere."""
        n, rows = len(length), np.arange(len(length))
        line = np.polynomial.Polynomial.fit(rows, length, 1)(rows)  # taken off for the rounding's sake
        weight, inner = np.where(seen_length, 1.0, FAINT), rows[1:-1][seen_speed[1:-1]]
        effort = np.ones(n - 3) if effort is None else effort[1:-2]
        at = np.zeros((4, n))
        at[0] = weight
        rate = _products(RATE / dt, inner - 1, np.ones(len(inner)), n)
        jerk = _products(DIFFERENCE / dt**3, rows[:-3], effort**-2.0, n)
        return cls(length - line, line, weight, (speed - np.gradient(line, dt))[inner], inner, effort, dt, (at, rate, jerk))

    def solve(self, levels: np.ndarray) -> tuple[float, np.ndarray]:
        """(-2 log likelihood but for a constant, the likeliest length (N,)) with noise of length and speed, and jerk; infinite where a
        drum so steady, and noise so large, leave rounding no digits."""
        w = 1 / np.asarray(levels) ** 2
        right = w[0] * self.weight * self.length
        for side, share in ((-1, RATE[0]), (1, RATE[2])):
            np.add.at(right, self.inner + side, w[1] * share / self.dt * self.speed)
        try:
            factor = cholesky_banded(np.tensordot(w, self.bands, 1), lower=True)
        except np.linalg.LinAlgError:
            return np.inf, self.line
        if factor[0].min() < DIGITS * factor[0].max():
            return np.inf, self.line
        found = cho_solve_banded((factor, True), right)
        # as a sum of squares: the difference of two large numbers would have no digits
        jerk = np.convolve(found, DIFFERENCE[::-1] / self.dt**3, "valid") / self.effort
        rate = (found[self.inner + 1] - found[self.inner - 1]) / (2 * self.dt)
        squares = self.weight @ (self.length - found) ** 2, ((self.speed - rate) ** 2).sum(), (jerk**2).sum()
        counts = (self.weight == 1.0).sum(), len(self.inner), len(self.effort)
        changing = 2 * np.log(self.effort).sum() + 2 * np.log(factor[0]).sum()
        return float(w @ squares + changing - np.log(w) @ counts), found + self.line


def _products(stencil: np.ndarray, begins: np.ndarray, weights: np.ndarray, n: int) -> np.ndarray:
    """Lower bands (4, n) of D'WD, each row of D a stencil that begins at one of `begins`, W its weight."""
    bands = np.zeros((4, n))
    for i, a in enumerate(stencil):
        for j, b in enumerate(stencil[i:]):
            np.add.at(bands[j], begins + i, a * b * weights)
    return bands
