"""The regression problem of a controller fit, and how a choice is scored: held-out loops, then unseen flight, with noisy states."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from awescli.controller_fit.centres import thin
from awescli.controller_fit.ridge import solve_ridge, triangle
from awescli.controller_fit.samples import Samples, feature_matrix, loop_folds, standardisation

EARLY = 0.6
"""Share of the train part, its earliest, that has to predict the latest known flight: further ahead than the test part is."""
BLOCK = 20_000
"""Rows handled at once where all samples are used: 20,000 x 90 doubles are 15 MB."""


@dataclass(frozen=True)
class Problem:
    """Standardised features of one flight, as smoothed (fitted) and as measured (scored), and the set-points.

    X, M: (N, F) smoothed and measured features; U: (N, S) [rad]; span: (S,) max - min of U in train and validation [rad];
    rows: (n,) at most `most` train rows, evenly thinned; fold: (n,) fold of each; early: (n,) bool, in the first EARLY of the train part;
    ahead: (m,) thinned rows to be predicted: `unseen` (m,) bool those of the validation part, `late` (m,) bool the latest known ones, as
    many (where loops are dealt in the order of time these are the same);
    train: all train rows; everything: (K,) all train and validation rows; loop: (N,).
    """

    features: tuple[str, ...]
    centre: tuple[float, ...]
    scale: tuple[float, ...]
    X: np.ndarray
    M: np.ndarray
    U: np.ndarray
    span: np.ndarray
    rows: np.ndarray
    fold: np.ndarray
    early: np.ndarray
    ahead: np.ndarray
    unseen: np.ndarray
    late: np.ndarray
    train: np.ndarray
    everything: np.ndarray
    loop: np.ndarray


def pose(samples: Samples, features: tuple[str, ...], folds: int, most: int) -> Problem:
    """The problem of fitting `features` of `samples`."""
    centre, scale = standardisation(samples.smoothed, features, samples.pattern, samples.train)
    X = feature_matrix(samples.smoothed, features, samples.pattern, centre, scale)
    M = X if samples.measured is samples.smoothed else feature_matrix(samples.measured, features, samples.pattern, centre, scale)
    rows = thin(np.flatnonzero(samples.train), most)
    known = samples.train | samples.validation
    early = np.arange(rows.size) < EARLY * rows.size
    after = np.flatnonzero(known)
    after = after[after > rows[early].max(initial=-1)]
    unseen = thin(np.flatnonzero(samples.validation), most // 2)
    late = thin(after[after.size - min(int(samples.validation.sum()), after.size) :], most // 2)
    ahead = np.union1d(unseen, late)
    return Problem(
        features, centre, scale, X, M, samples.set_points, np.ptp(samples.set_points[known], axis=0), rows,
        loop_folds(samples.loop[rows], folds), early, ahead, np.isin(ahead, unseen), np.isin(ahead, late), np.flatnonzero(samples.train),
        np.flatnonzero(known), samples.loop,
    )  # fmt: skip


@dataclass(frozen=True)
class Score:
    """NRMSE on held-out loops (cv), on the validation part (ahead) and on the latest known flight from the early train part alone (far),
    None without one; all with measured states, mean over surfaces."""

    cv: float
    ahead: float | None
    far: float | None

    @property
    def value(self) -> float:
        """What choices are made by: all count alike. A line that reels out makes of every unseen loop one beyond the known ones, and laws
        that fit alike between them differ by a factor of ten beyond: `far` tells them apart before the test part does."""
        known = [e for e in (self.cv, self.ahead, self.far) if e is not None]
        return float(np.sqrt(np.mean(np.square(known))))

    def row(self) -> dict:
        """As plain numbers for the report."""
        return {"score": self.value, "cv_nrmse": self.cv, "ahead_nrmse": self.ahead, "far_nrmse": self.far}


def score_linear(
    problem: Problem, smoothed: np.ndarray, measured: np.ndarray, ahead: np.ndarray, ridges: Sequence[float], U: np.ndarray | None = None,
    extra: tuple[np.ndarray, np.ndarray] | None = None,
) -> dict[float, Score]:  # fmt: skip
    """Score of the regression on given regressors for each ridge.

    smoothed, measured: regressors (n, M) at problem.rows; ahead: (m, M) measured regressors at problem.ahead;
    U: (N, S), default the set-points;
    extra: (A, u) rows that every fit gets beside its samples, and no score counts.
    """
    U = problem.U if U is None else U
    u, v = U[problem.rows], U[problem.ahead]
    folds = [problem.fold == f for f in np.unique(problem.fold)]
    parts = [triangle([(smoothed[f], u[f])])[0] for f in folds]
    always = [] if extra is None else [triangle([extra])[0]]
    left_out = [_joined(always + parts[:i] + parts[i + 1 :]) for i in range(len(parts))]
    whole = _joined(always + parts)
    early = _joined(always + [triangle([(smoothed[problem.early], u[problem.early])])[0]])
    n_u = u.shape[1]
    result = {}
    for ridge in ridges:
        missed = [measured[f] @ solve_ridge(R, n_u, ridge)[0] - u[f] for f, R in zip(folds, left_out, strict=True)]
        asked = ((whole, problem.unseen), (early, problem.late))
        beyond = [(ahead @ solve_ridge(R, n_u, ridge)[0] - v)[rows] if rows.any() else None for R, rows in asked]
        ahead_, far = (None if e is None else span_error(e, problem.span) for e in beyond)
        result[ridge] = Score(span_error(np.concatenate(missed), problem.span), ahead_, far)
    return result


def _joined(triangles: list[np.ndarray]) -> np.ndarray:
    """R of all the rows that went into several triangles."""
    return np.asarray(np.linalg.qr(np.concatenate(triangles), mode="r"))


def span_error(error: np.ndarray, span: np.ndarray) -> float:
    """Mean over surfaces of the RMS of error (n, S) over span (S,)."""
    return float(np.mean(np.sqrt((error**2).mean(axis=0)) / span))


def blocks(rows: np.ndarray) -> Iterator[np.ndarray]:
    """`rows` in pieces of BLOCK."""
    return (rows[i : i + BLOCK] for i in range(0, rows.size, BLOCK))


def fit_on_everything(
    problem: Problem, regressors: Callable, ridge: float, rows: np.ndarray | None = None, extra: tuple[np.ndarray, np.ndarray] | None = None
) -> tuple[np.ndarray, dict]:
    """(coefficients (M, S), conditioning) of the ridge regression on all train and validation samples, smoothed states.

    regressors: X (n, F) -> (n, M); extra: (A, u) rows beside the samples. However long the flight, memory holds one block.
    """
    rows = problem.everything if rows is None else rows
    R, count = triangle((regressors(problem.X[part]), problem.U[part]) for part in blocks(rows))
    if extra is not None:
        R, _ = triangle([(R[:, : -problem.U.shape[1]], R[:, -problem.U.shape[1] :]), extra])
    coefficients, conditioning = solve_ridge(R, problem.U.shape[1], ridge)
    return coefficients, conditioning | {"samples": count}
