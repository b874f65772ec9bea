"""Kitemill's weather CSV <-> WindRecord. One row a time (and a height, where the file has a profile)."""

from pathlib import Path

import numpy as np
import polars as pl

from awescli.flightlog.log import FlightLog, WindRecord
from awescli.flightlog.plausible_units import check_clock
from awescli.flightlog.table import read_header, read_table
from awescli.flightlog.units import factor_to_si
from awescli.notation.errors import BadInput, did_you_mean

REQUIRED = {"_time", "direction", "speed"}
"""Columns of the format: unix time [ns], where the wind comes from [deg], its speed [m/s]."""

FAR = 7200.0
"""s between flight and the nearest weather sample: beyond, it is the weather of another flight."""

MAX_CELLS = 2_000_000
"""times x heights of a profile: three hours of a lidar at 1 Hz and 100 heights have half of it; more is a height column of no heights."""


def read_wind(path: Path, start: float, flight: tuple[float, float], station_height: float) -> tuple[WindRecord, list[str]]:
    """(WindRecord, notes) of a weather file. start: unix time of the flight's stamp 0; flight: its (first, last) stamp [s]."""
    _, header = read_header(path)
    for name in sorted(REQUIRED - set(header)):
        raise BadInput(f"the column '{name}' is missing", f"{path}:1", did_you_mean(name, header))
    table = read_table(path, ("_time", "direction", "speed", "rho", "height"))
    columns, notes = dict(table.columns), list(table.notes)
    check_clock(columns["_time"], "ns", f"{path}: column _time")
    columns.setdefault("height", np.full(len(table), station_height))
    usable = (
        np.isfinite(columns["_time"]) & np.isfinite(columns["direction"]) & np.isfinite(columns["speed"]) & np.isfinite(columns["height"])
    )
    if not usable.any():
        raise BadInput("no row has time, direction and speed", str(path), "Is the file complete?")
    if not usable.all():
        notes.append(f"{path.name}: {int((~usable).sum())} rows without time, direction or speed were left out.")
    columns = {name: values[usable] for name, values in columns.items()}
    if (columns["speed"] < 0).any() or columns["speed"].max() > 100:
        low, high = columns["speed"].min(), columns["speed"].max()
        raise BadInput(f"wind speeds from {low:g} to {high:g} m/s", f"{path}: column speed", "Expected m/s.")
    # ns since 1970 minus start, in an order that keeps microseconds
    seconds = columns["_time"] * factor_to_si("ns", "s") - start
    if seconds.min() > flight[1] + FAR or seconds.max() < flight[0] - FAR:
        apart = (seconds.min() - flight[1]) if seconds.min() > flight[1] else (flight[0] - seconds.max())
        raise BadInput(
            f"the weather is {apart / 3600:.1f} h away from the flight",
            f"{path}: column _time",
            "Put the weather file of this flight here.",
        )
    if "height" in header and "rho" not in header:
        notes.append(f"{path.name}: no air density.")
    if "height" not in header:
        notes.append(f"{path.name}: no height column, the station is taken to be {station_height:g} m above the winch.")
    return profile(path, seconds, columns), notes


def wind_csv_text(log: FlightLog) -> str:
    """The log's wind as text of a weather file with heights."""
    wind = log.recorded_wind
    heights = wind.height.size
    stamps = np.repeat(np.rint((log.start + wind.time) * 1e6).astype(np.int64) * 1000, heights)
    degrees = np.round(np.mod(np.rad2deg(wind.direction.ravel()), 360.0), 4)
    columns = {
        "_time": pl.Series(stamps),
        "height": pl.Series(np.tile(wind.height, wind.time.size)),
        "direction": pl.Series(np.where(degrees >= 360.0, 0.0, degrees)),
        "speed": pl.Series(wind.speed.ravel()),
    }
    if wind.density is not None:
        columns["rho"] = pl.Series(np.repeat(wind.density, heights))
    return pl.DataFrame(columns).write_csv(float_precision=6)


def profile(path: Path, seconds: np.ndarray, columns: dict[str, np.ndarray]) -> WindRecord:
    """Rows -> (times, heights) tables; a height that lacks a time is interpolated in time."""
    time, row = np.unique(seconds, return_inverse=True)
    height, layer = np.unique(columns["height"], return_inverse=True)
    if time.size * height.size > MAX_CELLS:
        raise BadInput(f"{height.size} heights at {time.size} times", f"{path}: column height", "Expected a few heights, in m.")
    cells = (time.size, height.size)
    speed, direction = np.full(cells, np.nan), np.full(cells, np.nan)
    speed[row, layer] = columns["speed"]
    direction[row, layer] = np.deg2rad(columns["direction"])
    for k in range(height.size):
        known = np.isfinite(speed[:, k])
        speed[:, k] = np.interp(time, time[known], speed[known, k])
        direction[:, k] = np.interp(time, time[known], np.unwrap(direction[known, k]))
    # heights next to each other on the same turn of the compass
    direction += 2 * np.pi * np.cumsum(_turns(direction), axis=1)
    density = None
    if "rho" in columns and np.isfinite(columns["rho"]).any():
        known = np.isfinite(columns["rho"])
        # the mean over the heights: density changes by 1 % in 100 m, less than the heights' noise matters
        times, row = np.unique(seconds[known], return_inverse=True)
        density = np.interp(time, times, np.bincount(row, columns["rho"][known]) / np.bincount(row))
    return WindRecord(time, height, speed, direction, np.zeros(cells), density)


def _turns(direction: np.ndarray) -> np.ndarray:
    """Whole turns to add to every height so that it continues the one below, judged at the first time."""
    turns = np.zeros((1, direction.shape[1]))
    turns[0, 1:] = -np.rint(np.diff(direction[0]) / (2 * np.pi))
    return np.broadcast_to(turns, direction.shape)
