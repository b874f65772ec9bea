"""Kitemill CSV <-> FlightLog: columns, units, signs. The only unit conversions of this format.

A folder holds `kite.csv` and beside it the weather, `lista_fyr_lighthouse.csv` or `wind*.csv` (kitemill_wind.py).
Signs stay as the log has them; the kite file says how its model counts them.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from awescli.flightlog.kitemill_wind import read_wind, wind_csv_text
from awescli.flightlog.log import FlightLog
from awescli.flightlog.plausible_frames import check_frames
from awescli.flightlog.plausible_units import check_clock, check_units
from awescli.flightlog.resample import RawFlight, uniform_log, usable_stamps
from awescli.flightlog.spikes import without_spikes
from awescli.flightlog.table import read_header, read_table
from awescli.flightlog.units import factor_to_si
from awescli.notation.errors import BadInput, BadInputs, did_you_mean
from awescli.notation.quantities import UNITS

STAMP = ("epoch_ms", "ms")
"""Column of the clock and its unit: unix time by GPS."""

COLUMNS = {
    "p_n": ("r_eb_eN", "m", "onboard"), "p_e": ("r_eb_eE", "m", "onboard"), "p_d": ("r_eb_eD", "m", "onboard"),
    "v_n": ("v_eb_eN", "m/s", "onboard"), "v_e": ("v_eb_eE", "m/s", "onboard"), "v_d": ("v_eb_eD", "m/s", "onboard"),
    "phi": ("phi", "deg", "onboard"), "theta": ("theta", "deg", "onboard"), "psi": ("psi", "deg", "onboard"),
    "p": ("p", "deg/s", "onboard"), "q": ("q", "deg/s", "onboard"), "r": ("r", "deg/s", "onboard"),
    "a_x": ("a_eb_bX", "m/s2", "onboard"), "a_y": ("a_eb_bY", "m/s2", "onboard"), "a_z": ("a_eb_bZ", "m/s2", "onboard"),
    "V_a": ("V_a", "m/s", "onboard"), "tension": ("LoadFiltered", "kgf", "onboard"),
    "aileron": ("aileron_sp", "deg", "onboard"), "elevator": ("elevator_sp", "deg", "onboard"),
    "rudder": ("rudder_sp", "deg", "onboard"), "flaps": ("flaps_sp", "deg", "onboard"),
    "throttle": ("throttle_sp", "%", "onboard"),
    "tether_length": ("tether_length", "m", "winch"), "reel_out_speed": ("reel_out_speed", "m/s", "winch"),
}  # fmt: skip
"""Quantity -> (column, unit in the file, clock group)."""

OPTIONAL = ("a_x", "a_y", "a_z", "V_a", "tension", "elevator", "flaps", "throttle", "tether_length", "reel_out_speed")
"""Quantities that some exports lack; those of the line are of no kite that flies free, and the kite file asks for them."""

FEW = 6
"""Missing columns up to which a file is a Kitemill log that lacks some."""

DIGITS = 4
"""Decimals written: finer than any of the sensors."""

PHASE = "flight_phase"
"""Column with the name of the phase that a simulated pumping flight was in."""
WITHOUT_QUANTITY = ("intern_time", "camber_sp", PHASE)
"""Columns of the format that a flight log has no place for; they are no news to the user."""


CURE = (
    "Say what it is in a flight.yaml beside it: `format: kitemill` and `units: {{{column}: {unit}}}`; "
    "a unit that is declared there is believed. Other signs and frames: `format: csv`."
)
"""What to do about a column that contradicts its unit."""


def read_kitemill(
    path: Path,
    weather: Path | None,
    max_gap: float = 0.2,
    units: Mapping[str, str] | None = None,
    station_height: float = 10.0,
    late: Mapping[str, float] | None = None,
) -> FlightLog:
    """The log `path` and the weather file that belongs to it as a flight log.

    units: column -> unit, where the file does not use the format's own (`flight.yaml: units`); such columns are believed.
    station_height: height of a weather station without a `height` column [m above the winch]. late: clock group -> s by
    which its records come late.
    Raises BadInput (BadInputs) for missing columns, wrong units, cut-off or unreadable files.
    """
    folder, units = path.parent, dict(units or {})
    _, header = read_header(path)
    _refuse_missing(path, header)
    _refuse_unknown_units(folder, header, units)
    table = read_table(path, [STAMP[0], *(column for column, _, _ in COLUMNS.values())])
    stamps = table.columns[STAMP[0]]
    check_clock(stamps, units.get(STAMP[0], STAMP[1]), f"{path}: column {STAMP[0]}")
    first = float(stamps[np.isfinite(stamps)][0])
    second = factor_to_si(units.get(STAMP[0], STAMP[1]), "s")
    signals = {
        quantity: table.columns[column] * factor_to_si(units.get(column, unit), UNITS[quantity])
        for quantity, (column, unit, _) in COLUMNS.items()
        if column in table.columns
    }
    seconds = (stamps - first) * second
    places = {quantity: (f"{path}: column {column}", column) for quantity, (column, _, _) in COLUMNS.items()}
    signals, spikes = without_spikes(signals, usable_stamps(seconds)[0])
    check_frames(seconds, signals, places, units, {}, "Columns in other frames are mapped in a flight.yaml (`format: csv`).")
    check_units(seconds, signals, places, units, CURE)
    notes = list(table.notes)
    if others := [name for name in table.others if name not in WITHOUT_QUANTITY]:
        notes.append(f"{path.name}: columns without a quantity: {', '.join(others[:20])}{' ...' if len(others) > 20 else ''}.")
    wind = None
    if weather is None:
        notes.append("There is no weather file (lista_fyr_lighthouse.csv or wind*.csv).")
    else:
        wind, more = read_wind(weather, first * second, (float(np.nanmin(seconds)), float(np.nanmax(seconds))), station_height)
        notes += more
    groups = {quantity: COLUMNS[quantity][2] for quantity in signals} | ({"wind": "weather"} if wind is not None else {})
    raw = RawFlight(folder.resolve().name, first * second, seconds, signals, str(path), groups, late or {}, wind, tuple(notes), spikes)
    return uniform_log(raw, max_gap)


def to_kitemill_csv(log: FlightLog, phases: Sequence[str] | None = None) -> tuple[str, str]:
    """(text of kite.csv, text of wind.csv, "" without wind). Invalid samples are left out, so that they are a gap again. phases: name of
    the phase of every sample, a column more.

    Precision: stamps 1 ms, all else 4 decimals of the column's unit.
    """
    keep = np.flatnonzero(log.valid)
    milliseconds = np.rint((log.start + log.time[keep]) * 1000).astype(np.int64)
    internal = np.rint(log.time[keep] * 1000).astype(np.int64)
    columns = {STAMP[0]: pl.Series(milliseconds), "intern_time": pl.Series(internal)}
    for quantity, (column, unit, _) in COLUMNS.items():
        if quantity in log:
            # adding 0.0 turns the -0.0 of a rounded small number into 0.0
            columns[column] = pl.Series(np.round(log[quantity][keep] / factor_to_si(unit, UNITS[quantity]), DIGITS) + 0.0)
    if phases is not None:
        columns[PHASE] = pl.Series([phases[i] for i in keep.tolist()])
    return pl.DataFrame(columns).write_csv(float_precision=DIGITS), "" if log.wind is None else wind_csv_text(log)


def is_kitemill(header: tuple[str, ...]) -> bool:
    """Are these the columns of the format, a few of them missing at most?"""
    return len(_missing(header)) <= FEW


def _needed() -> list[str]:
    return [STAMP[0], *(column for quantity, (column, _, _) in COLUMNS.items() if quantity not in OPTIONAL)]


def _missing(header: tuple[str, ...]) -> list[str]:
    return [name for name in _needed() if name not in header]


def _refuse_missing(path: Path, header: tuple[str, ...]) -> None:
    """All missing columns in one go, each with the nearest that is there."""
    missing = _missing(header)
    unused = [name for name in header if name not in {STAMP[0], *(column for column, _, _ in COLUMNS.values())}]
    errors = []
    for name in missing:
        nearest = did_you_mean(name, unused) if unused else ""
        hint = nearest if nearest.startswith("Did") else ""
        cure = "Rename the column, or map the file's own names in flight.yaml (format: csv)."
        errors.append(BadInput(f"the column '{name}' is missing", f"{path}:1", f"{hint} {cure}".strip()))
    if not is_kitemill(header):
        raise BadInput(
            f"not a Kitemill log: {len(missing)} of {len(_needed())} columns are missing ({', '.join(missing[:6])}, ...)",
            f"{path}:1",
            f"It has: {', '.join(header[:12])}{', ...' if len(header) > 12 else ''}. `awes init` drafts a flight.yaml for it.",
        )
    if errors:
        raise errors[0] if len(errors) == 1 else BadInputs(errors)


def _refuse_unknown_units(folder: Path, header: tuple[str, ...], units: Mapping[str, str]) -> None:
    """A declared unit must be of a column that is there, and a unit of what the column measures."""
    for column, unit in units.items():
        where = f"{folder / 'flight.yaml'}: units.{column}"
        quantity = next((q for q, (c, _, _) in COLUMNS.items() if c == column), None)
        if column not in header or (quantity is None and column != STAMP[0]):
            raise BadInput("the log has no such column", where, did_you_mean(column, header))
        try:
            factor_to_si(unit, UNITS[quantity] if quantity else "s")
        except BadInput as e:
            raise BadInput(e.what, where, e.do) from None
