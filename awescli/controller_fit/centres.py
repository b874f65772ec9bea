"""Where the Gaussians may sit: a space-filling subset of the states that were flown."""

import numpy as np


def thin(rows: np.ndarray, most: int) -> np.ndarray:
    """At most `most` of the sample numbers `rows`, evenly spread in time: the density of the flight is kept."""
    return rows if rows.size <= most else rows[np.linspace(0, rows.size - 1, most).astype(int)]


def farthest_points(X: np.ndarray, count: int) -> np.ndarray:
    """Row numbers of `count` points of X (N, F), each the farthest from those before it (Gonzalez 1985: a 2-approximation of the
    smallest covering radius). Deterministic: starts farthest from the mean. O(N count F)."""
    square = (X**2).sum(axis=1)
    chosen = [int(((X - X.mean(axis=0)) ** 2).sum(axis=1).argmax())]
    nearest = np.full(X.shape[0], np.inf)
    while len(chosen) < min(count, X.shape[0]):
        c = X[chosen[-1]]
        nearest = np.minimum(nearest, square - 2 * X @ c + c @ c)
        chosen.append(int(nearest.argmax()))
    return np.array(chosen)
