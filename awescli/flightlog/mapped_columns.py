"""Columns of a CSV -> quantities in SI and NED/FRD, as a flight.yaml says: unit, sign, scale, offset, frame."""

import math
from collections.abc import Iterable

import numpy as np

from awescli.flightlog.flight_check import Use
from awescli.flightlog.flight_file import OF_VECTOR, Acceleration, Column, FlightFile, Geodetic, Spherical, Time, Vector
from awescli.flightlog.geodesy import ned_from_geodetic
from awescli.flightlog.table import Table
from awescli.flightlog.text_stamps import ISO, read_stamps
from awescli.flightlog.units import GRAVITY, factor_to_si, zero_of
from awescli.notation.frames import rotate, rotate_back, rotation_body_to_ned
from awescli.notation.quantities import UNITS

WINCH = ("tether_length", "reel_out_speed")
"""Quantities that belong to the winch's clock unless the mapping says otherwise."""


def of_group(quantity: str) -> str:
    """The clock group of a quantity, unless the mapping says otherwise."""
    return "winch" if quantity in WINCH else "motor" if quantity == "motor_speed" else "onboard"


Triple = tuple[np.ndarray, np.ndarray, np.ndarray]


def column_in_si(table: Table, spec: Column, si_unit: str) -> np.ndarray:
    """sign * scale * column + offset, in SI (N,)."""
    values = spec.sign * spec.scale * table.columns[spec.column] + spec.offset
    return (values + zero_of(spec.unit)) * factor_to_si(spec.unit, si_unit)


def columns_in(uses: Iterable[Use]) -> list[str]:
    """Names of the columns of numbers; a clock of text is read by `stamps_in_seconds`."""
    return [use.column for use in uses if use.unit != ISO]


def stamps_in_seconds(table: Table, time: Time) -> np.ndarray:
    """(N,) s of a clock, as it counts."""
    if time.unit == ISO:
        return read_stamps(table.path, time.column) + (time.start or 0.0)
    return table.columns[time.column] * factor_to_si(time.unit, "s") + (time.start or 0.0)


def mapped_signals(table: Table, mapping: FlightFile) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """(quantity -> (N,) SI, NED/FRD; quantity -> clock group) of everything that the mapping names."""
    signals, groups = {}, {}
    for quantity, spec in mapping.signals.items():
        signals[quantity] = column_in_si(table, spec, UNITS[quantity])
        groups[quantity] = spec.group or of_group(quantity)
    for quantity, mix in mapping.mix.items():
        total = sum(factor * table.columns[column] for column, factor in mix.of.items()) + mix.offset
        signals[quantity] = (total + zero_of(mix.unit)) * factor_to_si(mix.unit, UNITS[quantity])
        groups[quantity] = mix.group or of_group(quantity)
    for name, quantities in OF_VECTOR.items():
        spec = getattr(mapping, name)
        if spec is None:
            continue
        if isinstance(spec, Spherical):
            vector, group = _from_angles(table, spec), spec.distance.group
        elif isinstance(spec, Geodetic):
            vector, group = _from_geodetic(table, spec), spec.latitude.group
        else:
            vector, group = _vector(table, spec, signals, UNITS[quantities[0]]), spec.group
        signals |= dict(zip(quantities, vector, strict=True))
        groups |= dict.fromkeys(quantities, group or "onboard")
    return signals, groups


def _vector(table: Table, spec: Vector, signals: dict[str, np.ndarray], si_unit: str) -> Triple:
    """A velocity or position in NED, an acceleration in body axes, gravity neither added nor removed."""
    factor = spec.scale * factor_to_si(spec.unit, si_unit)
    first, second, third = (table.columns[name] * factor for name in spec.columns)
    vector = (second, first, -third) if spec.frame == "ENU" else (first, second, third)
    needs_attitude = (spec.frame == "BODY") != isinstance(spec, Acceleration) or getattr(spec, "measures", "") == "specific_force"
    if not needs_attitude:
        return vector
    R = rotation_body_to_ned(signals["phi"], signals["theta"], signals["psi"])
    if not isinstance(spec, Acceleration):
        return rotate(R, vector)
    vector = vector if spec.frame == "BODY" else rotate_back(R, vector)
    if spec.measures == "specific_force":
        # an accelerometer shows the acceleration minus gravity, which points down
        vector = tuple(a + GRAVITY * R[2][i] for i, a in enumerate(vector))
    return vector


def _from_angles(table: Table, spec: Spherical) -> Triple:
    """Position NED [m] from elevation, azimuth (clockwise from north) and distance."""
    elevation, azimuth = (column_in_si(table, angle, "rad") for angle in (spec.elevation, spec.azimuth))
    distance = column_in_si(table, spec.distance, "m")
    level = distance * np.cos(elevation)
    return level * np.cos(azimuth), level * np.sin(azimuth), -distance * np.sin(elevation)


def _from_geodetic(table: Table, spec: Geodetic) -> Triple:
    """Position NED [m] from latitude, longitude and altitude."""
    latitude, longitude = (column_in_si(table, angle, "rad") for angle in (spec.latitude, spec.longitude))
    origin = (math.radians(spec.origin.latitude), math.radians(spec.origin.longitude), spec.origin.altitude)
    return ned_from_geodetic(latitude, longitude, column_in_si(table, spec.altitude, "m"), origin)
