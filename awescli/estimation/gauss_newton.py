"""Bounded, damped Gauss-Newton with Armijo search. Knows residuals, not kites.

A constrained Gauss-Newton SQP whose only constraints are bounds: the quadratic program of each step is a bounded linear least-squares
problem (scipy's BVLS), the merit function is the cost itself, sufficient decrease c = 1e-4 with factor 0.5.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear


@dataclass(frozen=True)
class Solution:
    """x: the minimiser; cost: the value there; H: Gauss-Newton Hessian there (prior included); outcome: "converged", "no_progress" or
    "iteration_limit"; decrement: half the predicted decrease of one more step; history: cost after every iteration."""

    x: np.ndarray
    cost: float
    H: np.ndarray
    outcome: str
    decrement: float
    history: tuple[float, ...]


def bounded_step(H: np.ndarray, b: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """argmin 1/2 d'Hd - b'd with lower <= d <= upper, H positive definite. Scaled to unit diagonal first."""
    if not len(b):
        return np.zeros(0)
    diagonal = np.diag(H)
    # a parameter that nothing depends on has a row of zeros: it stays where it is
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    L = _factor(H * scale * scale[:, None])
    target = solve_triangular(L, b * scale, lower=True)
    d = solve_triangular(L.T, target, lower=False) * scale
    if (d >= lower).all() and (d <= upper).all():
        return d
    # BVLS wants an interior: bounds that coincide with the present point are opened by nothing that matters
    width = 1e-12 * np.maximum(1.0, np.abs(upper - lower))
    return lsq_linear(L.T, target, bounds=((lower - width) / scale, (upper + width) / scale), method="bvls").x * scale


def _factor(H: np.ndarray) -> np.ndarray:
    """Lower Cholesky factor of H + ridge, the least ridge that rounding asks for: H of unit diagonal may be singular, or indefinite
    by rounding."""
    for ridge in (1e-13, 1e-11, 1e-9, 1e-7):
        try:
            return cholesky(H + ridge * np.eye(len(H)), lower=True)
        except np.linalg.LinAlgError:
            continue
    return cholesky(H + (1e-7 - 2 * min(float(np.linalg.eigvalsh(H)[0]), 0.0)) * np.eye(len(H)), lower=True)


def covariance(H: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Inverse of an information matrix that may be singular, positive definite always: a direction of which H knows next to nothing,
    less than 1e-12 of the best known one in units of `scale` (n,), gets the large but finite variance of that floor."""
    values, vectors = np.linalg.eigh(H * scale * scale[:, None])
    floor = 1e-12 * max(values[-1], 1e-300) if len(values) else 0.0
    scaled = vectors * scale[:, None]
    return scaled / np.maximum(values, floor) @ scaled.T


def minimise(
    linearise: Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray, float]],
    move: Callable[[np.ndarray, float], float],
    accept: Callable[[], None],
    x: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    tolerance: float = 1e-3,
    iterations: int = 30,
    on_iteration: Callable[[int, float], None] = lambda i, c: None,
) -> Solution:
    """Minimise a sum of squares over lower <= x <= upper.

    linearise(x) -> (cost, b, H, own_gain): cost at x, -dcost/dx / 2 = J'r, Gauss-Newton Hessian J'J (inner unknowns eliminated), and
    what the inner unknowns alone would still gain; move(step, share) -> cost at
    x + share * step (inner unknowns moved along); accept() makes the last move the new point. Stops when the decrement falls below
    `tolerance` (in units of the cost, so in units of chi-square for whitened residuals), or below a millionth of the cost.
    """
    damping, history, outcome, decrement = 0.0, [], "iteration_limit", np.inf
    cost, b, H, own_gain = linearise(x)
    for iteration in range(iterations):
        history.append(cost)
        on_iteration(iteration, cost)
        accepted = False
        for _ in range(5):
            damped = H + damping * np.diag(np.diag(H))
            step = bounded_step(damped, b, lower - x, upper - x)
            decrement = float(2 * b @ step - step @ H @ step) + own_gain
            if damping == 0 and decrement < max(tolerance, 1e-6 * cost):
                outcome = "converged"
                break
            share = 1.0
            while share > 0.1:
                trial = move(step, share)
                if np.isfinite(trial) and trial < cost - 1e-4 * share * decrement:
                    accepted = True
                    break
                share /= 2
            if accepted:
                break
            damping = max(10 * damping, 1e-3)
        if outcome == "converged":
            break
        if not accepted:
            outcome = "no_progress"
            break
        accept()
        x = np.clip(x + share * step, lower, upper)
        damping = 0.0 if damping < 1e-3 else damping / 10
        cost, b, H, own_gain = linearise(x)
    return Solution(x, float(cost), H, outcome, decrement, tuple(history))
