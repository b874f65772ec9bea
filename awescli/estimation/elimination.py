"""Unknowns eliminated from Gram matrices, many matrices abreast: what is left without them, and what gives them back."""

from dataclasses import dataclass

import numpy as np

RIDGE = 1e-12
"""Of the diagonal: what rounding asks for where an unknown is hardly seen."""
HARDER, TRIES = 100.0, 6
"""Times what was tried before where that is not enough, and how often."""


@dataclass(frozen=True)
class Eliminated:
    """Unknowns v (..., a) eliminated from Gram matrices of [v, x, y]: v = M^-1 (r - X x - Y p), M = C C'.

    inverse: (..., a, a) of C; X: (..., a, x) and Y: (..., a, n + 1) with y = [p, r], both divided by C.
    """

    inverse: np.ndarray
    X: np.ndarray
    Y: np.ndarray

    def solve(self, x: np.ndarray, change: np.ndarray, mean: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """(..., a, c) v for c cases: x (..., x, c), change of the globals (n, c), mean (c,) 1 where the residual counts, noise (..., a,
        c)."""
        return self.apart(change, mean, noise) + np.matmul(self.gain, x[..., : self.X.shape[-1], :])

    def apart(self, change: np.ndarray, mean: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """(..., a, c) what `solve` gives back where x is zero."""
        inside = noise + self.Y[..., -1:] * mean - np.matmul(self.Y[..., :-1], change)
        return np.matmul(self.inverse.swapaxes(-1, -2), inside)

    @property
    def gain(self) -> np.ndarray:
        """(..., a, x) of v to x."""
        return -np.matmul(self.inverse.swapaxes(-1, -2), self.X)

    @property
    def covariance(self) -> np.ndarray:
        """(..., a, a) of v, the others held."""
        return np.matmul(self.inverse.swapaxes(-1, -2), self.inverse)

    @property
    def log_det(self) -> np.ndarray:
        """(...) log det M"""
        return -2 * np.log(np.diagonal(self.inverse, axis1=-2, axis2=-1)).sum(axis=-1)


def eliminate_first(M: np.ndarray, cross: np.ndarray, rest: np.ndarray, n_x: int) -> tuple[Eliminated, np.ndarray]:
    """(what gives v back, Gram matrices of the rest without v) for Gram matrices M (..., a, a) of v, cross (..., a, b) and rest (..., b,
    b); of the rest, the first n_x are x and the others y."""
    inverse = inverse_root(M)
    Y = np.matmul(inverse, cross)
    return Eliminated(inverse, Y[..., :n_x], Y[..., n_x:]), rest - np.matmul(Y.swapaxes(-1, -2), Y)


def inverse_root(M: np.ndarray) -> np.ndarray:
    """C^-1 (..., a, a) of M = C C', with the least ridge on the diagonal that makes it exist: dividing by C takes one factorisation then,
    and C is small, and well scaled by its ridge."""
    return np.linalg.inv(firm_cholesky(M))


def firm_cholesky(M: np.ndarray) -> np.ndarray:
    """Factors C C' of M (..., a, a) with the least ridge on the diagonal that makes them exist."""
    if not M.shape[-1]:
        return M
    firm = M.copy()
    diagonal = np.einsum("...ii->...i", firm)
    ridge = RIDGE * (1 + diagonal)
    for _ in range(TRIES):
        try:
            diagonal += ridge
            return np.linalg.cholesky(firm)
        except np.linalg.LinAlgError:
            ridge = HARDER * ridge
    return np.linalg.cholesky(np.where(np.eye(M.shape[-1]) > 0, np.abs(M) + 1.0, 0.0))
