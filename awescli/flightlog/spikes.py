"""Spikes: one or two samples that leap away and come back, faster than anything that flies, one or two values that their neighbours
contradict, the first or the last one where those beside it do, and numbers that no sensor reports, however many in a row. Found before
units are judged, then missing."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.ndimage import median_filter

from awescli.notation.angles import wrap
from awescli.notation.quantities import ANGLES, MEASURED, UNITS

WINDOW = 5
"""Samples of the running median: it does not follow up to two samples in a row."""

USUAL = 10.0
"""A spike leaves the running median by so many times what 99 % of the samples do, ..."""

SPAN = 0.2
"""... and by this share of the range of that median: rare manoeuvres of a quiet flight are in it, spikes are not."""

CONTRADICTED = 4.0
"""A value is off by so many times what 95 % of the values are from the cubic through their four neighbours: some eleven standard
deviations of a sensor's noise. One value in a hundred may be off, which puts its neighbours off too, and the scale stays."""

AGREED = 0.5
"""Share of that by which the line through the two on either side may say otherwise: more, and it is a corner of a manoeuvre."""

NEARBY, AMONG = 50, 8.0
"""So many values on the livelier side say what is usual there: a flight in a long log of standing is noisier than most of it. A spike is
off by so many times their median, five standard deviations where they are normal."""

PASSES = 5
"""In which they are looked for: one that is far off hides a nearer one beside it."""

COMMAND = 0.5
"""Set-points may jump: their spikes leave the whole range, and by at least this much (SI: 29 deg, 0.5 m, 0.5 m/s)."""

BROKEN = 100.0
"""A number so many times larger than 98 % of a signal, ..."""

REACH = {"m": 1e4, "m/s": 1e3, "rad": 10.0, "rad/s": 1e3, "m/s2": 1e4, "N": 1e6}
"""... and larger than this, is of a broken cell: beyond what flies, in any unit that a signal may have been mistaken for."""

ENOUGH = 20_000
"""Samples from which a scale is taken."""

FEWEST = 50
"""Samples below which nothing is usual."""


def without_spikes(signals: Mapping[str, np.ndarray], rows: np.ndarray) -> tuple[dict[str, np.ndarray], dict[str, int]]:
    """(signals with NaN for spikes, signal -> number of spiked samples, where there are any).

    signals: quantity -> (N,) SI, NaN where missing; rows: indices of the samples whose stamps run forward (`usable_stamps`).
    """
    clean, found = dict(signals), {}
    for name, column in signals.items():
        index = rows[np.isfinite(column[rows])]
        if index.size < FEWEST:
            continue
        size = np.abs(column[index])
        broken = size > max(BROKEN * usual(size, 0.98), REACH.get(UNITS[name], np.inf))
        left = index[~broken]
        spikes = np.concatenate([index[broken], left[_spiked(name, column[left])]])
        if spikes.size:
            clean[name] = column.copy()
            clean[name][spikes] = np.nan
            found[name] = int(spikes.size)
    return clean, found


def usual(x: np.ndarray, shares: float | Sequence[float]) -> Any:
    """Quantiles of x (N,), from at most ENOUGH evenly spaced samples: a scale needs no more, and hours of flight have many."""
    return np.quantile(x[:: max(1, x.size // ENOUGH)], shares)


def _spiked(name: str, x: np.ndarray) -> np.ndarray:
    """(N,) bool of a signal (N,) without missing values."""
    turned: Callable[[np.ndarray], np.ndarray] = wrap if name in ANGLES else np.asarray
    run = np.unwrap(x) if name in ANGLES else x
    low, high = usual(run, (0.01, 0.99))
    # mirrored: the first value is not to vouch for itself
    smooth = median_filter(run, WINDOW, mode="mirror")
    off = np.abs(run - smooth)
    if name not in MEASURED:
        return off > max(USUAL * usual(off, 0.99), high - low, COMMAND)
    if low == high:
        return np.zeros(x.size, bool)  # stands still: faults.py's business
    return (off > max(USUAL * usual(off, 0.99), SPAN * np.ptp(smooth))) | _contradicted(x, turned)


def _contradicted(x: np.ndarray, turned: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """(N,) bool: one value or two in a row that their neighbours on either side contradict, with the samples of a slow sensor that repeat
    them; turned: differences of x."""
    starts = np.flatnonzero(np.append(True, np.diff(x) != 0))
    lengths = np.diff(np.append(starts, x.size))
    values, spiked = x[starts], np.zeros(starts.size, bool)
    for _ in range(PASSES if starts.size >= FEWEST else 0):
        found = [_taken_out(values, spiked, many, turned) for many in (2, 1)]
        if not any(found):
            break
    if starts.size >= FEWEST:
        spiked |= _ends(values, turned)
    # a value that stays is none of these: faults.py's business
    return np.repeat(spiked & (lengths <= 2 * np.median(lengths)), lengths)


def _taken_out(x: np.ndarray, spiked: np.ndarray, many: int, turned: Callable[[np.ndarray], np.ndarray]) -> bool:
    """Are there so `many` values in a row that their neighbours contradict? They are marked as spiked, and what the neighbours say is in
    their place then. Two in a row that are off to either side agree with none of both alone (JSBSim, family 43, a roll of +18 and -15 deg:
    three times the noise of the whole flight)."""
    by, agreed = _off_the_neighbours(x, many, turned)
    off = np.abs(by)
    agreed &= np.all([each > CONTRADICTED * usual(each, 0.95) for each in off], axis=0)
    # what is off puts its neighbours off: those that are most so
    least, far, sides = np.where(agreed, off.min(axis=0), 0.0), np.flatnonzero(agreed), np.arange(-many - 1, many + 2)
    far = far[least[far] >= least[np.clip(far[:, None] + sides, 0, x.size - 1)].max(axis=1)]
    far = far[np.all([each[far] > _among(each, far) for each in off], axis=0)]
    for k in range(many):
        spiked[far + k] = True
        x[far + k] -= by[k, far]
    return bool(far.size)


def _ends(x: np.ndarray, turned: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """(N,) bool: the first and the last value, where the line through the two beside it contradicts it."""
    bent = np.abs(turned(np.diff(turned(np.diff(x)))))
    far = CONTRADICTED * usual(bent, 0.95)
    spiked = np.zeros(x.size, bool)
    for end, near in ((0, bent[: NEARBY + 1]), (-1, bent[: -NEARBY - 2 : -1])):
        # one that is off itself bends the next line, too
        spiked[end] = near[0] > max(far, AMONG * np.median(near[1:])) and near[1] < AGREED * near[0]
    return spiked


def _among(off: np.ndarray, at: np.ndarray) -> np.ndarray:
    """What is too far off for samples `at`, beside what is usual around them."""
    sides = [np.clip(at[:, None] + side * np.arange(1, NEARBY + 1), 0, off.size - 1) for side in (-1, 1)]
    return AMONG * np.max([np.median(off[side], axis=1) for side in sides], axis=0)


def _off_the_neighbours(x: np.ndarray, many: int, turned: Callable[[np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """((many, N) differences of so many values in a row from the cubic through two neighbours on either side, (N,) bool: are they as far
    off the line through these two, and off that through those two? They are not where a signal steps or turns, and nothing is said of the
    ends)."""
    size, run, around = x.size - many - 3, range(many), [-2, -1, many, many + 1]

    def at(places: Sequence[int]) -> np.ndarray:
        return turned(np.array([x[2 + k : 2 + k + size] - x[1 : 1 + size] for k in places]))

    def beyond(places: Sequence[int]) -> np.ndarray:
        powers = len(places)
        weights = np.linalg.solve(np.vander(places, powers).T, np.vander(run, powers).T)
        return turned(at(run) - weights.T @ at(places))

    off, agreed = np.zeros((many, x.size)), np.zeros(x.size, bool)
    inner = slice(2, 2 + size)
    off[:, inner] = beyond(around)
    apart = [np.abs(turned(beyond(side) - off[:, inner])) for side in (around[:2], around[2:])]
    agreed[inner] = (np.maximum(*apart) < AGREED * np.abs(off[:, inner])).all(axis=0)
    return off, agreed
