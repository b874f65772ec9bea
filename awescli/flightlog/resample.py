"""Irregular samples -> one uniform clock. Samples that already lie on it keep every bit; gaps are marked, never hidden."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import median_filter

from awescli.flightlog.clocks import moving_average
from awescli.flightlog.held import first_rows
from awescli.flightlog.log import FlightLog, WindRecord, runs_of
from awescli.flightlog.regular_rows import regular_rows
from awescli.flightlog.repeats import repeated_rows
from awescli.notation.angles import wrap
from awescli.notation.errors import BadInput
from awescli.notation.quantities import ANGLES, MEASURED, SURFACES

ON_GRID = 0.05
"""Share of the sample interval by which a sample may miss a grid point and still stand for it. At 50 Hz and 30 m/s: 3 cm."""

STAMP_ROUNDING = 6e-4
"""s: loggers round stamps to milliseconds, so a perfectly regular 30 Hz log misses its grid by up to half of one."""

BESIDE = 1.9
"""Sample intervals between two samples that are neighbours: with irregular stamps, too; from 2 on a row is missing."""

STRAY = 10.0
"""Sample intervals by which a single stamp must leave its neighbours, there and back, to be called stray."""

INDISPENSABLE = (*MEASURED[:12], *SURFACES)
"""Without position, velocity, attitude, rates and set-points a sample is no sample; what else has its own rate is then only not new."""

MAX_STRETCH = 20
"""A grid with more points than this per sample is a wrong clock, not a log with gaps (and would fill the memory)."""

MAX_VALUES = 60_000_000
"""Points of a grid times signals: six hours at 100 Hz with 27 signals, half a gigabyte."""


@dataclass(frozen=True)
class RawFlight:
    """What a reader took from the files: SI, NED/FRD, on the file's own stamps.

    start: unix time of stamp 0 [s]; stamps: (N,) s; signals: quantity -> (N,), NaN where missing; groups: quantity ->
    clock group; late: clock group -> s by which its records come late (its value stamped t belongs to t - late);
    wind: WindRecord on the same stamps; where: the file, for messages; spikes: quantity -> samples taken as missing;
    own_stamps: quantity -> its stamps [s], on the clock of `stamps`, where its sensor has a rate of its own.
    """

    name: str
    start: float
    stamps: np.ndarray
    signals: Mapping[str, np.ndarray]
    where: str
    groups: Mapping[str, str] = field(default_factory=dict)
    late: Mapping[str, float] = field(default_factory=dict)
    wind: WindRecord | None = None
    notes: tuple[str, ...] = ()
    spikes: Mapping[str, int] = field(default_factory=dict)
    own_stamps: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class _Placement:
    """Where the grid points fall among the samples: the sample that stands for a point, or its two neighbours; close: no row is missing
    between these."""

    left: np.ndarray
    right: np.ndarray
    nearest: np.ndarray
    exact: np.ndarray
    fraction: np.ndarray
    known: np.ndarray
    close: np.ndarray


def uniform_log(raw: RawFlight, max_gap: float = 0.2) -> FlightLog:
    """The flight on a uniform clock.

    Repeated, backward and stray stamps are removed; rows that were taken regularly and stamped when they came are put back in their places.
    Points between samples are interpolated (angles over the short way round,
    surfaces held), and are new (`FlightLog.fresh`) only where no row is missing between these; over gaps longer than `max_gap` [s] (at
    least 1.5 sample intervals) they are filled and marked invalid. A signal with stamps of its own is averaged over a sample interval where
    it is faster, so that vibration does not fold into it; where it is slower, it is new only at the points next to its stamps. Of a signal
    whose values stand in several rows, each counts where it came. Raises BadInput where fewer than 3 usable samples remain or the stamps
    cannot be a clock.
    """
    keep, removed = usable_stamps(raw.stamps)
    if keep.size < 3:
        raise BadInput(f"{keep.size} samples with usable time stamps", raw.where, "At least 3 are needed; is the time column right?")
    notes = list(raw.notes)
    dt = sample_interval(raw.stamps[keep])
    keep, stamps = _as_taken(raw, keep, dt, notes)
    count = int(round((stamps[-1] - stamps[0]) / dt)) + 1
    if count > MAX_STRETCH * keep.size + 1000:
        raise BadInput(
            f"{keep.size} samples are spread over {stamps[-1] - stamps[0]:.0f} s though most are {dt:g} s apart",
            raw.where,
            "Check the unit of the time column; cut the log into its flights.",
        )
    if count * len(raw.signals) > MAX_VALUES:
        what = f"{len(raw.signals)} signals at {count} points of {dt:g} s are too many (limit {MAX_VALUES} values)"
        raise BadInput(what, raw.where, "Cut the log into its flights.")
    origin, time = stamps[0], np.arange(count) * dt
    max_gap = max(max_gap, 1.5 * dt)
    between = _place(time, stamps - origin, dt, max_gap)
    valid, causes = between.known.copy(), {"gap": runs_of(~between.known)}
    filled, signals, fresh = 0, {}, {}
    held = first_rows(stamps, {n: x[keep] for n, x in raw.signals.items() if n not in raw.own_stamps and n not in SURFACES})
    if held:
        notes.append(f"{', '.join(held)}: a value stands in several rows; it counts in the first of them, where it came.")
    own_stamps = {**raw.own_stamps, **{n: _in_all_rows(at, keep, raw.stamps.size) for n, at in held.items()}}
    placements: dict[float, _Placement] = {}
    for name, column in raw.signals.items():
        late = raw.late.get(raw.groups.get(name, "onboard"), 0.0)
        if name in own_stamps:
            own = _at_own_rate(own_stamps[name] - origin - late, column, time, dt, max_gap, name, stands=name in held)
            if own is None:
                notes.append(f"{name} has fewer than two values and was left out.")
                continue
            signals[name], known, new = own
            if name in INDISPENSABLE:
                valid &= known
                causes[f"{name} missing"] = runs_of(between.known & ~known)
            if not (new & known).all():
                fresh[name] = new & known
            continue
        values = column[keep]
        good = np.isfinite(values)
        if not good.any():
            notes.append(f"{name} has no value at all and was left out.")
            continue
        if good.all():
            if late not in placements:
                placements[late] = _place(time, stamps - origin - late, dt, max_gap)
            placement = placements[late]
        else:
            values = values[good]
            placement = _place(time, stamps[good] - origin - late, dt, max_gap)
            filled += int((~good).sum())
        signals[name] = _take(values, placement, name, held=name in SURFACES)
        # what is on the line over missing rows is no measurement
        if name not in SURFACES and not (placement.close | ~placement.known).all():
            fresh[name] = placement.close & placement.known
        valid &= placement.known
        causes[f"{name} missing"] = runs_of(between.known & ~placement.known)
    if not signals:
        raise BadInput("no signal holds a value", raw.where, "Check the columns.")
    counters = {
        "rows": int(raw.stamps.size), **removed, "interpolated": int((~between.exact & between.known).sum()),
        "gaps": int((np.diff(stamps) > max_gap).sum()), "gap_samples": int((~between.known).sum()), "missing_cells": filled,
        "spikes": sum(raw.spikes.values()),
        "pasted_rows": int(repeated_rows(x[keep] for name, x in raw.signals.items() if name not in raw.own_stamps).sum()),
    }  # fmt: skip
    return FlightLog(
        name=raw.name,
        start=raw.start + float(origin),
        dt=dt,
        time=time,
        measured={k: s for k, s in signals.items() if k in MEASURED},
        inputs={k: s for k, s in signals.items() if k not in MEASURED},
        valid=valid,
        wind=None if raw.wind is None else replace(raw.wind, time=raw.wind.time - origin),
        groups={k: g for k, g in raw.groups.items() if k in signals or k == "wind"},
        notes=(*notes, *_say(counters, dt, max_gap, raw)),
        counters=counters,
        causes={cause: bounds for cause, bounds in causes.items() if len(bounds)},
        fresh=fresh,
    )


def _as_taken(raw: RawFlight, keep: np.ndarray, dt: float, notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """(rows, (N,) s at which they were taken): as stamped, unless motion shows that they were regular and only their stamps wobble."""
    stamps = raw.stamps[keep]
    columns = {n: x[keep] for n, x in raw.signals.items() if n in MEASURED and n not in raw.own_stamps}
    seen = regular_rows(stamps, dt, columns, STAMP_ROUNDING)
    if seen is None or not seen.clear:
        return keep, stamps
    unclear = int((~seen.alone).sum())
    more = f"; {unclear} of them, whose turn is not clear, were left out" if unclear else ""
    share = f"{seen.share:.2f} +- {seen.error:.2f}"
    notes.append(
        f"Stamps wobble by {1000 * seen.wobble:.1f} ms about a regular clock, and motion shows {share} of that: rows are regular{more}."
    )
    return keep[seen.alone], seen.times[seen.alone]


def _in_all_rows(stamps: np.ndarray, keep: np.ndarray, count: int) -> np.ndarray:
    """Stamps of the kept rows -> (count,), NaN in the others."""
    whole = np.full(count, np.nan)
    whole[keep] = stamps
    return whole


def _at_own_rate(
    stamps: np.ndarray, values: np.ndarray, time: np.ndarray, dt: float, max_gap: float, name: str, stands: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """(values on the grid, points that are known, points next to which there is a new value), each (N,), of a signal with stamps of its
    own; None where it has fewer than two values. stands: each stood in the rows until the next came, so which are new is known."""
    rows = np.flatnonzero(np.isfinite(values) & np.isfinite(stamps))
    rows = rows[usable_stamps(stamps[rows])[0]]
    if rows.size < 2:
        return None
    stamps, values = stamps[rows], values[rows]
    interval = sample_interval(stamps)
    if (many := int(round(dt / interval))) > 1 and name not in SURFACES:
        values = moving_average(np.unwrap(values) if name in ANGLES else values, many)
    placement = _place(time, stamps, dt, max(max_gap, 1.5 * interval))
    nearest = np.clip(np.rint((stamps - time[0]) / dt).astype(int), 0, time.size - 1)
    new = np.zeros(time.size, bool)
    new[nearest[np.abs(stamps - time[nearest]) <= dt]] = True
    if interval < 1.5 * dt and not stands:
        new |= placement.known
    # a set-point that comes slower than the clock was logged now and then by a controller that went on: between, it is on the line
    taken = _take(values, placement, name, held=name in SURFACES and interval < 1.5 * dt)
    return wrap(taken) if name in ANGLES else taken, placement.known, new


def usable_stamps(stamps: np.ndarray) -> tuple[np.ndarray, dict[str, int]]:
    """Indices of the samples whose stamps run forward, and how many were removed as unreadable, stray, repeated, backward."""
    index = np.flatnonzero(np.isfinite(stamps))
    unreadable = stamps.size - index.size
    stray = 0
    if index.size > 4:
        t = stamps[index]
        step = np.diff(t)
        typical = float(np.median(step[step > 0])) if (step > 0).any() else 0.0
        # the median of a rising window is its middle, whatever the gaps: only a stamp that leaves and returns differs
        off = np.abs(t - median_filter(t, 5, mode="nearest")) > STRAY * typical
        stray = int(off.sum())
        index = index[~off]
    t = stamps[index]
    latest = np.maximum.accumulate(t) if t.size else t
    forward = np.ones(t.size, bool)
    forward[1:] = t[1:] > latest[:-1]
    repeated = np.zeros(t.size, bool)
    repeated[1:] = t[1:] == latest[:-1]
    backward = int((~forward & ~repeated).sum())
    return index[forward], {"unreadable": unreadable, "stray": stray, "repeated": int(repeated.sum()), "backward": backward}


def sample_interval(stamps: np.ndarray) -> float:
    """Sample interval [s] of rising stamps: the mean of the ordinary steps, snapped to a whole rate where it is within 1 %."""
    step = np.diff(stamps)
    median = float(np.median(step))
    # the mean of the steps near the median, since stamps in ms give 33, 33, 34 at 30 Hz
    near = step[(step > 0.5 * median) & (step < 1.5 * median)]
    mean = float(near.mean()) if near.size else median
    rate = 1.0 / mean
    if rate >= 1 and abs(round(rate) / rate - 1) < 0.01:
        return 1.0 / round(rate)
    return round(mean, 4) if mean >= 0.01 else mean


def _place(time: np.ndarray, stamps: np.ndarray, dt: float, max_gap: float) -> _Placement:
    """The samples around every grid point; a point is known where a sample stands for it or the samples around are close."""
    right = np.searchsorted(stamps, time)
    left = np.clip(right - 1, 0, stamps.size - 1)
    right = np.clip(right, 0, stamps.size - 1)
    nearest = np.where(np.abs(stamps[right] - time) < np.abs(stamps[left] - time), right, left)
    tolerance = min(max(ON_GRID * dt, STAMP_ROUNDING), 0.25 * dt)
    exact = np.abs(stamps[nearest] - time) <= tolerance
    step = stamps[right] - stamps[left]
    inside = (time >= stamps[0]) & (time <= stamps[-1])
    fraction = np.where(step > 0, (time - stamps[left]) / np.where(step > 0, step, 1.0), 0.0)
    known, close = exact | (inside & (step <= max_gap)), exact | (inside & (step < BESIDE * dt))
    return _Placement(left, right, nearest, exact, np.clip(fraction, 0.0, 1.0), known, close)


def _take(values: np.ndarray, at: _Placement, name: str, held: bool) -> np.ndarray:
    """One signal on the grid; held: each value holds until the next one, as a set-point does; over missing rows a controller went on."""
    before, after = values[at.left], values[at.right]
    between = before + at.fraction * (wrap(after - before) if name in ANGLES else after - before)
    if held:
        between = np.where(at.close, before, between)
    taken = np.where(at.exact, values[at.nearest], between)
    return wrap(taken) if name in ANGLES else taken


def _say(counters: Mapping[str, int], dt: float, max_gap: float, raw: RawFlight) -> list[str]:
    """The counters that are not zero, one sentence each."""
    sentences = {
        "unreadable": "{} rows without a readable time stamp were removed.",
        "stray": "{} rows with a stray time stamp were removed.",
        "repeated": "{} rows with a repeated time stamp were removed (the first of each is kept).",
        "backward": "{} rows whose time stamps run backward were removed.",
        "interpolated": f"{{}} samples were interpolated to the uniform clock of {dt:g} s.",
        "gaps": f"{{}} gaps are longer than {max_gap:g} s; the samples inside are marked invalid.",
        "spikes": f"{{}} spikes were taken as missing ({', '.join(f'{n} {k}' for k, n in raw.spikes.items())}).",
        "pasted_rows": "{} rows stand in blocks that the log holds twice.",
        "missing_cells": "{} missing values: short stretches interpolated, longer ones marked invalid.",
    }
    said = [text.format(counters[key]) for key, text in sentences.items() if counters[key]]
    return said + [f"The {group} clock was moved by {-s:+.2f} s." for group, s in raw.late.items() if s]
