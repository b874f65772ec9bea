"""Spikes: one or two samples that leap away and come back, faster than anything that flies, single values that their neighbours on either
side contradict, and numbers that no sensor reports, however many in a row. Found before units are judged, then missing."""

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
"""A single value is off by so many times what 95 % of the values are from the cubic through their four neighbours: some eleven standard
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
    smooth = median_filter(run, WINDOW, mode="nearest")
    off = np.abs(run - smooth)
    if name not in MEASURED:
        return off > max(USUAL * usual(off, 0.99), high - low, COMMAND)
    if low == high:
        return np.zeros(x.size, bool)  # stands still: faults.py's business
    return (off > max(USUAL * usual(off, 0.99), SPAN * np.ptp(smooth))) | _contradicted(x, turned)


def _contradicted(x: np.ndarray, turned: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """(N,) bool: values that their neighbours on either side contradict, with the samples of a slow sensor that repeat them; turned:
    differences of x."""
    starts = np.flatnonzero(np.append(True, np.diff(x) != 0))
    lengths = np.diff(np.append(starts, x.size))
    values, spiked = x[starts], np.zeros(starts.size, bool)
    for _ in range(PASSES if starts.size >= FEWEST else 0):
        by, agreed = _off_the_neighbours(values, turned)
        off = np.abs(by)
        far = np.flatnonzero((off > CONTRADICTED * usual(off, 0.95)) & agreed)
        # what is off puts its neighbours off: the one that is most so
        far = far[off[far] >= off[far[:, None] + np.array([-2, -1, 1, 2])].max(axis=1)]
        far = far[off[far] > _among(off, far)]
        if not far.size:
            break
        spiked[far] = True
        values[far] -= by[far]
    if spiked.any():
        spiked |= _beside(values, spiked, turned)
    # a value that stays is none of these: faults.py's business
    return np.repeat(spiked & (lengths <= 2 * np.median(lengths)), lengths)


def _among(off: np.ndarray, at: np.ndarray) -> np.ndarray:
    """What is too far off for samples `at`, beside what is usual around them."""
    sides = [np.clip(at[:, None] + side * np.arange(1, NEARBY + 1), 0, off.size - 1) for side in (-1, 1)]
    return AMONG * np.max([np.median(off[side], axis=1) for side in sides], axis=0)


def _beside(x: np.ndarray, spiked: np.ndarray, turned: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """(N,) bool: the neighbour of a spike, one of both, that is as far off the line over the two. A spike of 175 m/s that is gone left a
    cubic bent towards one of 6 m/s beside it."""
    off, found = np.abs(_off_the_neighbours(x, turned)[0]), np.zeros(x.size, bool)
    inner = np.flatnonzero(spiked)
    inner = inner[(inner >= 2) & (inner < x.size - 2)]
    sides = np.array([[-1], [1]])
    at, first, last = inner + sides, inner - sides, inner + 2 * sides
    by = np.abs(turned(x[at] - x[first] - turned(x[last] - x[first]) * 2 / 3))
    least = np.maximum(CONTRADICTED * usual(off, 0.95), [_among(off, those) for those in at])
    found[at[(by > least) & (by >= by[::-1]) & ~spiked[first] & ~spiked[last]]] = True
    return found


def _off_the_neighbours(x: np.ndarray, turned: Callable[[np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """((N,) difference from the cubic through two neighbours on either side, (N,) bool: is it as far off the line through these two, and
    off that through those two? It is not where a signal steps or turns, and nothing is said of the ends)."""
    before, here, after, second = (turned(x[k : x.size - 4 + k] - x[1:-3]) for k in (0, 2, 3, 4))
    off, agreed = np.zeros(x.size), np.zeros(x.size, bool)
    off[2:-2] = turned(here - (4 * after - second - before) / 6)
    from_left, from_right = here + before, here - (2 * after - second)
    apart = [np.abs(turned(from_line - off[2:-2])) for from_line in (from_left, from_right)]
    agreed[2:-2] = np.maximum(*apart) < AGREED * np.abs(off[2:-2])
    return off, agreed
