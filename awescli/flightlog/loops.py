"""Loops: one turn of the course, seen along the line, is one loop. Flights without loops are cut into blocks of equal length."""

from dataclasses import dataclass

import numpy as np

from awescli.flightlog.clocks import moving_average
from awescli.flightlog.faults import runs_of
from awescli.flightlog.log import FlightLog
from awescli.flightlog.phases import phases, runs_of_phase

SHORTEST, LONGEST = 2.0, 60.0
"""s: a turn faster or slower than this is no crosswind loop."""

SMOOTHING = 0.3
"""s of smoothing of the velocity, much shorter than a loop, so that noise at the slow top of a loop does not turn the course."""

FEWEST = 3
"""With fewer loops than parts to split into, a flight is cut into blocks."""

BLOCKS, BLOCK_RANGE = 8, (6.0, 10.0)
"""Number of blocks aimed at, and their length [s]: long enough for a prediction of 5 s, short enough for three parts."""


@dataclass(frozen=True)
class Loops:
    """kind: "loops" or "blocks"; bounds: (K, 2) half-open sample ranges, in order; sentence: what they are."""

    kind: str
    bounds: np.ndarray
    sentence: str

    def __len__(self) -> int:
        return len(self.bounds)


def find_loops(log: FlightLog, labels: np.ndarray | None = None) -> Loops:
    """Complete loops inside traction phases; blocks of the flown time where there are fewer than 3.

    labels: (N,) phases, where they are at hand. A loop may hold invalid samples: `split.segments` leaves those out.
    """
    labels = phases(log) if labels is None else labels
    found: list[tuple[int, int]] = []
    if all(name in log.measured for name in ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d")):
        course = course_on_sphere(log)
        for first, last in runs_of_phase(labels, "traction"):
            found += _turns(np.unwrap(course[first:last]), first, log.dt)
    bounds = np.array(found, dtype=int).reshape(-1, 2)
    if len(bounds) >= FEWEST:
        seconds = (bounds[:, 1] - bounds[:, 0]) * log.dt
        return Loops("loops", bounds, f"{len(bounds)} loops of {seconds.mean():.1f} s (from {seconds.min():.1f} to {seconds.max():.1f} s)")
    return _blocks(log, labels)


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


def _turns(course: np.ndarray, offset: int, dt: float) -> list[tuple[int, int]]:
    """Whole turns of an unwrapped course, one after the other, from the first sample on."""
    found: list[tuple[int, int]] = []
    if course.size < 3:
        return found
    # only turns in the direction of the phase count; a figure of eight turns to and fro and arrives nowhere
    progress = np.sign(course[-1] - course[0]) * (course - course[0])
    count = int(progress.max() // (2 * np.pi))
    reached = np.searchsorted(np.maximum.accumulate(progress), 2 * np.pi * np.arange(count + 1))
    for first, last in zip(reached[:-1], reached[1:], strict=True):
        if SHORTEST <= (last - first) * dt <= LONGEST:
            found.append((int(first) + offset, int(last) + offset))
    return found


def _blocks(log: FlightLog, labels: np.ndarray) -> Loops:
    """The flown time in blocks of equal length; all the log where nothing is flown."""
    flown = runs_of((labels != "ground") & (labels != "hover") & log.valid)
    total = float((flown[:, 1] - flown[:, 0]).sum() * log.dt) if len(flown) else 0.0
    if not len(flown):
        flown, total = np.array([[0, len(log)]]), len(log) * log.dt
    seconds = float(np.clip(total / BLOCKS, *BLOCK_RANGE))
    bounds = []
    for first, last in flown:
        count = int((last - first) * log.dt / seconds + 1e-9)
        edges = np.linspace(first, last, count + 1).astype(int) if count else ()
        bounds += list(zip(edges[:-1], edges[1:], strict=True))
    return Loops(
        "blocks", np.array(bounds, dtype=int).reshape(-1, 2), f"{len(bounds)} blocks of {seconds:.1f} s (the flight does not loop)"
    )
