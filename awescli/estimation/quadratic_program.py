"""The set that a fit may not leave, and the quadratic program of one step in it."""

from collections.abc import Sequence
from dataclasses import dataclass

import daqp
import numpy as np
from scipy.linalg import cholesky, solve_triangular

from awescli.notation.errors import NumericalFailure

RIDGES = (1e-13, 1e-11, 1e-9, 1e-7)
"""Of a Hessian with unit diagonal, tried one after the other: the least that rounding asks for."""
FIRMER = (1e-8, 1e-6, 1e-4, 1e-2)
"""Further ridges for a program that is not solved: a step that is shorter than it might be is better than none."""
_EQUALITY = 5
"""daqp's mark of a row whose two bounds are one."""


@dataclass(frozen=True)
class Limits:
    """lower <= x <= upper, shape (n,), and low <= A x <= high, A (m, n); a row with low = high is an equality. Infinite: no limit."""

    lower: np.ndarray
    upper: np.ndarray
    A: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def box(cls, lower: Sequence[float] | np.ndarray, upper: Sequence[float] | np.ndarray) -> "Limits":
        """Bounds and nothing else."""
        lower, upper = np.asarray(lower, float), np.asarray(upper, float)
        return cls(lower, upper, np.zeros((0, len(lower))), np.zeros(0), np.zeros(0))

    @property
    def equal(self) -> np.ndarray:
        """(m,) which rows are equalities."""
        return self.low == self.high

    def clip(self, x: np.ndarray) -> np.ndarray:
        """x moved inside its bounds (not inside the rows)."""
        return np.clip(x, self.lower, self.upper)

    def violation(self, x: np.ndarray) -> np.ndarray:
        """(m,) how far A x lies outside: |g| of an equality, max(0, -h) of an inequality."""
        value = self.A @ x
        return np.maximum(np.maximum(self.low - value, value - self.high), 0.0)

    def room(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(below, above), each (n + m,): how far a step may go, bounds first."""
        value = self.A @ x
        return np.r_[self.lower - x, self.low - value], np.r_[self.upper - x, self.high - value]


def best_step(H: np.ndarray, b: np.ndarray, limits: Limits, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(d, multipliers): d = argmin 1/2 d'Hd - b'd with x + d in `limits`, H (n, n) positive definite or nearly so.

    multipliers (n + m,), bounds first: positive at an upper limit, negative at a lower one, with H d - b + [1; A]' multipliers = 0.
    Solved by DAQP, a dual active-set method (Arnstroem, Bemporad & Axehill, IEEE TAC 67(8), 2022), in units that give H a unit diagonal and
    every row of A length one. Raises NumericalFailure("quadratic_program"), also where no step leads into the limits.
    """
    n, m = len(b), len(limits.low)
    if not n:
        return np.zeros(0), np.zeros(m)
    diagonal = np.diag(H)
    # a parameter that nothing depends on has a row of zeros: it stays where it is
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    firm = _firm(H * scale * scale[:, None])
    L = cholesky(firm, lower=True)
    d = solve_triangular(L.T, solve_triangular(L, b * scale, lower=True), lower=False) * scale
    below, above = limits.room(x)
    reach = np.r_[d, limits.A @ d]
    if (reach >= below).all() and (reach <= above).all():
        return d, np.zeros(n + m)
    rows = limits.A * scale
    length = np.r_[scale, np.maximum(np.linalg.norm(rows, axis=1), 1e-300)]
    sense = np.where(below == above, _EQUALITY, 0).astype(np.int32)
    for ridge in (0.0, *FIRMER):
        found, _, flag, info = daqp.solve(
            firm + ridge * np.eye(n), -b * scale, rows / length[n:, None], above / length, below / length, sense,
            primal_tol=max(1e-12, ridge), zero_tol=1e-14, pivot_tol=1e-10, sing_tol=1e-16, eps_prox=0.0,
        )  # fmt: skip
        if flag >= 1 and np.isfinite(found).all():
            return np.asarray(found) * scale, np.asarray(info["lam"]) / length
    raise NumericalFailure("quadratic_program", f"the quadratic program of a step was not solved (daqp says {flag})")


def _firm(H: np.ndarray) -> np.ndarray:
    """H of unit diagonal + the least ridge that makes it positive definite: it may be singular, or indefinite by rounding."""
    for ridge in RIDGES:
        firm = H + ridge * np.eye(len(H))
        try:
            cholesky(firm, lower=True)
            return firm
        except np.linalg.LinAlgError:
            continue
    return H + (RIDGES[-1] - 2 * min(float(np.linalg.eigvalsh(H)[0]), 0.0)) * np.eye(len(H))
