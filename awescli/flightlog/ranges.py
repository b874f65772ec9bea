"""How far each loop of a flight goes, and whether one part of it leaves what another has flown."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import binary_erosion

from awescli.flightlog.consistency import Check
from awescli.flightlog.log import FlightLog
from awescli.flightlog.smoothing import local_quadratic
from awescli.notation.quantities import CONTROL_SURFACES

EDGE = 1.0
"""Percent of a loop's samples at either end that do not count: a spike is no range; what a loop reaches for a tenth of a second is."""
RATE_SPAN = 0.2
"""[s] over which the rate of a set-point is taken: a step of an autopilot is no rate."""
FARTHEST = 1.2
"""Times what train has flown up to which another part may go: a model that holds there is asked for no more than a little beyond."""
DEG = np.pi / 180

Kind = Literal["amplitude", "level"]
Stretches = Iterable[tuple[int, int]]


@dataclass(frozen=True)
class LoopRanges:
    """The ranges (L,) of one quantity in each loop, in the unit shown. kind: amplitude (about zero) or level; least: what counts as
    nothing: a quantity that moves by less over the flight is not compared."""

    name: str
    unit: str
    kind: Kind
    low: np.ndarray
    high: np.ndarray
    least: float

    def of(self, which: np.ndarray) -> tuple[float, float]:
        """(smallest, largest) over some of the loops (L,) bool."""
        return float(self.low[which].min()), float(self.high[which].max())

    def reach(self, known: np.ndarray, part: np.ndarray) -> float:
        """How far loops `part` go, in times of what loops `known` have flown.

        amplitude: the largest magnitude over theirs. level: the range of both together over theirs; 1 where `part` stays inside.
        """
        (low, high), (lowest, highest) = self.of(known), self.of(part)
        if self.kind == "amplitude":
            return max(abs(lowest), abs(highest)) / max(abs(low), abs(high), self.least)
        return 1 + (max(low - lowest, 0.0) + max(highest - high, 0.0)) / max(high - low, self.least)


@dataclass(frozen=True)
class PartRanges:
    """One quantity in the three parts: (smallest, largest) in `unit`, and how far validation and test go in times of train."""

    name: str
    unit: str
    kind: Kind
    train: tuple[float, float]
    validation: tuple[float, float]
    test: tuple[float, float]
    validation_reach: float
    test_reach: float


def loop_ranges(log: FlightLog, bounds: np.ndarray) -> tuple[LoopRanges, ...]:
    """Rates, deflections and their rates, airspeed, tension, height and tether length of each loop (half-open ranges (L, 2)), where the
    log has them and they move; valid samples only."""
    found = []
    # a rate is known where all that it is taken over is
    whole = binary_erosion(log.valid, np.ones(2 * int(np.ceil(RATE_SPAN / log.dt)) + 1), border_value=1)
    known = {f"{name} rate": whole for name in CONTROL_SURFACES}
    for name, unit, kind, signal, least in _quantities(log):
        valid = known.get(name, log.valid)
        low, high = np.array([_range(signal[a:b], valid[a:b]) for a, b in bounds]).reshape(-1, 2).T
        if low.size and high.max() - low.min() > least:
            found.append(LoopRanges(name, unit, kind, low, high, least))
    return tuple(found)


def part_ranges(ranges: Sequence[LoopRanges], bounds: np.ndarray, parts: Sequence[Stretches]) -> tuple[PartRanges, ...]:
    """The ranges of a flight whose loops (L, 2) were dealt to three parts: train, validation, test; none where one holds none of them."""
    train, validation, test = (_inside(bounds, stretches) for stretches in parts)
    if not (train.any() and validation.any() and test.any()):
        return ()
    return tuple(
        PartRanges(
            r.name, r.unit, r.kind, r.of(train), r.of(validation), r.of(test), r.reach(train, validation), r.reach(train, test)
        )
        for r in ranges
    )  # fmt: skip


def farthest(ranges: Sequence[LoopRanges], part: np.ndarray) -> float:
    """How far validation or test leave train at most, over all quantities; part: (L,) 0, 1, 2. 1 or less: nowhere."""
    return max((r.reach(part == 0, part == k) for r in ranges for k in (1, 2)), default=1.0)


def ranges_check(rows: Sequence[PartRanges]) -> Check:
    """The named check: the quantity in which validation or test go farthest beyond train."""
    worst = max(rows, key=lambda row: max(row.test_reach, row.validation_reach), default=None)
    if worst is None:
        return Check("ranges", 1.0, "times", FARTHEST, True, "Nothing to compare between the parts.")
    part = "test" if worst.test_reach >= worst.validation_reach else "validation"
    reach = max(worst.test_reach, worst.validation_reach)
    if reach <= FARTHEST:
        sentence = "Validation and test stay within what train flew."
    elif worst.kind == "amplitude":
        sentence = f"{part.capitalize()} reaches {reach:.1f} times the {worst.name} that train flew."
    else:
        (low, high), (lowest, highest) = worst.train, getattr(worst, part)
        flown = f"{lowest:.0f} to {highest:.0f} {worst.unit}, train {low:.0f} to {high:.0f} {worst.unit}"
        sentence = f"{part.capitalize()} flies {worst.name} {flown}."
    beyond = "" if reach <= FARTHEST else " What is only seen there cannot be fitted; see `split.order`."
    return Check("ranges", reach, "times", FARTHEST, reach <= FARTHEST, sentence + beyond)


def _quantities(log: FlightLog) -> Iterator[tuple[str, str, Kind, np.ndarray, float]]:
    """(name, unit, kind, signal (N,), least) of what is compared, in the unit shown."""
    for name, rate in (("p", "roll rate"), ("q", "pitch rate"), ("r", "yaw rate")):
        if name in log:
            yield rate, "deg/s", "amplitude", log[name] / DEG, 1.0
    for name in CONTROL_SURFACES:
        if name in log:
            yield name, "deg", "amplitude", log[name] / DEG, 0.5
            yield f"{name} rate", "deg/s", "amplitude", local_quadratic(log[name], log.dt, RATE_SPAN, derivative=1) / DEG, 2.0
    if "throttle" in log:
        yield "throttle", "%", "level", 100 * log["throttle"], 5.0
    if "V_a" in log:
        yield "airspeed", "m/s", "level", log["V_a"], 2.0
    if "tension" in log:
        yield "tension", "N", "level", log["tension"], 0.05 * max(float(np.percentile(log["tension"], 95)), 1.0)
    if "p_d" in log:
        yield "height", "m", "level", -log["p_d"], 5.0
    if "tether_length" in log:
        yield "tether length", "m", "level", log["tether_length"], 5.0


def _range(signal: np.ndarray, valid: np.ndarray) -> tuple[float, float]:
    """(smallest, largest) of a loop, without EDGE percent at either end; of all samples where none is valid."""
    low, high = np.percentile(signal[valid] if valid.any() else signal, [EDGE, 100 - EDGE])
    return float(low), float(high)


def _inside(bounds: np.ndarray, stretches: Stretches) -> np.ndarray:
    """(L,) which loops lie in half-open sample ranges."""
    return np.array([any(a <= first and last <= b for a, b in stretches) for first, last in bounds], dtype=bool)
