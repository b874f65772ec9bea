"""Noise bound, Lipschitz constants and the small-gain condition, from neighbouring samples.

After Fagiano & Novara, "Learning a nonlinear controller from data", IEEE TAC 61(7), 2016 (preprint arXiv:1309.1574). Two differences, with
reasons: quantiles stand where the paper takes a maximum (one outlier in 270,000 samples would set the bound), and neighbours come
from OTHER loops (consecutive samples share their smoothing and differ by one step: they say nothing about noise).
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree


@dataclass(frozen=True)
class Pairs:
    """Neighbouring samples: rows a, b of X, (K,) each, and their distance (K,) in standard deviations of the features."""

    a: np.ndarray
    b: np.ndarray
    distance: np.ndarray


def neighbour_pairs(X: np.ndarray, loop: np.ndarray, neighbours: int = 3) -> Pairs:
    """For each row of X (N, F) its nearest rows in other loops, each pair once."""
    a, b, d = [], [], []
    tree = cKDTree(X)
    distance, index = tree.query(X, k=min(X.shape[0], 16 * neighbours))
    rows = np.broadcast_to(np.arange(X.shape[0])[:, None], index.shape)
    other = loop[rows] != loop[index]
    rank = np.cumsum(other, axis=1)
    take = other & (rank <= neighbours)
    a, b, d = rows[take], index[take], distance[take]
    _, once = np.unique(np.stack([np.minimum(a, b), np.maximum(a, b)], axis=1), axis=0, return_index=True)
    return Pairs(a[once], b[once], d[once])


def estimate_bounds(u: np.ndarray, pairs: Pairs, quantile: float = 0.95) -> tuple[float, float]:
    """(eps [rad], gamma [rad per standard deviation]) of one surface u (N,).

    eps: half the difference of set-points between the closest pairs (a tenth of all), where the law itself can hardly
    have changed; gamma: the slope (|du| - 2 eps) / distance that the data force on any law consistent with eps.
    """
    if pairs.a.size == 0:
        return 0.0, 0.0
    du = np.abs(u[pairs.a] - u[pairs.b])
    close = pairs.distance <= np.quantile(pairs.distance, 0.1)
    eps = 0.5 * float(np.quantile(du[close], quantile))
    slope = np.maximum(du - 2 * eps, 0.0) / np.maximum(pairs.distance, 1e-9)
    return eps, float(np.quantile(slope, quantile))


def lipschitz_of_error(error: np.ndarray, pairs: Pairs, eps: float, quantile: float = 0.95) -> float:
    """Slope of the error (N,) of a fitted law between neighbours, beyond what noise eps explains [rad per standard deviation]."""
    if pairs.a.size == 0:
        return 0.0
    slope = np.maximum(np.abs(error[pairs.a] - error[pairs.b]) - 2 * eps, 0.0) / np.maximum(pairs.distance, 1e-9)
    return float(np.quantile(slope, quantile))


def small_gain(gamma_error: float, plant_gain: float | None) -> dict:
    """The fitted law keeps the loop stable if gamma_error * plant_gain < 1.

    plant_gain: how far the closed loop WITH THE TRUE controller moves the standardised features per rad of disturbance at the surface.
    It belongs to the plant and cannot be told from the controller's data alone: without it, the largest admissible one is reported.
    """
    admissible = float("inf") if gamma_error <= 0 else 1.0 / gamma_error
    holds = None if plant_gain is None else bool(plant_gain < admissible)
    return {
        "gamma_error": gamma_error,
        "admissible_plant_gain": admissible if np.isfinite(admissible) else None,
        "plant_gain": plant_gain,
        "holds": holds,
    }
