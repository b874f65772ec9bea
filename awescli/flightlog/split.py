"""Loops -> train, validation, test; sample ranges -> segments to predict. Whole loops only: no sample serves two parts."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from awescli.flightlog.log import FlightLog, runs_of
from awescli.flightlog.loops import Loops
from awescli.flightlog.ranges import FARTHEST, LoopRanges, farthest, loop_ranges
from awescli.notation.errors import BadInput

WHOLE = 5.0
"""[s] that each part must be able to predict somewhere: what is predicted in one go, where nothing else is asked."""
WARM_UP = 1.0
"""[s] before a prediction whose measurements fix its start: long enough to average the noise, short against a loop. They may lie in
another part."""

PARTS = ("train", "validation", "test")
ORDERS = ("balanced", "chronological", "interleaved")
Order = Literal["balanced", "chronological", "interleaved"]

Range = tuple[int, int]


@dataclass(frozen=True)
class Split:
    """Half-open sample ranges per part, in order, adjoining loops merged; counts: loops per part; of: "loops" or "blocks"."""

    train: tuple[Range, ...]
    validation: tuple[Range, ...]
    test: tuple[Range, ...]
    counts: tuple[int, int, int]
    of: str

    @property
    def stretches(self) -> tuple[tuple[Range, ...], ...]:
        """Those of train, validation and test, in this order."""
        return self.train, self.validation, self.test


def split(
    loops: Loops,
    train: float = 0.5,
    validation: float = 0.2,
    test: float = 0.3,
    order: Order = "balanced",
    turn: int = 0,
    log: FlightLog | None = None,
) -> Split:
    """Whole loops dealt to the three parts by their shares (of their sum), at least one each.

    balanced: train, validation, test, train, and the same backwards, in as few stretches as make the parts' ranges alike (see `_balanced`;
    without a `log` nothing is known of ranges, and the fewest are taken). chronological: first train, then validation, then test.
    interleaved: spread over the flight. turn: every loop takes the part of the one so many loops before it, the first ones those of the
    last: so that on a short flight each loop is unseen once (cross-validation); further by as many as it takes where that leaves a part of
    the `log` without `WHOLE` seconds that can be predicted (a sensor is silent in the middle of its loops). Raises BadInput for fewer
    than three loops, shares that are not positive, or an unknown order.

    What balanced costs: test loops lie between loops that were fitted and share slow disturbances with them, the wind above all. Their
    error is that of a model between flown states, on this flight; how it does later, on a longer line, is asked by chronological.
    """
    shares = np.array([train, validation, test], dtype=float)
    if not (np.isfinite(shares).all() and (shares > 0).all()):
        raise BadInput(f"shares {train:g}, {validation:g}, {test:g} of train, validation and test", do="Each must be above zero.")
    if order not in ORDERS:
        raise BadInput(f"unknown order '{order}'", do=f"Use {', '.join(ORDERS[:-1])} or {ORDERS[-1]}.")
    count = len(loops)
    if count < 3:
        raise BadInput(
            f"{count} {loops.kind} cannot be split into train, validation and test ({loops.sentence})",
            do="At least 3 are needed: use a longer flight, or check in `awes check` which phases were found.",
        )
    counts = _counts(count, shares / shares.sum())
    if order == "balanced":
        part = _balanced(counts, loop_ranges(log, loops.bounds) if log is not None else ())
    else:
        part = np.repeat(np.arange(3), counts) if order == "chronological" else _dealt(counts)
    turns = [np.roll(part, turn + further) for further in range(count if log is not None else 1)]
    parts = [[_merged(loops.bounds[part == k]) for k in range(3)] for part in turns]
    ranges = next((found for found in parts if log is None or all(prediction_starts(log, own, WHOLE).size for own in found)), parts[0])
    return Split(*ranges, counts=(int(counts[0]), int(counts[1]), int(counts[2])), of=loops.kind)


def segments(ranges: Iterable[Range], length_samples: int, stride: int | None = None, valid: np.ndarray | None = None) -> np.ndarray:
    """Start indices (K,) of segments of `length_samples` steps (one sample more) inside one range each, ascending.

    Without `stride` the segments share at most their end samples and are spread evenly over each range; with it they start
    every `stride` samples. valid: (N,) bool; a segment holds valid samples only.
    """
    if length_samples < 1 or (stride is not None and stride < 1):
        raise BadInput(f"segments of {length_samples} steps with stride {stride}", do="Both must be at least 1 sample.")
    starts = []
    for first, last in ranges:
        pieces = [(first, last)] if valid is None else [(first + a, first + b) for a, b in runs_of(valid[first:last])]
        for low, high in pieces:
            room = high - low - 1 - length_samples
            if room < 0:
                continue
            if stride is None:
                count = room // length_samples + 1
                starts.append(low + np.floor(np.linspace(0, room, count) if count > 1 else np.array([room / 2])).astype(int))
            else:
                starts.append(np.arange(low, low + room + 1, stride))
    return np.concatenate(starts).astype(int) if starts else np.empty(0, dtype=int)


def prediction_starts(
    log: FlightLog, ranges: Iterable[Range], horizon: float, warm_up: float = WARM_UP, every: float | None = None
) -> np.ndarray:
    """(K,) samples where the warm-ups of predictions begin; none where no range is long enough. horizon, every: [s] that are predicted, and
    between predictions, default one after the other."""
    before, ahead = int(round(warm_up / log.dt)), int(round(horizon / log.dt))
    stride = ahead if every is None else max(ahead, int(round(every / log.dt)))
    return segments([(max(a - before, 0), b) for a, b in ranges], before + ahead, stride=stride, valid=log.valid)


def _counts(count: int, shares: np.ndarray) -> np.ndarray:
    """Whole numbers (3,) that add up to `count`, at least 1 each, as near to the shares as they can be."""
    counts = np.maximum(np.floor(shares * count), 1).astype(int)
    while counts.sum() < count:
        counts[np.argmax(shares * count - counts)] += 1
    while counts.sum() > count:
        counts[np.argmax(np.where(counts > 1, counts - shares * count, -np.inf))] -= 1
    return counts


def _balanced(counts: np.ndarray, ranges: Sequence[LoopRanges]) -> np.ndarray:
    """Part of every loop (K,): the fewest mirrored stretches in which validation and test leave nowhere what train has flown.

    Two stretches (train, validation, test, train, test, validation, train) make every trend alike in the parts, a line that gets longer
    above all, and train holds both ends of the flight; they depend on nothing but the number of loops. Where a range still differs by more
    than FARTHEST, more stretches are tried, down to single loops, then the same half a stretch on; if none will do, the nearest is taken.
    """
    tried = [_mirrored(counts, m, shift) for shift in (0.0, 0.5) for m in range(2, max(int(counts.sum()) // 2, 2) + 1)]
    reached = []
    for part in tried:
        reached.append(farthest(ranges, part))
        if reached[-1] <= FARTHEST:
            return part
    return tried[int(np.argmin(reached))]


def _mirrored(counts: np.ndarray, stretches: int, shift: float = 0.0) -> np.ndarray:
    """Part of every loop (K,): equal stretches, each train - validation - test - train, every other one backwards; `shift` moves where
    they begin, in stretches. The stretches take turns, so that none has more of a part than another but for one loop."""
    total = int(counts.sum())
    at = (np.arange(total) + 0.5) / total * stretches + shift
    stretch = at.astype(int)
    # place within the stretch, -1/2 to 1/2, forwards or backwards; of equal places the one nearer to the flight's middle comes first
    place = np.round((at % 1 - 0.5) * np.where(stretch % 2, -1, 1), 9)
    nearer = np.abs(np.arange(total) - (total - 1) / 2)
    # the middle of every stretch is not train, and its beginning is validation
    turn = _turns(stretch, np.lexsort((nearer, np.abs(place))))
    middle = np.lexsort((nearer, turn))[: total - counts[0]]
    turn = _turns(stretch[middle], np.argsort(place[middle], kind="stable"))
    middle = middle[np.argsort(turn, kind="stable")]
    part = np.zeros(total, dtype=int)
    part[middle[: counts[1]]], part[middle[counts[1] :]] = 1, 2
    return part


def _turns(stretch: np.ndarray, order: np.ndarray) -> np.ndarray:
    """(K,) the how manieth of its own stretch each is, in the given order."""
    turn, seen = np.empty(len(order), dtype=int), {}
    for k in order:
        turn[k] = seen[stretch[k]] = seen.get(stretch[k], -1) + 1
    return turn


def _dealt(counts: np.ndarray) -> np.ndarray:
    """Part of every loop (K,), each part spread evenly: loop after loop goes to the part that lags most behind its share."""
    total, given, part = counts.sum(), np.zeros(3), []
    for k in range(total):
        behind = np.where(given < counts, counts / total * (k + 1) - given, -np.inf)
        part.append(int(np.argmax(behind)))
        given[part[-1]] += 1
    return np.array(part)


def _merged(bounds: np.ndarray) -> tuple[Range, ...]:
    """Ranges with adjoining ones made one."""
    merged: list[Range] = []
    for first, last in bounds.tolist():
        if merged and merged[-1][1] == first:
            merged[-1] = (merged[-1][0], last)
        else:
            merged.append((first, last))
    return tuple(merged)
