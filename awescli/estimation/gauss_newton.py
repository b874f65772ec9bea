"""Constrained Gauss-Newton SQP: damped steps from a quadratic program, an exact penalty as merit, Armijo. Knows residuals, not kites.

The merit function is f + sigma |g| + tau max(0, -h) with sigma and tau above the multipliers (Nocedal & Wright, ch. 18), the Hessian J'J.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from awescli.estimation.quadratic_program import Limits, best_step

SUFFICIENT = 0.1
"""Share of the decrease that the slope promises which a step must bring (Armijo's c)."""
SHORTER = 0.8
"""Factor between one trial of the search and the next (Armijo's beta) ..."""
FAR_SHORTER = 0.5
"""... and where a parabola through what is known has its minimum at less than this share of the trial."""
SHORTEST = 0.1
"""Below this share of a step, damping helps more than a shorter step."""
STALLED = 3
"""So many steps that together gain less than what a fit need not gain are enough: at a kink, as a dead band has one, they never end."""
FEASIBLE = 1e-9
"""Largest violation of a row of `Limits` that counts as none."""


@dataclass(frozen=True)
class Solution:
    """x: the minimiser; cost: the value there; H: Gauss-Newton Hessian there (prior included); outcome: "converged", "no_progress" or
    "iteration_limit"; kkt: residual of the optimality conditions, see `minimise`; history: cost after every iteration.

    multipliers: (n + m,) of bounds and rows: how much the optimal cost falls per unit that an upper limit is raised (negative: that a
    lower one is raised), 0 where a limit is not active.
    """

    x: np.ndarray
    cost: float
    H: np.ndarray
    outcome: str
    kkt: float
    history: tuple[float, ...]
    multipliers: np.ndarray


def covariance(H: np.ndarray, scale: np.ndarray, equalities: np.ndarray | None = None) -> np.ndarray:
    """Inverse of an information matrix that may be singular, positive definite always: a direction of which H knows next to nothing,
    less than 1e-12 of the best known one in units of `scale` (n,), gets the large but finite variance of that floor.

    equalities: (m, n) rows A of constraints A x = const, which leave no variance across them.
    """
    basis = np.diag(scale)
    if equalities is not None and len(equalities):
        _, s, Vt = np.linalg.svd(equalities * scale)
        basis = basis @ Vt[np.count_nonzero(s > 1e-12 * s[0]) :].T
    values, vectors = np.linalg.eigh(basis.T @ H @ basis)
    floor = 1e-12 * max(values[-1], 1e-300) if len(values) else 0.0
    spread = basis @ vectors
    return spread / np.maximum(values, floor) @ spread.T


def minimise(
    linearise: Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray, float]],
    move: Callable[[np.ndarray, float], float],
    accept: Callable[[], None],
    x: np.ndarray,
    limits: Limits,
    *,
    tolerance: float = 1e-3,
    iterations: int = 30,
    on_iteration: Callable[[int, float], None] = lambda i, c: None,
) -> Solution:
    """Minimise a sum of squares over x in `limits`; x may start outside the rows of `limits`, not outside the bounds.

    linearise(x) -> (cost, b, H, own_gain): cost at x, -dcost/dx / 2 = J'r, Gauss-Newton Hessian J'J (inner unknowns eliminated), and
    what the inner unknowns alone would still gain; move(step, share) -> cost at x + share * step (inner unknowns moved along);
    accept() makes the last move the new point.

    Stops when the KKT residual at the multipliers of the quadratic program falls below `tolerance`, or below a millionth of the cost. It is
    counted in units of the cost (chi-square for whitened residuals): the gradient of the Lagrangian in the norm of H^-1, plus the
    complementarity products, plus own_gain; and no row may be violated. Ends without progress where no step helps, or the last STALLED ones
    together helped by less than `tolerance`.
    """
    damping, history, gains, outcome, kkt = 0.0, [], [], "iteration_limit", np.inf
    multipliers, weight = np.zeros(len(x) + len(limits.low)), _Weight(limits)
    cost, b, H, own_gain = linearise(x)
    for iteration in range(iterations):
        history.append(cost)
        on_iteration(iteration, cost)
        share = 0.0
        for _ in range(5):
            step, found = best_step(H + damping * np.diag(np.diag(H)), b, limits, x)
            violation = limits.violation(x)
            if damping == 0:
                kkt = float(step @ H @ step + 2 * _complementarity(found, limits, x)) + own_gain
                if kkt < max(tolerance, 1e-6 * cost) and violation.max(initial=0.0) < FEASIBLE:
                    outcome, multipliers = "converged", found
                    break
            if len(gains) >= STALLED and sum(gains[-STALLED:]) < tolerance:
                break
            weight.raise_above(found[len(x) :])
            slope = -2 * float(b @ step) - 2 * own_gain - weight.penalty(violation)
            share, gain = _search(move, step, lambda s, x=x, d=step: weight.at(x + s * d), cost + weight.penalty(violation), slope)
            if share:
                break
            damping = max(10 * damping, 1e-3)
        if outcome == "converged":
            break
        if not share:
            outcome = "no_progress"
            break
        accept()
        gains.append(gain)
        x = limits.clip(x + share * step)
        multipliers = multipliers + share * (found - multipliers)
        damping = 0.0 if damping < 1e-3 else damping / 10
        cost, b, H, own_gain = linearise(x)
    return Solution(x, float(cost), H, outcome, kkt, tuple(history), 2 * multipliers)


def _search(move, step, penalty: Callable[[float], float], merit: float, slope: float) -> tuple[float, float]:
    """(the first share of a step at which the merit has fallen enough, by how much); 0 if there is none."""
    share = 1.0
    while share > SHORTEST:
        rise = move(step, share) + penalty(share) - merit
        if np.isfinite(rise) and rise < SUFFICIENT * share * slope:
            return share, -rise
        lowest = -slope * share / max(2 * (rise - slope * share), 1e-300)
        share *= SHORTER if lowest > FAR_SHORTER else FAR_SHORTER
    return 0.0, 0.0


def _complementarity(multipliers: np.ndarray, limits: Limits, x: np.ndarray) -> float:
    """Sum of |multiplier * distance to its limit|."""
    below, above = limits.room(x)
    distance = np.where(multipliers > 0, above, below)
    return float(np.abs(multipliers[multipliers != 0] * distance[multipliers != 0]).sum())


class _Weight:
    """sigma and tau of the merit function: they only grow, and stay above the multipliers of the cost."""

    def __init__(self, limits: Limits):
        self.limits, self.sigma, self.tau = limits, 0.0, 0.0

    def raise_above(self, multipliers: np.ndarray) -> None:
        """multipliers (m,) of the rows, of half the cost."""
        size, equal = 3 * np.abs(multipliers), self.limits.equal
        self.sigma, self.tau = max(self.sigma, size[equal].max(initial=0.0)), max(self.tau, size[~equal].max(initial=0.0))

    def penalty(self, violation: np.ndarray) -> float:
        return float(np.where(self.limits.equal, self.sigma, self.tau) @ violation)

    def at(self, x: np.ndarray) -> float:
        return self.penalty(self.limits.violation(x))
