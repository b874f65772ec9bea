"""Values that are no measurement: far off all that a fitted model and its processes say, for a moment, with good ones on either side; or
off from one value to the next, and back as fast.

The reader takes out what leaps (`flightlog.spikes`). What that leaves, some ten standard deviations of a sensor's noise, counts in a sum of
squares as much as what an effect does, and noise that has to hold it hides the effect. Nothing that flies is off for a moment only, or at
once: a model that lacks something is off for as long as the kite takes to answer, and goes there as slowly as a kite moves.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from awescli.estimation.fitted import Fit
from awescli.estimation.levels import smoothed_residual

FAR = 6.0
"""Standard deviations by which one value at least of an outlier is off, ..."""
BESIDE = 3.0
"""... all of its values, and none of the two on either side: the noise is too large while they count."""
DRAGGED = 0.15
"""Share of the farthest value by which those on either side may be off: a fit gives way to what is hundreds of them off."""
BRIEF = 0.06
"""[s] how long it lasts at most, unless it is a single value."""
LEAP, AT_ONCE = 9.0, 3.0
"""A burst begins and ends with a change of the residual, from one value to the next, by so many standard deviations, and so many times
what 95 % of the changes are. What lies between may have been followed by a drift of the sensor; the leaps are not."""
BURST, ALIKE = 1.0, 0.5
"""[s] a burst lasts at most; share of the larger leap by which the two that bound it may differ."""
NEAR = 0.75
"""Share of a leap by which the value before a burst, and the one behind it, may be off: half of it where a drift goes along."""
RARE = 0.05
"""Share of a channel's values, at most: more, and its noise is of another kind."""


def outliers(fits: Sequence[Fit], worth: float = 0.0) -> dict[str, list[int]]:
    """Channel -> samples of the log that are outliers, of one flight in several fits; a model that flies no segment says nothing of them.
    worth: squares (chi-square) that the values in a row must come to at least."""
    found: dict[str, set[int]] = {}
    count: Counter[str] = Counter()
    for fit in (f for f in fits if len(f.counted) and f.flies.any()):
        observed, r = fit.misfit.observed, smoothed_residual(fit)
        for (k, y), name in zip(np.ndindex(len(r), len(observed.outputs)), len(r) * list(observed.outputs), strict=True):
            own, dt = r[k, :, y], observed.segments.dt
            count[name] += int(np.isfinite(own).sum())
            rows = np.union1d(_off(own, dt), _bursts(own, dt)).astype(int)
            runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
            large = [run for run in runs if (own[run] ** 2).sum() >= worth]
            found.setdefault(name, set()).update((observed.segments.first[k] + np.concatenate([rows[:0], *large])).tolist())
    return {name: sorted(rows) for name, rows in found.items() if 0 < len(rows) <= RARE * count[name]}


def _off(r: np.ndarray, dt: float) -> np.ndarray:
    """Samples of a whitened residual (N,), NaN between the values of a slow sensor, that are off for a moment only."""
    new = np.flatnonzero(np.isfinite(r))
    off, until = np.abs(r[new]), np.append(new, r.size)
    found = np.zeros(0, int)
    good = max(BESIDE, DRAGGED * off.max(initial=0.0))
    for first, last in np.flatnonzero(np.diff(np.r_[0, off > good, 0])).reshape(-1, 2):
        brief = last - first == 1 or until[last] - until[first] <= round(BRIEF / dt)
        beside = np.r_[off[max(first - 2, 0) : first], off[last : last + 2]]
        if brief and off[first:last].max() > FAR and (beside <= good).all():
            found = np.append(found, new[first:last])
    return found


def _bursts(r: np.ndarray, dt: float) -> np.ndarray:
    """Samples of a whitened residual (N,), NaN as in `_off`, between two leaps to either side; up to an end where the one leap there is may
    have its fellow beyond it. Of a slow sensor nothing is said: between its values a kite moves, too."""
    new, most = np.flatnonzero(np.isfinite(r)), round(BURST / dt)
    change = np.diff(r[new])
    if not change.size:
        return new[:0]
    least = max(LEAP, AT_ONCE * float(np.quantile(np.abs(change), 0.95)))
    pairs, alone = _paired(np.flatnonzero((np.abs(change) > least) & (np.diff(new) * dt <= BRIEF)).tolist(), change, new, most)
    bursts = [(first + 1, last + 1) for first, last in pairs]
    for leap in alone:
        ends = [(a, b) for a, b in ((0, leap + 1), (leap + 1, new.size)) if new[b - 1] - new[a] < most]
        like_no_other = np.delete(np.abs(change), leap).max(initial=0.0) < ALIKE * abs(change[leap])
        bursts += ends if len(ends) == 1 and like_no_other else []
    # of a single value `_off` says more
    return np.concatenate([new[:0], *(new[a:b] for a, b in bursts if b > a + 1 and _from_near(r[new], a, b))])


def _paired(leaps: list[int], change: np.ndarray, new: np.ndarray, most: int) -> tuple[list[tuple[int, int]], list[int]]:
    """(leaps away and back, at most so many samples apart; those without a fellow). change: (M-1,) of the M values at samples `new`."""
    pairs, alone = [], []
    while leaps:
        first, *leaps = leaps
        size = abs(change[first])
        back = [
            k for k in leaps if new[k] - new[first] <= most and abs(change[first] + change[k]) < ALIKE * max(size, abs(change[k]))
        ]  # fmt: skip
        if back:
            pairs.append((first, back[0]))
            leaps = [k for k in leaps if k > back[0]]
        else:
            alone.append(first)
    return pairs, alone


def _from_near(r: np.ndarray, a: int, b: int) -> bool:
    """Are the values beside r[a:b] nearer to what the model says than the leaps between are large? Where a model runs away they are not."""
    return all(abs(r[out]) < NEAR * abs(r[out] - r[into]) for out, into in ((a - 1, a), (b, b - 1)) if 0 <= out < r.size)
