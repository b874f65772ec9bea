"""What each segment knows: Gram matrices of whitened sensitivities and residuals, with the segment's own unknowns eliminated.

A segment k has unknowns of its own: its initial state z0 (nothing known beforehand) and the wind's error in short windows (known to be
small). Eliminating them exactly (Schur complement) is the same as weighting with R_k = R_y + S_x0 P0 S_x0' + S_w P_w S_w' with
P0 -> infinity, and costs a 50 x 50 factorisation instead of one of 4000 x 4000.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve


@dataclass(frozen=True)
class Information:
    """Reduced Gram matrices of [global columns, residual] per segment.

    H: (K, n, n) information on the global columns; b: (K, n) gradient J' r; cost: (K,) squared whitened residual that is left
    when the segment's own unknowns are at their best; dof: (K,) number of samples less number of own unknowns;
    back: per segment (factor, M_lg, M_lr) to recover the own unknowns for a change of the globals.
    """

    H: np.ndarray
    b: np.ndarray
    cost: np.ndarray
    dof: np.ndarray
    back: list

    def own(self, k: int, change: np.ndarray) -> np.ndarray:
        """The own unknowns of segment k that go with a change of the globals."""
        factor, M_lg, M_lr = self.back[k]
        return cho_solve(factor, M_lr - M_lg @ change)


def reduce(J: np.ndarray, r: np.ndarray, sigma: np.ndarray, n_own: int, own_prior: np.ndarray, own_value: np.ndarray) -> Information:
    """Eliminate the first n_own columns of every segment.

    J: (K, N, n_out, n_own + n) sensitivities; r: (K, N, n_out) whitened residual (0 where a sample does not count);
    sigma: (K, N, n_out), inf where it does not; own_prior: (n_own, n_own) prior precision of the own unknowns (0: nothing known), mean 0;
    own_value: (K, n_own) their present values.
    """
    K, N, n_out, columns = J.shape
    n = columns - n_own
    weight = np.where(np.isfinite(sigma), 1 / sigma, 0.0)
    H, b, cost, dof, back = np.zeros((K, n, n)), np.zeros((K, n)), np.zeros(K), np.zeros(K), []
    for k in range(K):
        W = J[k] * weight[k][:, :, None]
        A = np.empty((N * n_out, columns + 1))
        A[:, :columns] = W.reshape(-1, columns)
        A[:, columns] = r[k].reshape(-1)
        G = A.T @ A
        M = G[:n_own, :n_own] + own_prior
        # a own unknown that nothing depends on (a state that no output sees) must not make the factorisation fail
        M[np.diag_indices(n_own)] += 1e-12 * (1 + np.diag(M))
        factor = cho_factor(M)
        pull = own_prior @ own_value[k]
        M_lg, M_lr = G[:n_own, n_own:columns], G[:n_own, columns] - pull
        X = cho_solve(factor, np.column_stack([M_lg, M_lr]))
        H[k] = G[n_own:columns, n_own:columns] - M_lg.T @ X[:, :-1]
        b[k] = G[n_own:columns, columns] - M_lg.T @ X[:, -1]
        cost[k] = G[columns, columns] + own_value[k] @ pull - M_lr @ X[:, -1]
        dof[k] = np.count_nonzero(weight[k]) - np.count_nonzero(np.diag(own_prior) == 0)
        back.append((factor, M_lg, M_lr))
    return Information(H, b, cost, dof, back)
