"""One identity solved: levels of noise, then its shapes with covariance, and whether all stretches of the flight say the same."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from awescli.flightlog.reconstruction.gauss_markov import BandedLikelihood, Estimate, Series
from awescli.flightlog.reconstruction.identities import Identity
from awescli.flightlog.reconstruction.levels import Levels, estimate_levels

ENOUGH = 2000
"""Samples from which levels are estimated, evenly thinned: white noise stays what it is, and 2000 tell it to 1.6 %."""
MOST = 10_000
"""Samples from which shapes are estimated, thinned alike."""
OUTLIER, FEW = 6.0, 0.02
"""Samples so many standard deviations away do not count, as long as they are no more than this share."""
PARTS = 6
"""Stretches that are solved for themselves."""
AGREE = 0.95
ABSENT = 0.02
"""Of a drift's level, that stands for none: nothing at all would be singular."""


@dataclass(frozen=True)
class Solution:
    """levels; values of the shapes by name, covariance (k, k); scatter (k,): by how much stretches of the flight differ more than they may
    (factor that is already in the covariance, 1 where they agree); gain: law -> what the deviance would lose without it."""

    identity: Identity
    levels: Levels
    values: dict[str, float]
    covariance: np.ndarray
    scatter: np.ndarray
    gain: dict[str, float]

    def std(self, column: str) -> float:
        i = self.identity.series.columns.index(column)
        return float(np.sqrt(self.covariance[i, i]))


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
    scatter = _scatter(series, levels, whole)
    covariance = whole.covariance * np.outer(scatter, scatter)
    return Solution(identity, levels, dict(zip(series.columns, whole.beta.tolist(), strict=True)), covariance, scatter, gain)


def without_outliers(identity: Identity, series: Series) -> Series:
    """The series, without samples that no noise of the starting level explains."""
    left = BandedLikelihood(series).at(np.array(identity.white), identity.laws, smooth=True).left
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


def _scatter(series: Series, levels: Levels, whole: Estimate) -> np.ndarray:
    """(k,) factors on the standard deviations: the root of chi-square per degree of freedom between stretches (Birge 1932), where that is
    more than chance."""
    total = np.zeros(len(whole.beta))
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
        variance = np.maximum(np.diag(found.covariance) - np.diag(whole.covariance), 1e-3 * np.diag(found.covariance))
        total += (found.beta - whole.beta) ** 2 / variance
        counted += 1
    freedom = max(counted - 1, 1)
    return np.where(total > chi2.ppf(AGREE, freedom), np.sqrt(total / freedom), 1.0)
