"""Levels and memories of noise, by the restricted likelihood, with what is known of them beforehand."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from awescli.flightlog.reconstruction.gauss_markov import BandedLikelihood, Law
from awescli.notation.errors import NumericalFailure

STEP = 1e-5
"""Of differences in log levels: their error, half the curvature times it, is to be nothing beside the slope, or the search ends early."""
WIDEST = 4.0
"""Log levels are searched so far about their start (a factor of 50)."""
HOPELESS = 1e12


@dataclass(frozen=True)
class Known:
    """Log-normal prior of a level or memory: median, and spread of its logarithm."""

    median: float
    spread: float


@dataclass(frozen=True)
class Levels:
    """white (m,), laws: as estimated; spread: standard deviation of the logarithm of each white level, each law's level and each memory, in
    this order; infinite where it was not asked for."""

    white: np.ndarray
    laws: tuple[Law, ...]
    spread: np.ndarray
    deviance: float


def estimate_levels(
    likelihood: BandedLikelihood, white: Sequence[float], laws: Sequence[Law], known: Sequence[Known], *, most: int = 30,
    how_well: bool = True,
) -> Levels:  # fmt: skip
    """Levels that are likeliest, from a start. known: of white levels, levels of laws and memories where they have one, in this order;
    how_well: their spread is asked for, too."""
    laws = tuple(laws)
    start = _packed(white, laws)
    median, spread = np.log([k.median for k in known]), np.array([k.spread for k in known])
    m = len(white)

    def cost(x: np.ndarray) -> float:
        try:
            value = likelihood.at(*_unpacked(x, m, laws)).deviance
        except NumericalFailure:
            return HOPELESS
        value += (((x - median) / spread) ** 2).sum()
        return 0.5 * value if np.isfinite(value) else HOPELESS

    # white levels are known to one part in sqrt(2 n), the others to some per cent: without a scale a quasi-Newton method crawls
    size = np.r_[np.sqrt(2.0 * likelihood.series.seen.sum(0)), np.full(len(start) - m, 6.0)]

    def slope(u: np.ndarray) -> tuple[float, np.ndarray]:
        x = start + u / size
        at, steps = cost(x), STEP * np.eye(len(x))
        return at, np.array([(cost(x + d) - at) / STEP for d in steps]) / size

    bounds = [(-WIDEST * s, WIDEST * s) for s in size]
    found = minimize(slope, np.zeros(len(start)), jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": most, "ftol": 1e-8})
    best = start + found.x / size
    white_found, laws_found = _unpacked(best, m, laws)
    return Levels(white_found, laws_found, _spread(cost, best) if how_well else np.full(len(best), np.inf), 2 * float(found.fun))


def _spread(cost: Callable[[np.ndarray], float], x: np.ndarray, step: float = 0.02) -> np.ndarray:
    """Standard deviations of log levels, from the curvature of the cost; infinite where it has none."""
    k, steps = len(x), step * np.eye(len(x))
    at = cost(x)
    one, back = np.array([cost(x + d) for d in steps]), np.array([cost(x - d) for d in steps])
    H = np.diag((one - 2 * at + back) / step**2)
    for i in range(k):
        for j in range(i):
            H[i, j] = H[j, i] = (cost(x + steps[i] + steps[j]) - one[i] - one[j] + at) / step**2
    values, vectors = np.linalg.eigh(H)
    return np.sqrt((vectors**2 / np.maximum(values, 1e-6)).sum(1))


def _packed(white: Sequence[float], laws: Sequence[Law]) -> np.ndarray:
    return np.log([*white, *(law.level for law in laws), *(law.memory for law in laws if not law.walks)])


def _unpacked(x: np.ndarray, m: int, laws: Sequence[Law]) -> tuple[np.ndarray, tuple[Law, ...]]:
    values = np.exp(x)
    memories = iter(values[m + len(laws) :])
    found = (
        replace(law, level=level) if law.walks else replace(law, level=level, memory=next(memories))
        for law, level in zip(laws, values[m:], strict=False)
    )
    return values[:m], tuple(found)
