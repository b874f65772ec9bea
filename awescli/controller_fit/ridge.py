"""Ridge regression on any number of samples in little memory, and its conditioning."""

from collections.abc import Iterable

import numpy as np


def affine_design(X: np.ndarray) -> np.ndarray:
    """[1, X], (N, 1 + F)."""
    return np.concatenate([np.ones((X.shape[0], 1)), X], axis=1)


def triangle(blocks: Iterable[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, int]:
    """R of the QR factorisation of [A | u], A and u given in blocks of rows (N_b, M), (N_b, S); and the number of rows.

    Tall-and-skinny QR: the next block is stacked under the R so far. Unlike A^T A it does not square the condition number.
    """
    R, n = np.zeros((0, 0)), 0
    for A, u in blocks:
        stacked = np.concatenate([A, u], axis=1)
        R = np.asarray(np.linalg.qr(np.concatenate([R, stacked]) if n else stacked, mode="r"))
        n += A.shape[0]
    return R, n


def solve_ridge(R: np.ndarray, outputs: int, ridge: float) -> tuple[np.ndarray, dict]:
    """(coefficients (M, S), conditioning) from the triangle of [A | u].

    Columns are scaled to length one; `ridge` is relative to the largest singular value of the scaled A, so that the condition number of
    the regression actually solved, [A; ridge I], is about 1 / ridge. `condition_raw` is that of A alone.
    """
    A, u = R[:, :-outputs], R[:, -outputs:]
    length = np.sqrt((A**2).sum(axis=0))
    length = np.where(length > 0, length, 1.0)
    U, s, Vt = np.linalg.svd(A / length, full_matrices=False)
    t = ridge * s[0]
    x = Vt.T @ ((s / (s**2 + t**2))[:, None] * (U.T @ u))
    raw = float(s[0] / s[-1]) if s[-1] > 0 else float("inf")
    return x / length[:, None], {
        "condition": float(np.sqrt((s[0] ** 2 + t**2) / (s[-1] ** 2 + t**2))),
        "condition_raw": raw,
        "ridge": ridge,
    }


def well_conditioned(always: np.ndarray, more: np.ndarray, limit: float) -> int:
    """How many leading columns of `more` (N, M) may join `always` (N, A) before the condition number of all, columns scaled to length
    one, exceeds `limit`. It grows with every column (singular values interlace), so halving the interval finds the count."""
    R = np.linalg.qr(np.concatenate([always, more], axis=1), mode="r")
    R, fixed = R / np.maximum(np.sqrt((R**2).sum(axis=0)), 1e-300), always.shape[1]
    fewest, most = 0, more.shape[1]
    while fewest < most:
        middle = (fewest + most + 1) // 2
        s = np.linalg.svd(R[: fixed + middle, : fixed + middle], compute_uv=False)
        fewest, most = (middle, most) if s[0] <= limit * s[-1] else (fewest, middle - 1)
    return fewest
