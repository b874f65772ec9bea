"""The convex step: the smallest coefficients, in l1, that explain the set-points within the noise bound.

    min |a|_1 + penalty sum(s)   s.t.   |u - Phi a - A b| <= alpha eps + s,   |e_i - e_j| <= gamma_error d_ij + 2 eps + s_ij

e = u - Phi a - A b. After Fagiano & Novara 2016 (see controller_bounds). The affine part b is free: it is no basis function to be
thrifty with. The slacks s >= 0 keep the program feasible when a quantile, not a maximum, stands for the bound.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import bmat, csr_matrix, identity

from awescli.controller_fit.bounds import Pairs

PENALTY = 100.0
"""Price of a slack, where a coefficient of the same size costs 1: errors come first."""


@dataclass(frozen=True)
class SparseSolution:
    """coefficients a (M,), affine b (A,), the worst error beyond the bound [rad], how many samples exceed it, and the solver's word."""

    coefficients: np.ndarray
    affine: np.ndarray
    worst_slack: float
    exceeding: float
    status: str

    @property
    def solved(self) -> bool:
        """Whether there is a solution; without one the law is zero."""
        return bool(np.isfinite(self.exceeding))


def sparse_coefficients(phi: np.ndarray, affine: np.ndarray, u: np.ndarray, bound: float, pairs: Pairs, gamma_error: float, eps: float,
                        penalty: np.ndarray | float = PENALTY, time_limit: float = 4.0) -> SparseSolution:  # fmt: skip
    """Solve the program with HiGHS. phi (N, M), affine (N, A), u (N,) [rad], bound = alpha eps [rad]; pairs index the same N rows; penalty:
    price of the slack of each row (N,)."""
    n, m, k = u.size, phi.shape[1], pairs.a.size
    scale = max(float(np.std(u)), 1e-12)
    rows, columns, values = np.repeat(np.arange(k), 2), np.stack([pairs.a, pairs.b], axis=1).ravel(), np.tile([1.0, -1.0], k)
    D = csr_matrix((values, (rows, columns)), shape=(k, n))
    G, V = np.concatenate([phi, affine], axis=1), u / scale
    room = np.full(n, bound / scale)
    if k:
        G, V = np.concatenate([G, D @ G]), np.concatenate([V, D @ V])
        room = np.concatenate([room, (gamma_error * pairs.distance + 2 * eps) / scale])
    B, E = csr_matrix(np.concatenate([G[:, :m], -G[:, :m], G[:, m:]], axis=1)), identity(V.size, format="csr")
    inequality = bmat([[-B, -E], [B, -E]], format="csr")
    price = np.concatenate([np.ones(2 * m), np.zeros(affine.shape[1]), np.broadcast_to(penalty, n), np.full(k, PENALTY)])
    limits = [(0, None)] * (2 * m) + [(None, None)] * affine.shape[1] + [(0, None)] * V.size
    # the simplex ends at a vertex: as few coefficients as the program needs, where an interior point would leave many small ones
    answer = linprog(
        price,
        A_ub=inequality,
        b_ub=np.concatenate([room - V, room + V]),
        bounds=limits,
        method="highs-ds",
        options={"time_limit": time_limit},
    )
    if answer.x is None:
        return SparseSolution(np.zeros(m), np.zeros(affine.shape[1]), float("nan"), float("nan"), answer.message)
    a, b, slack = answer.x[:m] - answer.x[m : 2 * m], answer.x[2 * m : 2 * m + affine.shape[1]], answer.x[2 * m + affine.shape[1] :][:n]
    return SparseSolution(a * scale, b * scale, float(slack.max() * scale), float((slack > 1e-9).mean()), answer.message)
