"""The wind of a mapped log -> WindRecord: columns of the log itself, or a weather file of its own with its own clock."""

from pathlib import Path

import numpy as np

from awescli.flightlog.files import FlightFiles
from awescli.flightlog.flight_check import Declared, columns_of_wind, uses
from awescli.flightlog.flight_file import Column, Wind
from awescli.flightlog.kitemill_wind import FAR, profile, read_wind
from awescli.flightlog.log import WindRecord
from awescli.flightlog.mapped_columns import column_in_si, columns_in, stamps_in_seconds
from awescli.flightlog.plausible_units import is_unix
from awescli.flightlog.resample import usable_stamps
from awescli.flightlog.table import Table, read_table
from awescli.notation.errors import BadInput
from awescli.notation.present import present

DRY_AIR = 287.05287
"""[J/(kg K)] gas constant of dry air (ISO 2533); humid air is up to 1 % lighter."""


def mapped_wind(found: FlightFiles, table: Table, seconds: np.ndarray, start: float) -> tuple[WindRecord | None, list[str]]:
    """(the wind record, or None; notes). seconds: (N,) stamps of the log from its first one, which is `start` on its own clock [s]."""
    declared = found.mapping
    wind = declared.file.wind
    span = float(np.nanmin(seconds)), float(np.nanmax(seconds))
    if wind is None:
        return _beside(found, start, span)
    if wind.file is None:
        return _in_the_log(declared, table, seconds), []
    path = present(found.weather, "the weather file of a mapped log")
    if columns_of_wind(wind):
        return _mapped_file(declared, path, start, span)
    height = wind.height if isinstance(wind.height, float) else declared.file.station_height
    return read_wind(path, start, span, height)


def _mapped(declared: Declared) -> Wind:
    """The wind of a flight.yaml that maps one."""
    return present(declared.file.wind, "the wind of a mapped log")


def _direction_and_speed(table: Table, wind: Wind) -> tuple[np.ndarray, np.ndarray]:
    """(N,) rad, where it comes from, and (N,) m/s; both are mapped or none is (`flight_check`)."""
    direction, speed = present(wind.direction, "the wind's direction"), present(wind.speed, "the wind's speed")
    return column_in_si(table, direction, "rad"), column_in_si(table, speed, "m/s")


def _beside(found: FlightFiles, start: float, span: tuple[float, float]) -> tuple[WindRecord | None, list[str]]:
    """A weather file that nobody mapped: used where it is in Kitemill's weather format, named where it is not."""
    path = found.weather
    if path is None:
        why = found.why_no_weather
        return None, [f"{why}; none is used. Name one in flight.yaml: `wind: {{file: ...}}`."] if why else []
    try:
        record, notes = read_wind(path, start, span, found.mapping.file.station_height)
    except BadInput as e:
        do = f"Map it in flight.yaml: `wind: {{file: {path.name}, time: ..., direction: ..., speed: ...}}`."
        return None, [f"{path.name} lies beside the log and is not used: {e.what}. {do}"]
    return record, [f"{path.name} lies beside the log in Kitemill's weather format: used as its wind.", *notes]


def _in_the_log(declared: Declared, table: Table, seconds: np.ndarray) -> WindRecord:
    """Wind columns of the log, at one height; only the samples at which they change are kept."""
    wind = _mapped(declared)
    direction, speed = _direction_and_speed(table, wind)
    keep = np.flatnonzero(np.isfinite(direction) & np.isfinite(speed) & np.isfinite(seconds))
    keep = keep[usable_stamps(seconds[keep])[0]]
    if keep.size == 0:
        raise BadInput("the wind columns hold no value", str(table.path), "Check wind.direction and wind.speed in flight.yaml.")
    new = np.ones(keep.size, bool)
    new[1:] = (np.diff(direction[keep]) != 0) | (np.diff(speed[keep]) != 0)
    new[-1] = True
    keep = keep[new]
    density, values = None, _density(declared, table)
    if values is not None:
        known = np.flatnonzero(np.isfinite(values) & np.isfinite(seconds))
        known = known[usable_stamps(seconds[known])[0]]
        density = np.interp(seconds[keep], seconds[known], values[known]) if known.size else None
    unwrapped = np.unwrap(direction[keep])[:, None]
    return WindRecord(seconds[keep], np.array([wind.height]), speed[keep][:, None], unwrapped, np.zeros((keep.size, 1)), density)


def _mapped_file(declared: Declared, path: Path, start: float, span: tuple[float, float]) -> tuple[WindRecord, list[str]]:
    """A weather file with columns of its own: one row a time, or a time and a height."""
    wind, log_time = _mapped(declared), declared.file.time
    clock = present(wind.time, "the clock of a mapped weather file")
    table = read_table(path, columns_in(use for use in uses(declared.file) if use.of_wind_file))
    stamps = stamps_in_seconds(table, clock)
    known = stamps[np.isfinite(stamps)]
    if known.size == 0:
        raise BadInput("no time stamp can be read", f"{path}: column {clock.column}", "Expected numbers.")
    if is_unix(float(np.median(known))) != is_unix(start):
        which, key = ("weather", "time") if is_unix(float(np.median(known))) else ("log", "wind.time")
        what = f"the {which} counts in unix time and the {'log' if which == 'weather' else 'weather'} does not"
        do = f"Say when the other clock was zero: `start: UNIX_SECONDS` under {key} in flight.yaml."
        raise BadInput(what, declared.where("wind", "time"), do)
    seconds = stamps - start
    direction, speed = _direction_and_speed(table, wind)
    columns = {"direction": np.rad2deg(direction), "speed": speed, "height": _heights(table, wind.height)}
    density = _density(declared, table)
    if density is not None:
        columns["rho"] = density
    usable = np.isfinite(seconds) & np.isfinite(columns["direction"]) & np.isfinite(columns["speed"]) & np.isfinite(columns["height"])
    if not usable.any():
        raise BadInput("no row has time, direction and speed", str(path), "Is the file complete? Are the columns right?")
    notes = [*table.notes, f"{path.name}: wind of {int(usable.sum())} rows."]
    seconds, columns = seconds[usable], {name: values[usable] for name, values in columns.items()}
    if columns["speed"].min() < 0 or columns["speed"].max() > 100:
        what = f"wind speeds from {columns['speed'].min():g} to {columns['speed'].max():g} m/s"
        raise BadInput(what, declared.where("wind", "speed"), "Correct its unit, sign or scale.")
    apart = max(float(seconds.min()) - span[1], span[0] - float(seconds.max()))
    if apart > FAR:
        began = "set" if log_time is not None and log_time.start else "not set"
        do = f"Take the weather of this flight, or correct the clocks: `time.start` ({began}), units."
        raise BadInput(f"the weather is {apart / 3600:.1f} h away from the flight", declared.where("wind", "time"), do)
    return profile(path, seconds, columns), notes


def _heights(table: Table, height: float | Column) -> np.ndarray:
    """(N,) m: of every row."""
    return column_in_si(table, height, "m") if isinstance(height, Column) else np.full(len(table), height)


def _density(declared: Declared, table: Table) -> np.ndarray | None:
    """(N,) kg/m3: as logged, or of dry air at the logged temperature and pressure; None where neither is."""
    wind = _mapped(declared)
    if wind.density is not None:
        return column_in_si(table, wind.density, "kg/m3")
    if wind.temperature is None or wind.pressure is None:
        return None
    return column_in_si(table, wind.pressure, "Pa") / (DRY_AIR * column_in_si(table, wind.temperature, "K"))
