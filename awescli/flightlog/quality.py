"""data_quality: all that `awes check` says about a log, as numbers and sentences."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from math import comb

import numpy as np

from awescli.flightlog.consistency import Check, consistency_checks, most
from awescli.flightlog.enough import enough_checks
from awescli.flightlog.log import FlightLog, runs_of
from awescli.flightlog.loops import Loops, find_loops
from awescli.flightlog.other_readings import reading_checks
from awescli.flightlog.phases import phase_durations, phases
from awescli.flightlog.physical import physical_checks
from awescli.flightlog.ranges import PartRanges, loop_ranges, part_ranges, ranges_check
from awescli.flightlog.read import missing_for_model
from awescli.flightlog.split import Split
from awescli.notation.quantities import UNITS

DISPLAY = {"rad": ("deg", 180 / np.pi), "rad/s": ("deg/s", 180 / np.pi)}
"""SI unit -> (unit shown, factor)."""

NOISE_ORDER = 4
"""Differences of this order remove what a kite does in a few samples and leave white noise."""

MOST_STRETCHES = 500
"""Stretches listed one by one; the sums in `left_out` count all."""

MAX_INVALID, NO_LOG = 10.0, 60.0
"""Percent of the samples that may be invalid before the log is called poor, and before what is left is no flight."""


@dataclass(frozen=True)
class Channel:
    """One signal in display units: smallest, largest, white noise standard deviation (None where it cannot be determined), group."""

    name: str
    unit: str
    low: float
    high: float
    noise: float | None
    group: str


@dataclass(frozen=True)
class Stretch:
    """Flown time that is not used: from, to [s from the start of the log], and why."""

    begin: float
    end: float
    why: str


@dataclass(frozen=True)
class DataQuality:
    """What a log holds and how good it is; every number finite. ranges: of the parts, where it is known how loops are dealt."""

    name: str
    rate: float
    duration: float
    samples: int
    counters: Mapping[str, int]
    channels: tuple[Channel, ...]
    checks: tuple[Check, ...]
    phases: Mapping[str, float]
    loops: str
    loop_count: int
    left_out: Mapping[str, float]
    stretches: tuple[Stretch, ...]
    missing: tuple[str, ...]
    notes: tuple[str, ...]
    ranges: tuple[PartRanges, ...] = ()

    @property
    def ok(self) -> bool:
        """All checks passed and nothing missing for a model."""
        return not self.missing and all(check.ok for check in self.checks)

    @property
    def stopping(self) -> tuple[Check, ...]:
        """The checks beyond which nothing that is fitted would mean anything."""
        return tuple(check for check in self.checks if check.stops)

    def as_dict(self) -> dict:
        """Plain data, ready for JSON."""
        return {**asdict(self), "ok": self.ok}


def data_quality(
    log: FlightLog, needed: Iterable[str] | None = None, parts: Split | None = None, further: Iterable[Check] = ()
) -> DataQuality:
    """Rate, gaps, ranges, noise, faults, consistency, phases, loops and what is missing, of a log as `read_flight` gives it.

    needed: channels that the kite needs (`missing_for_model`); parts: how loops are dealt: then also whether validation and test leave what
    train has flown; further: checks that others made of the log, who know the kite.
    """
    labels = phases(log)
    loops = find_loops(log, labels)
    airborne = (labels != "ground") & (labels != "hover")
    invalid = 100 * float((~log.valid).mean())
    longest = runs_of(~log.valid)
    checks = (
        most("invalid samples", invalid, "%", MAX_INVALID, NO_LOG, "Filled over gaps, or faulty.", "See what made them so: left out."),
        _sensor_faults(log),
        *enough_checks(log, airborne, loops),
        *physical_checks(log, airborne),
        *consistency_checks(log, airborne),
        *reading_checks(log, airborne),
        *further,
    )
    ranges = part_ranges(loop_ranges(log, loops.bounds), loops.bounds, parts.stretches) if parts else ()
    if parts:
        checks += (ranges_check(ranges),)
    channels = []
    for name in (*log.measured, *log.inputs):
        unit, factor = DISPLAY.get(UNITS[name], (UNITS[name], 1.0))
        values = log[name][log.valid] if log.valid.any() else log[name]
        # set-points are exact: their steps are no noise
        new = log.is_new(name)
        noise = white_noise(log[name][new], log.valid[new]) if name in log.measured else None
        shown = None if noise is None else noise * factor
        channels.append(
            Channel(name, unit, float(values.min()) * factor, float(values.max()) * factor, shown, log.groups.get(name, "onboard"))
        )
    in_loops = np.zeros(len(log), bool)
    for first, last in loops.bounds:
        in_loops[first:last] = True
    left_out = {
        "not flying": float((~airborne).sum() * log.dt),
        "flying, outside whole loops": float((airborne & ~in_loops).sum() * log.dt),
        "invalid inside loops": float((in_loops & ~log.valid).sum() * log.dt),
        "longest invalid stretch": float((longest[:, 1] - longest[:, 0]).max() * log.dt) if len(longest) else 0.0,
    }
    left_out |= {f"invalid: {cause}": float((bounds[:, 1] - bounds[:, 0]).sum() * log.dt) for cause, bounds in log.causes.items()}
    for out in loops.left_out:
        key = f"{loops.kind} left out: {out.reason}"
        left_out[key] = left_out.get(key, 0.0) + (out.last - out.first) * log.dt
    return DataQuality(
        name=log.name, rate=1 / log.dt, duration=len(log) * log.dt, samples=len(log), counters=dict(log.counters), channels=tuple(channels),
        checks=checks, phases=phase_durations(labels, log.dt), loops=loops.sentence,
        loop_count=len(loops) if loops.kind == "loops" else 0, left_out=left_out,
        stretches=_stretches(log, loops), missing=tuple(missing_for_model(log, needed)), notes=log.notes, ranges=ranges,
    )  # fmt: skip


def _stretches(log: FlightLog, loops: Loops) -> tuple[Stretch, ...]:
    """Where and why samples are invalid and loops left out, in the order of time; the longest MOST_STRETCHES."""
    found = [(first, last, cause) for cause, bounds in log.causes.items() for first, last in bounds.tolist()]
    found += [(out.first, out.last, f"{loops.kind}: {out.sentence}") for out in loops.left_out]
    longest = sorted(sorted(found, key=lambda s: s[0] - s[1])[:MOST_STRETCHES])
    return tuple(Stretch(float(log.time[a]), float(log.time[a] + (b - a) * log.dt), why) for a, b, why in longest)


def _sensor_faults(log: FlightLog) -> Check:
    """What `faults.mark_faults` found, as a check; its sentences stand in the notes."""
    seconds, dead = log.counters.get("faulty_samples", 0) * log.dt, log.counters.get("dead_signals", 0)
    sentence = f"Stuck or saturated sensors; {dead} signals left out as dead." if dead else "Time with a stuck or saturated sensor."
    return Check("sensor faults", seconds, "s", 0.0, seconds == 0 and dead == 0, sentence)


def white_noise(signal: np.ndarray, valid: np.ndarray | None = None, order: int = NOISE_ORDER) -> float | None:
    """Standard deviation of white noise on a smooth signal (N,), from its differences of high order; None below 50 of them.

    Differences of order n of white noise have the variance C(2n, n). The median keeps jumps (wraps, gaps) out of it.
    """
    if signal.size <= order:
        return None
    difference = np.diff(signal, order)
    if valid is not None:
        bad = np.convolve(~valid, np.ones(order + 1), "valid") > 0
        difference = difference[~bad]
    if difference.size < 50:
        return None
    return float(1.4826 * np.median(np.abs(difference)) / np.sqrt(comb(2 * order, order)))
