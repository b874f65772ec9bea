"""Loops: one turn of the course, seen along the line, or one figure of eight. Flights without them are cut into blocks of equal length."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from awescli.flightlog.clocks import moving_average
from awescli.flightlog.log import FlightLog, runs_of
from awescli.flightlog.phases import phases, runs_of_phase
from awescli.flightlog.usable import LeftOut, usable

SHORTEST, LONGEST = 2.0, 60.0
"""s: a turn faster or slower than this is no crosswind loop."""

BACK = np.pi / 2
"""rad by which the course may turn back within a loop; a figure of eight turns back by more."""

TO_AND_FRO = np.pi
"""rad that the course covers within a figure of eight: it turns by more than a half turn to each side; weaving does not."""

SWAY = 40.0
"""s of the moving mean around which a figure of eight swings in azimuth."""

SWING = 0.3
"""Share of the swing's standard deviation that must be left to one side before a crossing back counts."""

SMOOTHING = 0.3
"""s of smoothing of the velocity, much shorter than a loop, so that noise at the slow top of a loop does not turn the course."""

FEWEST = 3
"""With fewer loops than parts to split into, a flight is cut into blocks."""

BLOCKS, BLOCK_RANGE, FREE_BLOCK = 8, (6.0, 10.0), 20.0
"""Number of blocks aimed at, and their length [s]: long enough for a prediction of 5 s, short enough for three parts. Without a line a
flight may last, and a block then holds a turn or two: up to FREE_BLOCK."""


@dataclass(frozen=True)
class Loops:
    """kind: "loops" (figures of eight among them), "blocks" or "cycles"; bounds: (K, 2) half-open sample ranges, in order; sentence: what
    they are; left_out: those that were found but are not fit for use."""

    kind: str
    bounds: np.ndarray
    sentence: str
    left_out: tuple[LeftOut, ...] = ()

    def __len__(self) -> int:
        return len(self.bounds)


def find_loops(log: FlightLog, labels: np.ndarray | None = None) -> Loops:
    """Complete usable loops and figures of eight inside traction phases; usable blocks of the flown time where there are fewer than 3.

    labels: (N,) phases, where they are at hand. A loop may hold invalid samples: `split.segments` leaves those out.
    """
    labels = phases(log) if labels is None else labels
    if not log.on_line:
        return _blocks(log, labels)
    turns: list[tuple[int, int]] = []
    eights: list[tuple[int, int]] = []
    if all(name in log.measured for name in ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d")):
        course, azimuth = course_on_sphere(log), np.unwrap(np.arctan2(log["p_e"], log["p_n"]))
        for first, last in runs_of_phase(labels, "traction"):
            way = np.unwrap(course[first:last])
            here = _turns(way, log.dt)
            # figures of eight lie between the turns, before and after
            edges = [0, *(i for turn in here for i in turn), last - first]
            for a, b in zip(edges[::2], edges[1::2], strict=True):
                eights += [(first + a + i, first + a + k) for i, k in _eights(azimuth[first + a : first + b], way[a:b], log.dt)]
            turns += [(first + i, first + k) for i, k in here]
    bounds = np.array(sorted(turns + eights), dtype=int).reshape(-1, 2)
    good, out = usable(log, bounds)
    if len(good) < FEWEST:
        return _blocks(log, labels)
    is_eight = np.isin(good[:, 0], [first for first, _ in eights])
    kinds = (("loops", good[~is_eight]), ("figures of eight", good[is_eight]))
    sentence = " and ".join(_say(name, part, log.dt) for name, part in kinds if len(part))
    return Loops("loops", good, sentence + left_out_in_words(out), out)


def _say(name: str, bounds: np.ndarray, dt: float) -> str:
    seconds = (bounds[:, 1] - bounds[:, 0]) * dt
    return f"{len(bounds)} {name} of {seconds.mean():.1f} s (from {seconds.min():.1f} to {seconds.max():.1f} s)"


def left_out_in_words(out: tuple[LeftOut, ...]) -> str:
    """ "; 3 left out: 2 slack line, 1 no excitation"; empty where nothing is."""
    reasons = Counter(o.reason for o in out)
    return f"; {len(out)} left out: {', '.join(f'{n} {reason}' for reason, n in reasons.items())}" if out else ""


def course_on_sphere(log: FlightLog) -> np.ndarray:
    """Angle (N,) rad of the velocity across the line: 0 up the sphere around the winch, pi/2 along growing azimuth."""
    width = max(1, int(round(SMOOTHING / log.dt)))
    v_n, v_e, v_d = (moving_average(log[name], width) for name in ("v_n", "v_e", "v_d"))
    level = np.maximum(np.hypot(log["p_n"], log["p_e"]), 1e-6)
    distance = np.maximum(np.hypot(level, log["p_d"]), 1e-6)
    north, east, sin_e, cos_e = log["p_n"] / level, log["p_e"] / level, -log["p_d"] / distance, level / distance
    along_azimuth = -east * v_n + north * v_e
    up = -sin_e * (north * v_n + east * v_e) - cos_e * v_d
    return np.arctan2(along_azimuth, up)


def _turns(course: np.ndarray, dt: float) -> list[tuple[int, int]]:
    """Whole turns of an unwrapped course, one after the other, from the first sample on."""
    found: list[tuple[int, int]] = []
    if course.size < 3:
        return found
    # only turns in the direction of the phase count; a figure of eight turns to and fro and arrives nowhere
    progress = np.sign(course[-1] - course[0]) * (course - course[0])
    count = int(progress.max() // (2 * np.pi))
    farthest = np.maximum.accumulate(progress)
    reached = np.searchsorted(farthest, 2 * np.pi * np.arange(count + 1))
    for first, last in zip(reached[:-1].tolist(), reached[1:].tolist(), strict=True):
        if SHORTEST <= (last - first) * dt <= LONGEST and (farthest - progress)[first:last].max() < BACK:
            found.append((first, last))
    return found


def _eights(azimuth: np.ndarray, course: np.ndarray, dt: float) -> list[tuple[int, int]]:
    """Figures of eight: from one crossing of the middle towards growing azimuth to the next, with turns to both sides between them.

    azimuth, course: (N,) rad, unwrapped.
    """
    if azimuth.size * dt < 2 * SHORTEST:
        return []
    swing = azimuth - moving_average(azimuth, max(1, int(round(SWAY / dt))))
    clear = np.flatnonzero(np.abs(swing) > SWING * swing.std())
    if clear.size < 2:
        return []
    turned = np.flatnonzero((swing[clear[:-1]] < 0) & (swing[clear[1:]] > 0))
    crossings = [int(clear[k] + np.argmax(swing[clear[k] : clear[k + 1] + 1] >= 0)) for k in turned]
    return [
        (first, last)
        for first, last in zip(crossings[:-1], crossings[1:], strict=True)
        if SHORTEST <= (last - first) * dt <= LONGEST
        and np.ptp(course[first:last]) > TO_AND_FRO
        and abs(course[last - 1] - course[first]) < BACK
    ]


def _blocks(log: FlightLog, labels: np.ndarray) -> Loops:
    """The flown time in blocks of equal length; all the log where nothing is flown."""
    flown = runs_of((labels != "ground") & (labels != "hover") & log.valid)
    total = float((flown[:, 1] - flown[:, 0]).sum() * log.dt) if len(flown) else 0.0
    if not len(flown):
        flown, total = np.array([[0, len(log)]]), len(log) * log.dt
    seconds = float(np.clip(total / BLOCKS, BLOCK_RANGE[0], BLOCK_RANGE[1] if log.on_line else FREE_BLOCK))
    bounds = []
    for first, last in flown:
        count = int((last - first) * log.dt / seconds + 1e-9)
        edges = np.linspace(first, last, count + 1).astype(int) if count else ()
        bounds += list(zip(edges[:-1], edges[1:], strict=True))
    good, out = usable(log, np.array(bounds, dtype=int).reshape(-1, 2))
    if log.on_line:
        return Loops("blocks", good, f"{len(good)} blocks of {seconds:.1f} s (the flight does not loop){left_out_in_words(out)}", out)
    return Loops("blocks", good, f"no tether: {len(good)} blocks of {seconds:.3g} s{left_out_in_words(out)}", out)
