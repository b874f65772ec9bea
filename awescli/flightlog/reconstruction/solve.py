"""One identity solved: levels of noise, then its shapes with covariance, and whether all stretches of the flight say the same."""

from dataclasses import dataclass, replace

import numpy as np

from awescli.flightlog.reconstruction.gauss_markov import BandedLikelihood, Estimate, Series
from awescli.flightlog.reconstruction.identities import DELAYS, Identity
from awescli.flightlog.reconstruction.levels import Levels, estimate_levels
from awescli.notation.present import present

ENOUGH = 2000
"""Samples from which levels are estimated, evenly thinned: white noise stays what it is, and 2000 tell it to 1.6 %."""
MOST = 10_000
"""Samples from which shapes are estimated, thinned alike."""
OUTLIER, FEW = 6.0, 0.02
"""Samples so many standard deviations away do not count, as long as they are no more than this share."""
PARTS = 6
"""Stretches that are solved for themselves."""
ABSENT = 0.02
"""Of a drift's level, that stands for none: nothing at all would be singular."""


@dataclass(frozen=True)
class Solution:
    """levels; values and standard deviations of the shapes, and of what the identity asks beside them, by name; scatter: by how much
    stretches of the flight differ more than they may (a factor that is in the deviation, 1 where they agree); gain: law -> what the
    deviance would lose without it."""

    identity: Identity
    levels: Levels
    values: dict[str, float]
    std: dict[str, float]
    scatter: dict[str, float]
    gain: dict[str, float]


def solve(identity: Identity) -> Solution:
    """Levels and shapes of an identity. Raises NumericalFailure."""
    series = without_outliers(identity, thinned(identity.series, MOST))
    thin = thinned(series, ENOUGH)
    coarse = BandedLikelihood(thin)
    levels = estimate_levels(coarse, identity.white, identity.laws, identity.known)
    gain = {}
    for i, law in enumerate(levels.laws):
        if law.walks:
            continue
        without = [*levels.laws[:i], replace(law, level=ABSENT * law.level), *levels.laws[i + 1 :]]
        gain[law.name] = coarse.at(levels.white, without).deviance - coarse.at(levels.white, levels.laws).deviance
    whole = BandedLikelihood(series).at(levels.white, levels.laws)
    names, F = _asked(identity, whole)
    scatter = _scatter(series, levels, whole, F)
    std = scatter * np.sqrt(np.einsum("fk,kl,fl->f", F, whole.covariance, F))
    values, std, scatter = (dict(zip(names, x.tolist(), strict=True)) for x in (F @ whole.beta, std, scatter))
    return Solution(identity, levels, values, std, scatter, gain)


def _asked(identity: Identity, whole: Estimate) -> tuple[tuple[str, ...], np.ndarray]:
    """(names, (f, k) weights of the shapes) of what is reported: each shape, the delays, and what the identity asks."""
    columns = identity.series.columns
    asked = list(zip(columns, np.eye(len(columns)), strict=True))
    asked += [(name, delay_weights(columns, whole.covariance, by)) for name, by in DELAYS.items() if set(by) <= set(columns)]
    asked += [(name, np.array([weights.get(c, 0.0) for c in columns])) for name, weights in identity.asks]
    names, rows = zip(*asked, strict=True)
    return names, np.array(rows)


def delay_weights(columns: tuple[str, ...], covariance: np.ndarray, shapes: tuple[str, str]) -> np.ndarray:
    """(k,) weights of the shapes in a delay of all motion: the first of its `shapes` where the second, of quick motion alone, is known to
    be zero. Slow motion by itself goes with what drifts."""
    late, quick = (columns.index(c) for c in shapes)
    weights = np.eye(len(columns))[late]
    weights[quick] = -covariance[late, quick] / covariance[quick, quick]
    return weights


def without_outliers(identity: Identity, series: Series) -> Series:
    """The series, without samples that no noise of the starting level explains."""
    left = present(BandedLikelihood(series).at(np.array(identity.white), identity.laws, smooth=True).left, "what smoothing leaves")
    far = series.seen & (np.abs(left) > OUTLIER * np.array(identity.white))
    return replace(series, seen=series.seen & ~far) if 0 < far.sum() <= FEW * series.seen.sum() else series


def thinned(series: Series, most: int) -> Series:
    """At most so many of the samples at which something is seen, evenly spread."""
    rows = np.flatnonzero(series.seen.any(1))
    rows = rows[:: max(1, -(-len(rows) // most))]
    # a stretch that begins between two kept samples begins at the second
    stretch = np.cumsum(series.restart)[rows]
    return replace(
        series, y=series.y[rows], X=series.X[rows], H=series.H[rows], seen=series.seen[rows], time=series.time[rows],
        restart=np.diff(stretch, prepend=-1) > 0,
    )  # fmt: skip


def _scatter(series: Series, levels: Levels, whole: Estimate, F: np.ndarray) -> np.ndarray:
    """(f,) factors on the standard deviations, at least 1: the root of chi-square per degree of freedom between stretches (Birge 1932)."""
    total, known = np.zeros(len(F)), np.einsum("fk,kl,fl->f", F, whole.covariance, F)
    n, counted = len(series.y), 0
    for part in np.array_split(np.arange(n), PARTS):
        cut = slice(part[0], part[-1] + 1)
        restart = series.restart[cut].copy()
        restart[0] = True
        own = replace(
            series, y=series.y[cut], X=series.X[cut], H=series.H[cut], seen=series.seen[cut], time=series.time[cut], restart=restart
        )
        if not own.seen.any():
            continue
        found = BandedLikelihood(own).at(levels.white, levels.laws)
        # what the prior of a shape holds fast tells nothing
        own_variance = np.einsum("fk,kl,fl->f", F, found.covariance, F)
        total += (F @ (found.beta - whole.beta)) ** 2 / np.maximum(own_variance - known, 1e-3 * own_variance)
        counted += 1
    return np.sqrt(np.maximum(total / max(counted - 1, 1), 1.0))


def delay_by_channel(s: Solution, delay: str) -> tuple[np.ndarray, np.ndarray]:
    """A delay (of `DELAYS`) as each channel of the identity by itself tells it, at the levels of all: values and deviations (m,)."""
    series, m = thinned(s.identity.series, ENOUGH), len(s.identity.channels)
    shapes = DELAYS[delay]
    late, others = series.columns.index(shapes[0]), [k for k, c in enumerate(series.columns) if c not in shapes]
    X = np.concatenate([series.X[:, :, late, None] * np.eye(m), series.X[:, :, others]], axis=2)
    columns = (*(f"late {c}" for c in s.identity.channels), *(series.columns[k] for k in others))
    prior = np.append([series.prior[late]] * m, series.prior[others])
    found = BandedLikelihood(replace(series, X=X, columns=columns, prior=prior)).at(s.levels.white, s.levels.laws)
    return found.beta[:m], np.sqrt(np.diag(found.covariance)[:m])
