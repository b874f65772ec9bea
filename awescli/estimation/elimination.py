"""Unknowns eliminated from Gram matrices, many matrices abreast: what is left without them, and what gives them back."""

from dataclasses import dataclass

import numpy as np

RIDGE = 1e-12
"""Of the diagonal: what rounding asks for where an unknown is hardly seen."""


@dataclass(frozen=True)
class Eliminated:
    """Unknowns v (K, a) eliminated from Gram matrices of [v, x, y]: v = M^-1 (r - X x - Y p), M = C C'. C: (K, a, a); X: (K, a, x) and Y:
    (K, a, n + 1) with y = [p, r], both divided by C."""

    C: np.ndarray
    X: np.ndarray
    Y: np.ndarray

    def solve(self, x: np.ndarray, change: np.ndarray, mean: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """(K, a, c) v for c cases: x (K, x, c), change of the globals (n, c), mean (c,) 1 where the residual counts, noise (K, a, c)."""
        inside = noise + self.Y[..., -1:] * mean - np.matmul(self.Y[..., :-1], change) - np.matmul(self.X, x[..., : self.X.shape[-1], :])
        return np.linalg.solve(self.C.swapaxes(-1, -2), inside)

    @property
    def log_det(self) -> np.ndarray:
        """(K,) log det M"""
        return 2 * np.log(np.diagonal(self.C, axis1=-2, axis2=-1)).sum(axis=-1)


def eliminate_first(M: np.ndarray, cross: np.ndarray, rest: np.ndarray, n_x: int) -> tuple[Eliminated, np.ndarray]:
    """(what gives v back, Gram matrices of the rest without v) for Gram matrices M (K, a, a) of v, cross (K, a, b) and rest (K, b, b); of
    the rest, the first n_x are x and the others y."""
    C = firm_cholesky(M)
    # dividing by C with one factorisation for all: C is small, and well scaled by its ridge
    Y = np.matmul(np.linalg.inv(C), cross) if C.shape[-1] else cross
    return Eliminated(C, Y[..., :n_x], Y[..., n_x:]), rest - np.matmul(Y.swapaxes(-1, -2), Y)


def firm_cholesky(M: np.ndarray) -> np.ndarray:
    """Factors C C' of M (K, a, a) with the least ridge on the diagonal that makes them exist."""
    if not M.shape[-1]:
        return M
    diagonal = np.einsum("...ii->...i", M)
    ridge = RIDGE * (1 + diagonal)
    for _ in range(6):
        try:
            firm = M + ridge[..., None] * np.eye(M.shape[-1])
            return np.linalg.cholesky(firm)
        except np.linalg.LinAlgError:
            ridge = 100 * ridge
    return np.linalg.cholesky(np.where(np.eye(M.shape[-1]) > 0, np.abs(M) + 1.0, 0.0))
