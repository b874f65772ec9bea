"""Any CSV -> FlightLog through the mapping of a flight.yaml (flight_file.py): columns, units, signs, frames, clocks."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from awescli.flightlog.clocks import clock_offset
from awescli.flightlog.flight_file import OF_VECTOR, Column, FlightFile, Spherical, Vector
from awescli.flightlog.log import FlightLog, WindRecord
from awescli.flightlog.plausible_units import check_units
from awescli.flightlog.resample import RawFlight, sample_interval, uniform_log, usable_stamps
from awescli.flightlog.spikes import without_spikes
from awescli.flightlog.table import Table, read_header, read_table
from awescli.flightlog.units import VOCABULARY, factor_to_si
from awescli.notation.errors import BadInput, BadInputs, did_you_mean
from awescli.notation.frames import rotate_back, rotation_body_to_ned
from awescli.notation.quantities import UNITS

WINCH = ("tether_length", "reel_out_speed")
"""Quantities that belong to the winch's clock unless the mapping says otherwise."""

CURE = "Correct the unit, sign or frame of column {column} in flight.yaml; if all is right as it stands, add `believe: [{column}]`."
"""What to do about a column that contradicts its unit."""


def read_mapped(declaration: Path, path: Path, mapping: FlightFile, max_gap: float = 0.2) -> FlightLog:
    """The log `path` as `mapping`, read from the file `declaration`, describes it.

    Raises BadInput (BadInputs) for columns that are missing, units that do not fit, numbers that contradict their units.
    """
    _, header = read_header(path)
    _refuse_missing(declaration, mapping, path, header)
    table = read_table(path, [column for _, column in _columns(mapping)])
    stamps = table.columns[mapping.time.column] * VOCABULARY[mapping.time.unit][1]
    known = stamps[np.isfinite(stamps)]
    if known.size == 0:
        raise BadInput("no time stamp can be read", f"{path}: column {mapping.time.column}", "Expected numbers.")
    start, seconds = float(known[0]), stamps - known[0]
    reader = _Reader(declaration, table)
    signals, groups = _signals(reader, mapping)
    places = {q: (f"{path}: column {c.column}", c.column) for q, c in mapping.signals.items()}
    for name, quantities in OF_VECTOR.items():
        if isinstance(vector := getattr(mapping, name), Vector):
            places |= {q: (f"{path}: columns {', '.join(vector.columns)}", vector.columns[0]) for q in quantities}
    # a mapping declares its tension: how large a wing it may need is not known here
    believed = [*mapping.believe, *(spec.column for quantity, spec in mapping.signals.items() if quantity == "tension")]
    signals, spikes = without_spikes(signals, usable_stamps(seconds)[0])
    check_units(seconds, signals, places, believed, CURE)
    wind = _wind(reader, mapping, seconds)
    if wind is not None:
        groups["wind"] = "weather"
        wind = replace(wind, time=wind.time - _number(mapping.clocks.get("weather", 0.0)))
    notes = [*table.notes, *_unused(path, table, header, mapping)]
    late = {group: _number(value) for group, value in mapping.clocks.items()}
    if mapping.clocks.get("winch") == "auto":
        late["winch"], said = _winch_lateness(seconds, signals)
        notes.append(said)
    raw = RawFlight(declaration.resolve().parent.name, start, seconds, signals, str(path), groups, late, wind, tuple(notes), spikes)
    return uniform_log(raw, max_gap)


class _Reader:
    """Columns of the table in SI, with errors that name the line of thought, not the traceback."""

    def __init__(self, declaration: Path, table: Table):
        self.declaration, self.table = declaration, table

    def column(self, spec: Column, si_unit: str, key: str) -> np.ndarray:
        """sign * column + offset, in SI (N,)."""
        return (spec.sign * self.table.columns[spec.column] + spec.offset) * self._factor(spec.unit, si_unit, key)

    def vector(self, spec: Vector, si_unit: str, key: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The vector in NED (or BODY, where it is declared so), SI, each (N,)."""
        factor = self._factor(spec.unit, si_unit, key)
        first, second, third = (self.table.columns[name] * factor for name in spec.columns)
        return (second, first, -third) if spec.frame == "ENU" else (first, second, third)

    def _factor(self, unit: str, si_unit: str, key: str) -> float:
        try:
            return factor_to_si(unit, si_unit)
        except BadInput as e:
            raise BadInput(e.what, f"{self.declaration}: {key}.unit", e.do) from None


def _signals(reader: _Reader, mapping: FlightFile) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """(quantity -> (N,) SI, NED/FRD; quantity -> clock group)."""
    signals, groups = {}, {}
    for quantity, spec in mapping.signals.items():
        signals[quantity] = reader.column(spec, UNITS[quantity], f"signals.{quantity}")
        groups[quantity] = spec.group or ("winch" if quantity in WINCH else "onboard")
    for name, quantities in OF_VECTOR.items():
        spec = getattr(mapping, name)
        if isinstance(spec, Spherical):
            vector, group = _from_angles(reader, spec), spec.distance.group or "onboard"
        elif spec is not None:
            vector, group = reader.vector(spec, UNITS[quantities[0]], name), spec.group
            if name == "acceleration" and spec.frame != "BODY":
                if missing := [a for a in ("phi", "theta", "psi") if a not in signals]:
                    do = f"Map {', '.join(missing)} in signals as well."
                    raise BadInput("accelerations in NED or ENU need the attitude", f"{reader.declaration}: acceleration", do)
                vector = rotate_back(rotation_body_to_ned(signals["phi"], signals["theta"], signals["psi"]), vector)
        else:
            continue
        signals |= dict(zip(quantities, vector, strict=True))
        groups |= dict.fromkeys(quantities, group)
    return signals, groups


def _from_angles(reader: _Reader, spec: Spherical) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position NED [m] from elevation, azimuth (clockwise from north) and distance."""
    elevation = reader.column(spec.elevation, "rad", "position.elevation")
    azimuth = reader.column(spec.azimuth, "rad", "position.azimuth")
    distance = reader.column(spec.distance, "m", "position.distance")
    level = distance * np.cos(elevation)
    return level * np.cos(azimuth), level * np.sin(azimuth), -distance * np.sin(elevation)


def _wind(reader: _Reader, mapping: FlightFile, seconds: np.ndarray) -> WindRecord | None:
    """The wind columns as a record at one height; only the samples at which they change are kept."""
    if mapping.wind is None:
        return None
    direction = reader.column(mapping.wind.direction, "rad", "wind.direction")
    speed = reader.column(mapping.wind.speed, "m/s", "wind.speed")
    usable = np.isfinite(direction) & np.isfinite(speed) & np.isfinite(seconds)
    keep = np.flatnonzero(usable)
    keep = keep[usable_stamps(seconds[keep])[0]]
    if keep.size == 0:
        raise BadInput("the wind columns hold no value", str(reader.table.path), "Check wind.direction and wind.speed in flight.yaml.")
    new = np.ones(keep.size, bool)
    new[1:] = (np.diff(direction[keep]) != 0) | (np.diff(speed[keep]) != 0)
    new[-1] = True
    keep = keep[new]
    density = None
    if mapping.wind.density is not None:
        values = reader.column(mapping.wind.density, "kg/m3", "wind.density")
        known = np.flatnonzero(np.isfinite(values) & np.isfinite(seconds))
        known = known[usable_stamps(seconds[known])[0]]
        density = np.interp(seconds[keep], seconds[known], values[known]) if known.size else None
    unwrapped = np.unwrap(direction[keep])[:, None]
    return WindRecord(seconds[keep], np.array([mapping.wind.height]), speed[keep][:, None], unwrapped, np.zeros((keep.size, 1)), density)


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


def _columns(mapping: FlightFile) -> Iterator[tuple[str, str]]:
    """(key in flight.yaml, column) of all that the mapping uses."""
    yield "time.column", mapping.time.column
    for quantity, spec in mapping.signals.items():
        yield f"signals.{quantity}.column", spec.column
    for name in OF_VECTOR:
        spec = getattr(mapping, name)
        if isinstance(spec, Spherical):
            yield from ((f"{name}.{part}.column", getattr(spec, part).column) for part in ("elevation", "azimuth", "distance"))
        elif spec is not None:
            yield from ((f"{name}.columns.{i}", column) for i, column in enumerate(spec.columns))
    for part in ("direction", "speed", "density") if mapping.wind is not None else ():
        if (spec := getattr(mapping.wind, part)) is not None:
            yield f"wind.{part}.column", spec.column


def _refuse_missing(declaration: Path, mapping: FlightFile, path: Path, header: tuple[str, ...]) -> None:
    errors = [
        BadInput(f"{path.name} has no column '{column}'", f"{declaration}: {key}", did_you_mean(column, header))
        for key, column in _columns(mapping)
        if column not in header
    ]
    if errors:
        raise errors[0] if len(errors) == 1 else BadInputs(errors)


def _unused(path: Path, table: Table, header: tuple[str, ...], mapping: FlightFile) -> list[str]:
    used = {column for _, column in _columns(mapping)}
    rest = [name for name in header if name not in used]
    return [f"{path.name}: {len(rest)} of {len(header)} columns are not mapped."] if rest else []
