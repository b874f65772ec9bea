"""draft: a CSV of unknown layout -> what its columns are, as far as headers and numbers tell, and what a model still needs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from awescli.flightlog.drafting.attitude import ANGLES, find_attitude, find_rates, turned_forward
from awescli.flightlog.drafting.clock import clock
from awescli.flightlog.drafting.line import FAR, Line, find_line, winch_height, winch_place
from awescli.flightlog.drafting.path import POSITION, Alternative, find_path
from awescli.flightlog.drafting.pool import Entry, Pool, pool_of
from awescli.flightlog.drafting.rest import Rest, find_rest
from awescli.flightlog.drafting.weather import Weather, wind_beside, wind_in_the_log
from awescli.flightlog.geodesy import geodetic_from_ned
from awescli.flightlog.plausible_units import is_unix
from awescli.flightlog.read import NEEDED_BY_MODEL, NEEDED_ON_LINE
from awescli.flightlog.resample import usable_stamps
from awescli.notation.errors import BadInput
from awescli.notation.present import present
from awescli.notation.quantities import OF_LINE, SURFACES

BETTER = 1 / 3
"""What moving the origin to the winch must make of the difference between range and line, to be believed."""


@dataclass(frozen=True)
class Draft:
    """What is known of a log. log: the CSV; time: its clock; signals: quantity -> entry; position: parts of a position by angles or by
    latitude, longitude, altitude; origin: (latitude, longitude [deg], altitude [m]) of the winch; velocity_frame: BODY where `signals` hold
    velocities in body axes; rest: what was left out, accelerometers; weather; notes: what bears the draft out, or speaks against it;
    needed: quantities that a model lacks; unused: columns without a meaning."""

    log: Path
    time: Entry | None
    signals: Mapping[str, Entry]
    position: Mapping[str, Entry]
    origin: tuple[float, float, float] | None
    velocity_frame: str
    rest: Rest
    weather: Weather | None
    notes: tuple[str, ...]
    needed: tuple[str, ...]
    unused: tuple[str, ...]

    @property
    def doubtful(self) -> tuple[str, ...]:
        """What somebody should look at."""
        notes = (*self.notes, *self.rest.notes, *(self.weather.notes if self.weather else ()))
        return tuple(n for n in notes if n.startswith("CHECK"))


def draft(log: Path, weather: Sequence[Path] = ()) -> Draft:
    """What the columns of `log` are; weather: files that may hold its wind. Raises BadInput for a file that is no CSV, or has no clock."""
    pool = pool_of(log)
    time = clock(pool)
    if time is None:
        named = ", ".join(r.column for r in pool.of("time")) or f"none of: {', '.join(pool.header[:12])}"
        what = f"no column is a clock that runs forward at 1 to 1000 Hz (looked at {named})"
        raise BadInput(what, str(log), "A log needs a column of numbers such as 'time [s]' or 'timestamp_ms'.")
    seconds = time.si(pool.values[time.column], "s")
    rows, _ = usable_stamps(seconds)
    pool, start, seconds = _cut(pool, rows), float(seconds[rows[0]]), seconds[rows] - seconds[rows[0]]
    turning = find_attitude(pool)
    known = turning.angles if set(turning.angles) == set(ANGLES) else None
    path = find_path(pool, seconds, known)
    velocity = None if path.velocity is None else path.velocity.ned
    if path.velocity is not None and path.velocity.frame != "BODY":
        turning = turned_forward(pool, turning, path.velocity.ned)
    turning = find_rates(pool, seconds, turning)
    position, place, origin, line, moved = _from_the_winch(pool, seconds, path.position)
    rest = find_rest(pool, seconds, velocity, turning.angles if set(turning.angles) == set(ANGLES) else None)
    signals = {**position, **(path.velocity.entries if path.velocity else {}), **turning.entries, **line.entries, **rest.entries}
    signals = {name: signals[name] for name in sorted(signals, key=_order)}
    wind = wind_in_the_log(pool, place) or wind_beside(weather, is_unix(start), place)
    notes = [*path.notes, *moved, *turning.notes, *line.notes]
    parts = {n: e for n, e in signals.items() if n.startswith("position.")}
    signals = {n: e for n, e in signals.items() if n not in parts}
    if wind is not None and wind.time is not None and is_unix(start) != _unix(wind):
        notes.append("CHECK: log and weather count from different zeros; say `start` under time")
    return Draft(
        log, time, signals, parts, origin, path.velocity.frame if path.velocity else "", rest, wind, tuple(notes),
        _needed(signals, parts, wind), _unused(pool, time, signals, parts, rest, wind),
    )  # fmt: skip


def _cut(pool: Pool, rows: np.ndarray) -> Pool:
    """The same columns at the rows whose stamps run forward."""
    return replace(pool, values={name: values[rows] for name, values in pool.values.items()})


def _order(name: str) -> int:
    known = (*POSITION, "v_n", "v_e", "v_d", *ANGLES, "p", "q", "r", "V_a", "alpha", "beta", "tension", *SURFACES)
    return known.index(name) if name in known else len(known)


def _from_the_winch(pool: Pool, seconds: np.ndarray, found: Alternative | None) -> tuple[
    dict[str, Entry], np.ndarray | None, tuple[float, float, float] | None, Line, tuple[str, ...]
]:  # fmt: skip
    """(entries of the position, position (3, N) from the winch or None, origin of a geodetic one, the line, notes). Positions that count
    from elsewhere are moved to where they are as far as the line is long."""
    if found is None:
        return {}, None, None, find_line(pool, seconds, None), ()
    geodetic, place = found.frame == "geodetic", found.ned
    line = find_line(pool, seconds, None if geodetic else _range(place))
    if line.length is None:
        note = ("CHECK: without a line length nothing tells where the winch stands: write its `origin`",) if geodetic else ()
        return dict(found.entries), None if geodetic else place, None, line, note
    before = _misfit(place, line.length)
    tried = [winch_place(place, line.length)] if geodetic else [winch_height(place, line.length), winch_place(place, line.length)]
    best = next((t for t in tried if t is not None and (geodetic or (t[1] < BETTER * before and np.linalg.norm(t[0]) > FAR))), None)
    if best is None:
        said = ("CHECK: no place of the winch makes the range the line's length: write its `origin`",) if geodetic else ()
        return dict(found.entries), None if geodetic else place, None, line, said
    moved = place - best[0][:, None]
    line = find_line(pool, seconds, _range(moved))
    if geodetic:
        origin, note = _origin(pool, found, best[0]), f"the winch stands where the range is the line's length, within {best[1]:.1f} m"
        return dict(found.entries), moved, origin, line, (f"CHECK: {note}; write its surveyed place as `origin` if you have it",)
    n, e, d = best[0]
    note = f"CHECK: the winch stands {n:+.0f} m north, {e:+.0f} m east, {-d:+.0f} m above the log's origin, by the line's length"
    return _shifted(found, best[0]), moved, None, line, (note,)


def _range(position: np.ndarray) -> np.ndarray:
    return np.sqrt((position**2).sum(0))


def _misfit(position: np.ndarray, length: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean((_range(position) - length) ** 2)))


def _shifted(found: Alternative, place: np.ndarray) -> dict[str, Entry]:
    """The entries with offsets that make `place` (3,) their origin."""
    entries = {}
    for (name, line), off in zip(found.entries.items(), place, strict=True):
        one = line.si(np.ones(1), "m")[0] - line.si(np.zeros(1), "m")[0]
        per_unit = abs(one) / line.scale
        # what is below a metre is the line's sag, not a place
        entries[name] = replace(line, offset=round(-off / per_unit, 1)) if abs(off) > 1.0 else line
    return entries


def _origin(pool: Pool, found: Alternative, place: np.ndarray) -> tuple[float, float, float]:
    """(latitude, longitude [deg], altitude [m]) of a place (3,) north, east, down from the first known position."""
    first = [e.si(pool.values[e.column], si) for e, si in zip(found.entries.values(), ("rad", "rad", "m"), strict=True)]
    at = int(np.flatnonzero(np.isfinite(sum(first)))[0])
    lat, lon, alt = geodetic_from_ned(place, (float(first[0][at]), float(first[1][at]), float(first[2][at])))
    return round(math.degrees(lat), 7), round(math.degrees(lon), 7), round(alt, 2)


def _unix(wind: Weather) -> bool:
    clock = present(wind.time, "the clock of a weather file")
    stamps = pool_of(present(wind.file, "the weather file"), weather=True).values[clock.column]
    return is_unix(float(np.nanmedian(clock.si(stamps, "s"))))


def _needed(signals: Mapping[str, Entry], parts: Mapping[str, Entry], wind: Weather | None) -> tuple[str, ...]:
    """Quantities without which there is no model."""
    there = {*signals, *(POSITION if parts else ())}
    on_line = any(name in there for name in OF_LINE)
    missing = [name for name in (*NEEDED_BY_MODEL, *(NEEDED_ON_LINE if on_line else ())) if name not in there]
    if not {"aileron", "elevator", "rudder"} & there:
        missing.append("rudder")
    if wind is None or not (wind.kitemill or {"direction", "speed"} <= set(wind.entries or ())):
        missing.append("wind")
    return tuple(missing)


def _unused(
    pool: Pool, time: Entry, signals: Mapping[str, Entry], parts: Mapping[str, Entry], rest: Rest, wind: Weather | None
) -> tuple[str, ...]:  # fmt: skip
    """Columns that nothing was made of."""
    own = (wind.entries or {}).values() if wind is not None and wind.file is None else ()
    used = {time.column, *(e.column for e in (*signals.values(), *parts.values(), *own)), *(c for _, c, _ in rest.left)}
    used |= set(rest.accelerations[0]) if rest.accelerations else set()
    return tuple(name for name in pool.header if name not in used)
