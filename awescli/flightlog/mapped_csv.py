"""Any CSV -> FlightLog through the mapping of a flight.yaml (flight_file.py): columns, units, signs, frames, clocks."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from awescli.flightlog.clocks import clock_offset
from awescli.flightlog.files import FlightFiles
from awescli.flightlog.flight_check import uses
from awescli.flightlog.flight_file import OF_VECTOR, FlightFile, Vector
from awescli.flightlog.log import FlightLog
from awescli.flightlog.mapped_columns import columns_in, mapped_signals, stamps_in_seconds
from awescli.flightlog.mapped_wind import mapped_wind
from awescli.flightlog.plausible_frames import check_frames
from awescli.flightlog.plausible_units import check_interval, check_units
from awescli.flightlog.resample import RawFlight, sample_interval, uniform_log, usable_stamps
from awescli.flightlog.spikes import without_spikes
from awescli.flightlog.table import read_header, read_table
from awescli.flightlog.text_stamps import ISO
from awescli.notation.errors import BadInput
from awescli.notation.present import present

CURE = "Correct the unit, sign or frame of column {column} in flight.yaml; if all is right as it stands, add `unchecked: [{column}]`."
"""What to do about a column that contradicts its unit."""


def read_mapped(found: FlightFiles, max_gap: float = 0.2) -> FlightLog:
    """The log that a flight.yaml describes. Raises BadInput (BadInputs) for numbers that contradict their units or frames."""
    declared, path = found.mapping, found.log
    mapping = declared.file
    clock = present(mapping.time, "the clock of a mapped log")
    _, header = read_header(path)
    table = read_table(path, columns_in(use for use in uses(mapping) if not use.of_wind_file))
    stamps = stamps_in_seconds(table, clock)
    known = stamps[np.isfinite(stamps)]
    if known.size == 0:
        raise BadInput("no time stamp can be read", f"{path}: column {clock.column}", "Expected numbers.")
    start, seconds = float(known[0]), stamps - known[0]
    if clock.unit != ISO:
        check_interval(seconds, clock.unit, declared.where("time", "unit"))
    signals, groups = mapped_signals(table, mapping)
    places = _places(path, mapping)
    # a mapping declares its tension: how large a wing it may need is not known here
    believed = [*mapping.unchecked, *(spec.column for quantity, spec in mapping.signals.items() if quantity == "tension")]
    signals, spikes = without_spikes(signals, usable_stamps(seconds)[0])
    check_frames(seconds, signals, places, mapping.unchecked, _frames(mapping), CURE)
    check_units(seconds, signals, places, believed, CURE)
    wind, notes = mapped_wind(found, table, seconds, start)
    if wind is not None:
        groups["wind"] = "weather"
        wind = replace(wind, time=wind.time - _number(mapping.clocks.get("weather", 0.0)))
    notes = [*table.notes, *_unused(header, mapping, path.name), *notes]
    late = {group: _number(value) for group, value in mapping.clocks.items()}
    if mapping.clocks.get("winch") == "auto":
        late["winch"], said = _winch_lateness(seconds, signals)
        notes.append(said)
    name = declared.path.resolve().parent.name
    return uniform_log(RawFlight(name, start, seconds, signals, str(path), groups, late, wind, tuple(notes), spikes), max_gap)


def _places(path: Path, mapping: FlightFile) -> dict[str, tuple[str, str]]:
    """Quantity -> (where it comes from, the column that stands for it)."""
    places = {q: (f"{path}: column {c.column}", c.column) for q, c in mapping.signals.items()}
    places |= {q: (f"{path}: columns {', '.join(m.of)}", next(iter(m.of))) for q, m in mapping.mix.items()}
    for name, quantities in OF_VECTOR.items():
        if isinstance(vector := getattr(mapping, name), Vector):
            places |= {q: (f"{path}: columns {', '.join(vector.columns)}", vector.columns[0]) for q in quantities}
    return places


def _frames(mapping: FlightFile) -> dict[str, str]:
    """`position`, `velocity` -> the frame that the mapping gives it, where it does."""
    return {name: v.frame for name in ("position", "velocity") if isinstance(v := getattr(mapping, name), Vector)}


def _winch_lateness(seconds: np.ndarray, signals: dict[str, np.ndarray]) -> tuple[float, str]:
    """(s by which the winch records late, the sentence about it)."""
    needed = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "reel_out_speed")
    if missing := [n for n in needed if n not in signals]:
        return 0.0, f"The winch clock could not be compared: {', '.join(missing)} missing."
    keep, _ = usable_stamps(seconds)
    s = {n: signals[n][keep] for n in needed}
    good = np.isfinite(sum(s.values()))
    if good.sum() < 100:
        return 0.0, "The winch clock could not be compared: too few samples."
    position, velocity = (np.array([s[n][good] for n in needed[i : i + 3]]) for i in (0, 3))
    rate = (position * velocity).sum(0) / np.maximum(np.sqrt((position**2).sum(0)), 1.0)
    seen = clock_offset(rate, s["reel_out_speed"][good], sample_interval(seconds[keep]))
    if seen is None or not seen.clear:
        return 0.0, "The winch clock was compared with the range rate; no offset shows."
    return round(seen.late, 2), f"Winch signals come {seen.late:.2f} s late against the range rate (correlation {seen.correlation:.3f})."


def _number(late: float | str) -> float:
    return 0.0 if late == "auto" else float(late)


def _unused(header: tuple[str, ...], mapping: FlightFile, name: str) -> list[str]:
    used = {use.column for use in uses(mapping) if not use.of_wind_file}
    rest = [column for column in header if column not in used]
    return [f"{name}: {len(rest)} of {len(header)} columns are not mapped."] if rest else []
