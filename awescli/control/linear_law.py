"""LinearLaw: an affine map of the standardised features; the baseline every other law must beat."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from awescli.control.law import Law
from awescli.notation.scalars import Scalar


@dataclass(frozen=True, kw_only=True)
class LinearLaw(Law):
    """u_s = b_s0 + sum_j b_sj x_j; affine: b (S, 1 + F) [rad]."""

    kind = "linear"

    affine: np.ndarray

    def outputs(self, x: Sequence[Scalar]) -> tuple[Scalar, ...]:
        result = []
        for b in self.affine.tolist():
            y = b[0]
            for bj, xj in zip(b[1:], x, strict=True):
                y = y + bj * xj
            result.append(y)
        return tuple(result)

    def outputs_of_matrix(self, X: np.ndarray) -> np.ndarray:
        return self.affine[:, 0] + X @ self.affine[:, 1:].T

    def own_arrays(self) -> dict[str, np.ndarray]:
        return {"affine": self.affine}
