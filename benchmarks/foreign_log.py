"""A foreign flight as files: Kitemill's kite.csv and wind.csv, or, where flow angles are logged, a CSV with a flight.yaml that maps it.

Written from the formats' description, not by our own writer: units, signs and clocks of the reader are tried, too.
"""

from collections.abc import Mapping

import numpy as np
import polars as pl
import yaml
from foreign_faults import with_faults
from foreign_formula import number
from foreign_kinds import Kind
from foreign_names import Scene
from foreign_world import ForeignFlight

from awescli.flightlog.log import WindRecord
from awescli.simulation.made_wind import as_measured

EPOCH_MS = 1_651_000_000_000
"""Unix time of the first row: an arbitrary constant."""
KGF = 9.80665
"""[N]"""
STATION = 10.0
"""[m] height of the only weather station of a mapped log."""
DIGITS = 4
_DEGREES = 180 / np.pi
COLUMNS = {
    **{f"a_eb_b{axis.upper()}": (f"a_{axis}", 1.0) for axis in "xyz"},
    **{f"v_eb_e{axis.upper()}": (f"v_{axis}", 1.0) for axis in "den"}, **{f"r_eb_e{axis.upper()}": (f"p_{axis}", 1.0) for axis in "den"},
    **{name: (name, _DEGREES) for name in ("phi", "theta", "psi", "p", "q", "r")},
    "V_a": ("V_a", 1.0), "LoadFiltered": ("tension", 1 / KGF),
}  # fmt: skip
"""Column -> (channel, factor from SI)."""
VANES = {"alpha_vane": ("alpha", _DEGREES), "beta_vane": ("beta", _DEGREES)}


def written(flight: ForeignFlight, scene: Scene, kind: Kind, seed: int, values: Mapping[str, float]) -> dict[str, str]:
    """File name -> text of the flight's log. The record of the wind has a station's errors, drawn from the seed."""
    wind, vanes = as_measured(scene.wind, seed + 1), kind.conditions.vanes
    columns = {"epoch_ms": EPOCH_MS + np.rint(1000 * flight.time).astype(np.int64)}
    columns["intern_time"] = columns["epoch_ms"] - EPOCH_MS + 5000
    for column, (channel, factor) in {**COLUMNS, **(VANES if vanes else {})}.items():
        if channel == "V_a" and not kind.conditions.pitot:
            continue
        signal = flight.sensed[channel]
        columns[column] = (_wrapped(signal) if channel in ("phi", "psi") else signal) * factor
    for surface, signal in flight.setpoints.items():
        columns[f"{surface}_sp"] = signal * _DEGREES
    columns["camber_sp"] = np.zeros(len(flight.time))
    length, speed = scene.reel_out.at(flight.time - number(kind.world.line.late, values))
    columns["reel_out_speed"], columns["tether_length"] = speed, length
    if kind.conditions.faults:
        columns = with_faults(columns, [name for name in (*COLUMNS, *VANES) if name in columns], flight.rate, seed)
    if not vanes:
        return {"kite.csv": _csv(columns), "wind.csv": _weather(wind)}
    columns |= _station(wind, (columns["epoch_ms"] - EPOCH_MS) / 1000)
    return {"log.csv": _csv(columns), "flight.yaml": yaml.safe_dump(_mapping(), sort_keys=False)}


def _wrapped(angle: np.ndarray) -> np.ndarray:
    """In (-pi, pi]."""
    return np.pi - (np.pi - angle) % (2 * np.pi)


def _csv(columns: Mapping[str, np.ndarray]) -> str:
    table = pl.DataFrame({name: np.round(c, DIGITS) + 0.0 if c.dtype == float else c for name, c in columns.items()})
    return table.fill_nan(None).write_csv()


def _weather(wind: WindRecord) -> str:
    """Rows of time [ns], direction [deg, from], density, speed, height."""
    stamps = EPOCH_MS * 1_000_000 + np.rint(wind.time * 1e9).astype(np.int64)
    heights = wind.height.size
    return _csv({
        "_time": np.repeat(stamps, heights), "direction": np.rad2deg(wind.direction.ravel()) % 360, "rho": np.repeat(wind.density, heights),
        "speed": wind.speed.ravel(), "height": np.tile(wind.height, wind.time.size),
    })  # fmt: skip


def _station(wind: WindRecord, time: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of a station at STATION, as a recorder holds them: a new value where the station has one, and in the first and last row."""
    (station,) = np.flatnonzero(wind.height == STATION)
    new = np.unique(np.clip(np.searchsorted(time, [0.0, *wind.time, time[-1]]), 0, len(time) - 1))
    last = new[np.searchsorted(new, np.arange(len(time)), side="right") - 1]
    speed, direction = (np.interp(time[last], wind.time, values[:, station]) for values in (wind.speed, wind.direction))
    return {"wind_speed": speed, "wind_from": np.rad2deg(direction) % 360, "rho": np.full(len(time), wind.density[0])}


def _mapping() -> dict:
    """flight.yaml of a log with vanes."""
    degrees = {"phi": "phi", "theta": "theta", "psi": "psi", "alpha": "alpha_vane", "beta": "beta_vane"}
    surfaces = {name: f"{name}_sp" for name in ("aileron", "elevator", "rudder", "flaps")}
    units = {
        **{name: (column, "deg") for name, column in {**degrees, **surfaces}.items()}, **{name: (name, "deg/s") for name in "pqr"},
        "V_a": ("V_a", "m/s"), "tension": ("LoadFiltered", "kgf"), "tether_length": ("tether_length", "m"),
        "reel_out_speed": ("reel_out_speed", "m/s"),
    }  # fmt: skip
    return {
        "format": "csv", "file": "log.csv", "time": {"column": "epoch_ms", "unit": "ms"},
        "position": {"columns": ["r_eb_eN", "r_eb_eE", "r_eb_eD"], "unit": "m"},
        "velocity": {"columns": ["v_eb_eN", "v_eb_eE", "v_eb_eD"], "unit": "m/s"},
        "acceleration": {"columns": ["a_eb_bX", "a_eb_bY", "a_eb_bZ"], "unit": "m/s2", "frame": "BODY"},
        "signals": {name: {"column": column, "unit": unit} for name, (column, unit) in units.items()},
        "wind": {"direction": {"column": "wind_from", "unit": "deg"}, "speed": {"column": "wind_speed", "unit": "m/s"},
                 "density": {"column": "rho", "unit": "kg/m3"}, "height": STATION},
    }  # fmt: skip
