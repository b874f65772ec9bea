"""NetworkLaw: a small tanh network beside an affine part; trained elsewhere, evaluated here as plain scalar loops."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from awescli.control.law import Law
from awescli.notation.scalars import Scalar, tanh


@dataclass(frozen=True, kw_only=True)
class NetworkLaw(Law):
    """u = b_0 + B x + W_3 tanh(W_2 tanh(W_1 x + b_1) + b_2), in rad.

    affine: (S, 1 + F); weights_1: (H, F), bias_1: (H,); weights_2: (G, H), bias_2: (G,); weights_3: (S, G).
    """

    kind = "network"

    affine: np.ndarray
    weights_1: np.ndarray
    bias_1: np.ndarray
    weights_2: np.ndarray
    bias_2: np.ndarray
    weights_3: np.ndarray

    def outputs(self, x: Sequence[Scalar]) -> tuple[Scalar, Scalar]:
        h = [tanh(y) for y in _layer(self.weights_1, self.bias_1, x)]
        h = [tanh(y) for y in _layer(self.weights_2, self.bias_2, h)]
        return tuple(a + b for a, b in zip(_layer(self.weights_3, np.zeros(len(self.weights_3)), h),
                                           _layer(self.affine[:, 1:], self.affine[:, 0], x), strict=True))  # fmt: skip

    def outputs_of_matrix(self, X: np.ndarray) -> np.ndarray:
        h = np.tanh(np.tanh(X @ self.weights_1.T + self.bias_1) @ self.weights_2.T + self.bias_2)
        return h @ self.weights_3.T + self.affine[:, 0] + X @ self.affine[:, 1:].T

    def own_arrays(self) -> dict[str, np.ndarray]:
        names = ("affine", "weights_1", "bias_1", "weights_2", "bias_2", "weights_3")
        return {name: getattr(self, name) for name in names}


def _layer(weights: np.ndarray, bias: np.ndarray, x: Sequence[Scalar]) -> list:
    """W x + b, one scalar per row."""
    result = []
    for row, y in zip(weights.tolist(), bias.tolist(), strict=True):
        for w, xi in zip(row, x, strict=True):
            y = y + w * xi
        result.append(y)
    return result
