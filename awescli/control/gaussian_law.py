"""GaussianLaw: a sum of Gaussians of the standardised features plus an affine part: docs/equations.md (19)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from awescli.control.law import Law
from awescli.notation.scalars import Scalar, exp, select

LOWEST_EXPONENT = -50.0
"""exp(-50) = 2e-22: nothing beside 1, and far above the denormals that make a processor slow."""


@dataclass(frozen=True, kw_only=True)
class GaussianLaw(Law):
    """u_s = sum_i a_si exp(-|x - c_i|^2 / 2 w^2) + b_s0 + sum_j b_sj x_j.

    centres: (M, F); width: w, scalar, in standard deviations of the features; coefficients: a (S, M) [rad]; affine: b (S, 1 + F) [rad].
    """

    kind = "gaussian"

    centres: np.ndarray
    width: float
    coefficients: np.ndarray
    affine: np.ndarray

    def _exponents(self) -> tuple[np.ndarray, np.ndarray, float]:
        # |x - c|^2 / 2w^2 = (|x|^2 - 2 c.x + |c|^2) / 2w^2: one product and one sum per feature and centre instead of three
        g = 1.0 / (2.0 * float(self.width) ** 2)
        return 2.0 * g * self.centres, -g * (self.centres**2).sum(axis=1), g

    def outputs(self, x: Sequence[Scalar]) -> tuple[Scalar, Scalar]:
        slope, offset, g = self._exponents()
        slope, offset = slope.tolist(), offset.tolist()
        common = sum((xj * xj for xj in x), 0.0) * (-g)
        phi = []
        for row, constant in zip(slope, offset, strict=True):
            e = common + constant
            for cj, xj in zip(row, x, strict=True):
                e = e + cj * xj
            phi.append(exp(select(e - LOWEST_EXPONENT, e, LOWEST_EXPONENT)))
        result = []
        for a, b in zip(self.coefficients.tolist(), self.affine.tolist(), strict=True):
            y = b[0]
            for bj, xj in zip(b[1:], x, strict=True):
                y = y + bj * xj
            for ai, p in zip(a, phi, strict=True):
                y = y + ai * p
            result.append(y)
        return tuple(result)

    def outputs_of_matrix(self, X: np.ndarray) -> np.ndarray:
        return design(X, self.centres, self.width) @ np.concatenate([self.coefficients, self.affine], axis=1).T

    def own_arrays(self) -> dict[str, np.ndarray]:
        return {"centres": self.centres, "width": np.array(self.width), "coefficients": self.coefficients, "affine": self.affine}


def design(X: np.ndarray, centres: np.ndarray, width: float) -> np.ndarray:
    """Regressors (N, M + 1 + F) of a GaussianLaw at standardised features X (N, F): Gaussians, one, features."""
    g = 1.0 / (2.0 * float(width) ** 2)
    e = X @ (2.0 * g * centres.T) - g * (centres**2).sum(axis=1) - g * (X**2).sum(axis=1)[:, None]
    return np.concatenate([np.exp(np.maximum(e, LOWEST_EXPONENT)), np.ones((X.shape[0], 1)), X], axis=1)
