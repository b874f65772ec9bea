"""Noise bound, Lipschitz constants and the small-gain condition, from neighbouring samples.

After Fagiano & Novara, "Learning a nonlinear controller from data", IEEE TAC 61(7), 2016 (preprint "Identification of nonlinear
controllers from data: theory and computation", arXiv:1309.1574v1). What was checked against the preprint's own text is its setting
(sections 1 and 2): a system in discrete time with one input, flown by an unknown controller, a static law u = kappa(y) from a compact Y
into U = [lower, upper] of feedback variables that the designer chooses among candidates; disturbances, neglected dynamics and the error of
that choice within a compact set; the system (assumption 1) and the closed loop Lipschitz continuous. The rest could not be read, so its
constants (radius of the neighbourhoods, alpha, the order of its algorithms) are NOT its own here: the convex step is the outline's, and of
Novara's combined relaxed-greedy algorithm (ACC 2011) only the introduction was seen: relax to l1, then greedy; when the answer is sparsest
can be verified for any basis. Two differences are meant: quantiles stand where a maximum would (one outlier in 270,000 samples would set
the bound), and neighbours come from OTHER loops (consecutive samples share their smoothing and differ by one step: they say nothing about
noise).
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


def small_gain(gamma_error: float, plant_gain: float | None) -> dict:
    """The fitted law keeps the loop stable if gamma_error * plant_gain < 1.

    plant_gain: how far the closed loop moves the standardised features per rad of disturbance at the surface, None where it is unknown. The
    condition asks for the loop with the TRUE controller; what can be flown is the declared kite with the fitted one
    (simulation.survival.loop_gain), a lower bound at that: `holds` is evidence, no proof. The largest admissible gain stands beside it.
    """
    admissible = float("inf") if gamma_error <= 0 else 1.0 / gamma_error
    holds = None if plant_gain is None else bool(plant_gain < admissible)
    return {
        "gamma_error": gamma_error,
        "admissible_plant_gain": admissible if np.isfinite(admissible) else None,
        "plant_gain": plant_gain,
        "holds": holds,
    }
