"""Noise bound and Lipschitz constants from neighbouring samples.

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
from scipy.spatial import KDTree


@dataclass(frozen=True)
class Pairs:
    """Neighbouring samples: rows a, b of X, (K,) each, and their distance (K,) in standard deviations of the features."""

    a: np.ndarray
    b: np.ndarray
    distance: np.ndarray


def neighbour_pairs(X: np.ndarray, loop: np.ndarray, neighbours: int = 3) -> Pairs:
    """For each row of X (N, F) its nearest rows in other loops, each pair once."""
    a, b, d = [], [], []
    tree = KDTree(X)
    distance, index = (np.asarray(found) for found in tree.query(X, k=min(X.shape[0], 16 * neighbours)))
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


def error_bounds(errors: np.ndarray, pairs: Pairs) -> list[dict]:
    """`estimate_bounds` of what a law leaves, errors (N, S), per surface: noise bound and slope of the error between neighbours.

    The small-gain condition of the paper multiplies this slope with the gain of the loop that the TRUE controller closes. Neither is known
    of a flight: the slope is a quantile over the states that were flown, the gain a lower bound found by trying, with the fitted law, of a
    kite that may be declared wrongly. Their product said `holds` of a law that departs and denied it of one that flies, so it is not said:
    whether a law keeps the kite in the air, and how much of its gain may be missing, is measured (simulation.survival).
    """
    return [{"eps_error": eps, "gamma_error": gamma} for eps, gamma in (estimate_bounds(e, pairs) for e in errors.T)]
