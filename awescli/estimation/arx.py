"""ARX: every output's change over a step as a linear function of past outputs and inputs (Ljung, System Identification, ch. 4.2 and 10.1).

    y[k] - y[k - s] = W . [seen(y[k - s]), ..., seen(y[k - n s]), mean of u over each of these n steps, 1]

Arrays only: nothing here knows a flight. Written here because the whole of it is a ridge regression and one loop, and packages of subspace
and ARX methods (SIPPY, nfoursid) take one record without gaps and choose no order by its error several steps ahead.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

Seen = Callable[[np.ndarray], np.ndarray]
"""Outputs (..., n_y) -> what of them the regression sees (..., n_f)."""
ENOUGH = 20_000
"""Rows of a regression: of a longer record evenly many, 100 a regressor, so that hours ask for no more memory than minutes."""
SINGULAR = 1e-12
"""Eigenvalues of the regressors' correlation matrix below this share of the largest are not there: such combinations get no weight."""


def as_they_are(y: np.ndarray) -> np.ndarray:
    return y


@dataclass(frozen=True)
class Arx:
    """order: n; step: s, in samples; weights: (..., n_r, n_y), regressors in the order of the equation above; leading axes: several
    models at once; seen: what is regressed on."""

    order: int
    step: int
    weights: np.ndarray
    seen: Seen = as_they_are

    @property
    def history(self) -> int:
        """Samples that must be known before the first that is predicted."""
        return self.order * self.step

    def simulate(self, known: np.ndarray, u: np.ndarray) -> np.ndarray:
        """(..., K, N, n_y) outputs of the N samples behind what is known.

        known: (..., K, history, n_y) outputs; u: (K, history + N, n_u) inputs, each held from its sample to the next, so that the last is
        not used. Nothing stops an unstable model: its numbers grow, at last to inf and nan.
        """
        s, H = self.step, self.history
        N = u.shape[1] - H
        blocks = -(-N // s)
        padded = np.concatenate([u, np.repeat(u[:, -1:], blocks * s - N, axis=1)], axis=1)
        forced = _forcing(padded, self.order, s)[:, H:]
        lead = np.broadcast_shapes(known.shape[:-3], self.weights.shape[:-2])
        y = np.empty((*lead, u.shape[0], H + blocks * s, known.shape[-1]))
        y[..., :H, :] = known
        felt = [self.seen(y[..., H - (i + 1) * s : H - i * s, :]) for i in range(self.order)]
        weights = self.weights[..., None, :, :]
        with np.errstate(over="ignore", invalid="ignore"):
            for b in range(blocks):
                at, ahead = slice(b * s, (b + 1) * s), slice(H + b * s, H + (b + 1) * s)
                held = np.broadcast_to(forced[:, at], (*felt[0].shape[:-1], forced.shape[-1]))
                y[..., ahead, :] = y[..., H + (b - 1) * s : H + b * s, :] + np.concatenate([*felt, held], axis=-1) @ weights
                felt = [self.seen(y[..., ahead, :]), *felt[:-1]]
        return y[..., H : H + N, :]


def fitted(
    y: np.ndarray, u: np.ndarray, usable: np.ndarray, order: int, step: int, ridges: tuple[float, ...], seen: Seen = as_they_are
) -> Arx | None:
    """Least squares on one-step errors, with a penalty on the weights of normalised regressors: one model for every ridge.

    y: (N, n_y); u: (N, n_u); usable: (N,) bool, the samples that may be used: a row of the regression whose lags reach over another is left
    out. None where fewer rows than regressors are left. Columns that do not move get no weight.
    """
    rows = _whole(usable, order * step)
    rows = rows[:: max(1, -(-len(rows) // ENOUGH))]
    F, sums = seen(y), np.concatenate([np.zeros((1, u.shape[1])), np.cumsum(u, axis=0)])
    lagged = [F[rows - (i + 1) * step] for i in range(order)]
    held = [(sums[rows - i * step] - sums[rows - (i + 1) * step]) / step for i in range(order)]
    X, Y, still = np.concatenate([*lagged, *held], axis=1), y[rows] - y[rows - step], 1e-9
    if len(rows) <= X.shape[1]:
        return None
    (mx, sx), (my, sy) = ((a.mean(axis=0), a.std(axis=0)) for a in (X, Y))
    sx, sy = np.where(sx > still * (1 + np.abs(mx)), sx, np.inf), np.where(sy > 0, sy, 1.0)
    Z, T = (X - mx) / sx, (Y - my) / sy
    values, V = np.linalg.eigh(Z.T @ Z / len(Z))
    moment = V.T @ (Z.T @ T / len(Z))
    present = values > SINGULAR * values[-1]
    inverse = np.stack([np.where(present, 1 / np.where(present, values + ridge, 1.0), 0.0) for ridge in ridges])
    slopes = (V @ (inverse[:, :, None] * moment)) * sy / sx[:, None]
    return Arx(order, step, np.concatenate([slopes, (my - mx @ slopes)[:, None]], axis=1), seen)


def each(models: Arx) -> Iterator[Arx]:
    """The models of several ridges one by one."""
    yield from (Arx(models.order, models.step, w, models.seen) for w in models.weights)


def _forcing(u: np.ndarray, order: int, step: int) -> np.ndarray:
    """(K, N, order * n_u + 1): at each sample the means of u (K, N, n_u) over the last `order` steps before it, newest first, and 1. What
    lies before the first sample counts as the first."""
    sums = np.cumsum(np.concatenate([np.repeat(u[:, :1], order * step, axis=1), u], axis=1), axis=1)
    sums = np.concatenate([np.zeros_like(sums[:, :1]), sums], axis=1)
    N, first = u.shape[1], order * step
    means = [(sums[:, (a := first - i * step) : a + N] - sums[:, (b := a - step) : b + N]) / step for i in range(order)]
    return np.concatenate([*means, np.ones((*u.shape[:2], 1))], axis=-1)


def _whole(usable: np.ndarray, before: int) -> np.ndarray:
    """Samples (M,) that are usable, as are the `before` ones in front of them."""
    bad = np.concatenate([[0], np.cumsum(~usable)])
    rows = np.arange(before, len(usable))
    return rows[bad[rows + 1] == bad[rows - before]]
