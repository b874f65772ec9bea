"""The greedy step: regressors in the order in which they explain most of what is left (orthogonal least squares)."""

import numpy as np


def greedy_order(
    phi: np.ndarray, always: np.ndarray, u: np.ndarray, preferred: np.ndarray, most: int, condition_limit: float
) -> np.ndarray:
    """Column numbers of phi (N, M), best first, at most `most`; `preferred` columns (the support of the convex step) come first.

    always: (N, A) regressors that are in the model anyway; u: (N, S). Chen, Billings & Luo, Int. J. Control 50(5), 1989: each candidate
    is kept orthogonal to those chosen, so its gain is exact. One whose remaining length is below 1/condition_limit of its own is
    (numerically) a sum of the chosen ones: taking it would cost more conditioning than it explains.
    """
    Q = np.linalg.qr(always)[0]
    length = np.sqrt((phi**2).sum(axis=0))
    P = phi / np.where(length > 0, length, 1.0)
    P, R = P - Q @ (Q.T @ P), u / np.maximum(u.std(axis=0), 1e-12)
    R = R - Q @ (Q.T @ R)
    chosen: list[int] = []
    pool = np.zeros(phi.shape[1], dtype=bool)
    pool[preferred] = True
    while len(chosen) < min(most, phi.shape[1]):
        norm = (P**2).sum(axis=0)
        usable = norm > (3.0 / condition_limit) ** 2
        gain = np.where(usable, ((P.T @ R) ** 2).sum(axis=1) / np.maximum(norm, 1e-300), -1.0)
        gain[chosen] = -1.0
        first = np.where(pool, gain, -1.0)
        j = int(first.argmax()) if first.max() > 0 else int(gain.argmax())
        if gain[j] <= 0:
            break
        chosen.append(j)
        q = P[:, j] / np.sqrt(norm[j])
        P, R = P - np.outer(q, q @ P), R - np.outer(q, q @ R)
    return np.array(chosen, dtype=int)
