"""The wind: columns of the log, or a file beside it with weather, wind or met in its name or its header."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from awescli.flightlog.drafting.clock import clock
from awescli.flightlog.drafting.headers import Reading
from awescli.flightlog.drafting.pool import Entry, Pool, also, entry, high, pool_of
from awescli.flightlog.kitemill_wind import REQUIRED
from awescli.flightlog.table import read_header
from awescli.notation.errors import BadInput

NAMED = re.compile(r"wind|weather|met(?![a-z])|meteo|lidar|lighthouse|anemo|mast|station", re.IGNORECASE)
DENSITIES = (0.6, 1.5)
"""kg/m3 between the top of a mountain and a cold day at sea."""


@dataclass(frozen=True)
class Weather:
    """The wind of a draft. file: None for columns of the log; kitemill: it is in Kitemill's weather format and needs no columns; time: its
    own clock; entries: part -> entry; left: parts that were not mapped, and why; notes."""

    file: Path | None = None
    kitemill: bool = False
    time: Entry | None = None
    entries: dict[str, Entry] | None = None
    left: tuple[tuple[str, str, str], ...] = ()
    notes: tuple[str, ...] = ()


def weather_files(folder: Path, log: Path | None) -> list[Path]:
    """CSV files of a folder that are weather by name, or by a header with wind in it; the likeliest first."""
    found = []
    for path in sorted(folder.glob("*.csv")):
        if log is not None and path.resolve() == log.resolve():
            continue
        try:
            header = read_header(path)[1]
        except BadInput:
            continue
        windy = bool(REQUIRED <= set(header) or any("wind" in name.lower() for name in header))
        if NAMED.search(path.stem) or windy:
            found.append((not (NAMED.search(path.stem) and windy), path))
    return [path for _, path in sorted(found, key=lambda f: f[0])]


def wind_in_the_log(pool: Pool, position: np.ndarray | None) -> Weather | None:
    """Wind columns of the log itself; None where it has no speed and direction."""
    direction, speed = pool.best("wind.direction"), pool.best("wind.speed")
    if direction is None or speed is None:
        return None
    entries, left, notes = _parts(pool, position)
    entries.pop("height", None)
    return Weather(entries=entries, left=left, notes=notes)


def wind_beside(files: Sequence[Path], unix: bool | None, position: np.ndarray | None) -> Weather | None:
    """The first of the files that holds direction and speed; None where there is no file. unix: the log's clock is unix time."""
    for path in files:
        if REQUIRED <= set(read_header(path)[1]):
            return Weather(path, kitemill=True)
        try:
            pool = pool_of(path, weather=True)
        except BadInput as e:
            return Weather(path, left=(("wind", path.name, e.what),))
        if pool.of("wind.direction") and pool.of("wind.speed"):
            entries, left, notes = _parts(pool, position)
            time = clock(pool, weather=True, unix=unix)
            if time is None:
                left = (*left, ("time", path.name, "no column of numbers in it is a clock"))
            return Weather(path, time=time, entries=entries, left=left, notes=notes)
    return Weather(files[0], left=(("wind", files[0].name, "no column for direction and speed was found in it"),)) if files else None


def _parts(pool: Pool, position: np.ndarray | None) -> tuple[dict[str, Entry], tuple[tuple[str, str, str], ...], tuple[str, ...]]:
    """(part -> entry, what was left, notes)"""
    entries, left, notes = {}, [], []
    chosen = {part: _first(pool, f"wind.{part}") for part in ("direction", "speed", "density", "height", "temperature", "pressure")}
    if (reading := chosen["direction"]) is not None:
        size = high(pool.values[reading.column])
        line = entry(reading, reading.unit or ("deg" if size > 2 * math.pi + 0.1 else "rad"))
        entries["direction"], said = _from(line, pool.values[line.column], position)
        notes += said
    if (reading := chosen["speed"]) is not None:
        entries["speed"] = replace(entry(reading, reading.unit or "m/s"), assumed="" if reading.unit else "unit")
    if (reading := chosen["density"]) is not None:
        for unit in (reading.unit,) if reading.unit else ("kg/m3", "slug/ft3", "lb/ft3", "g/m3"):
            line = entry(reading, unit)
            if DENSITIES[0] < float(np.nanmedian(line.si(pool.values[line.column], "kg/m3"))) < DENSITIES[1]:
                entries["density"] = line
                break
        else:
            left.append(("density", reading.column, f"its median {np.nanmedian(pool.values[reading.column]):.4g} is no density of air"))
    if (reading := chosen["height"]) is not None:
        entries["height"] = replace(entry(reading, reading.unit or "m"), sign=1, assumed="" if reading.unit else "unit")
    if "density" not in entries:
        entries |= _of_the_gas_law(pool, chosen["temperature"], chosen["pressure"])
    return entries, tuple(left), tuple(notes)


def _first(pool: Pool, quantity: str) -> Reading | None:
    """The likeliest column that holds a value; weather may stand still."""
    return next((r for r in pool.of(quantity) if np.isfinite(pool.values[r.column]).any()), None)


def _from(line: Entry, values: np.ndarray, position: np.ndarray | None) -> tuple[Entry, list[str]]:
    """A kite flies downwind of its winch: a direction that says otherwise is where the wind goes to."""
    if position is None:
        return line, []
    direction = line.si(values[np.isfinite(values)], "rad")
    n, e = -np.cos(direction).mean(), -np.sin(direction).mean()
    place = np.nanmedian(position[0]), np.nanmedian(position[1])
    along = (n * place[0] + e * place[1]) / max(math.hypot(n, e) * math.hypot(*place), 1e-9)
    if along < -0.3:
        half = 180.0 if line.unit == "deg" else math.pi
        return replace(line, offset=half, why=also(line.why, "where it blows to: the kite flies on the other side")), []
    sentence = f"the kite flies {math.degrees(math.acos(max(-1.0, min(1.0, along)))):.0f} deg off the downwind direction"
    return line, [sentence if along > 0.3 else f"CHECK: {sentence}"]


def _of_the_gas_law(pool: Pool, temperature: Reading | None, pressure: Reading | None) -> dict[str, Entry]:
    """Temperature and pressure, where both have plausible units."""
    found = {}
    for part, reading, si, units, limits in (
        ("temperature", temperature, "K", ("degC", "degF", "K"), (230.0, 330.0)),
        ("pressure", pressure, "Pa", ("hPa", "Pa", "kPa", "inHg"), (6e4, 1.1e5)),
    ):
        if reading is None:
            continue
        for unit in (reading.unit,) if reading.unit else units:
            line = entry(reading, unit)
            if limits[0] < float(np.nanmedian(line.si(pool.values[line.column], si))) < limits[1]:
                found[part] = replace(line, assumed="" if reading.unit else "unit by its size")
                break
    return found if len(found) == 2 else {}
