"""Surfaces, airspeed, flow angles, load and accelerometers: units and meaning, as far as header and numbers tell."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from awescli.flightlog.drafting.headers import Reading
from awescli.flightlog.drafting.pool import Entry, Pool, entry, high
from awescli.flightlog.units import GRAVITY
from awescli.notation.frames import rotate_back, rotation_body_to_ned
from awescli.notation.quantities import CONTROL_SURFACES

SPEEDS = ("m/s", "kt", "km/h", "ft/s", "mph")
MOST_DEFLECTION = 1.2
"""rad: no control surface of a wing goes further."""
FULL, FASTEST = 1.5, 500.0
"""A throttle of 1 is full; no propeller turns 500 times a second."""
PULSE = (700.0, 2300.0)
"""us: a servo's pulse width is no angle."""


@dataclass(frozen=True)
class Rest:
    """entries: quantity -> entry; left: (quantity, column, why it was not mapped); accelerations: (columns, unit, measures), or None."""

    entries: Mapping[str, Entry]
    left: tuple[tuple[str, str, str], ...] = ()
    accelerations: tuple[tuple[str, str, str], str, str] | None = None
    notes: tuple[str, ...] = ()


def find_rest(pool: Pool, seconds: np.ndarray, velocity: np.ndarray | None, angles: Mapping[str, np.ndarray] | None) -> Rest:
    """All that stands by itself. velocity: (3, N) NED; angles: phi, theta, psi (N,) rad, where known."""
    entries, left = {}, []
    surfaces = {quantity: reading for quantity in CONTROL_SURFACES if (reading := _command(pool, quantity)) is not None}
    unit = _unit_of_surfaces(pool, surfaces.values())
    for quantity, reading in surfaces.items():
        found = _surface(pool, reading, unit)
        if isinstance(found, Entry):
            entries[quantity] = found
        else:
            left.append((quantity, reading.column, found))
    if (reading := _command(pool, "throttle")) is not None and not _is_pulse(pool, reading):
        size = high(pool.values[reading.column])
        line = entry(reading, reading.unit or ("%" if size > FULL else "-"))
        entries["throttle"] = replace(line, assumed="" if reading.unit else f"unit by its size, {size:.3g}")
    if (reading := pool.best("motor_speed")) is not None:
        size = high(pool.values[reading.column])
        line = entry(reading, reading.unit or ("rpm" if size > FASTEST else "1/s"))
        entries["motor_speed"] = replace(line, assumed="" if reading.unit else f"unit by its size, {size:.3g}")
    if (reading := pool.best("V_a")) is not None:
        entries["V_a"] = _airspeed(pool, reading, velocity)
    for quantity in ("alpha", "beta"):
        if (reading := pool.best(quantity)) is not None:
            size = high(pool.values[reading.column])
            line = entry(reading, reading.unit or ("deg" if size > 1.0 else "rad"))
            entries[quantity] = replace(line, assumed="" if reading.unit else f"unit by its size, {size:.3g}")
    if (reading := pool.best("tension")) is not None:
        if reading.unit:
            entries["tension"] = entry(reading, reading.unit)
        else:
            size = high(pool.values[reading.column])
            left.append(("tension", reading.column, f"no unit in its name: N, kgf, lbf, daN or kN? It reaches {size:.4g}"))
    accelerations, more, notes = _accelerations(pool, seconds, velocity, angles)
    return Rest(entries, (*left, *more), accelerations, notes)


def _command(pool: Pool, quantity: str) -> Reading | None:
    """A surface's column: what was asked for before what was reached."""
    found = [r for r in pool.of(quantity) if np.isfinite(pool.values[r.column]).any()]
    return min(found, key=lambda r: (not r.meaning.command, r.meaning.reached, r.rank), default=None)


def _unit_of_surfaces(pool: Pool, readings: Collection[Reading]) -> str | None:
    """All surfaces come in one unit: that of a header, else deg where one goes further than rad can; None where it may be a share."""
    if named := [r.unit for r in readings if r.unit]:
        return named[0]
    size = max((high(pool.values[r.column]) for r in readings if not _is_pulse(pool, r)), default=0.0)
    return "deg" if size > MOST_DEFLECTION else "rad" if size < 0.75 else None


def _is_pulse(pool: Pool, reading: Reading) -> bool:
    return PULSE[0] < float(np.nanmedian(pool.values[reading.column])) < PULSE[1]


def _surface(pool: Pool, reading: Reading, unit: str | None) -> Entry | str:
    """The entry of a surface, or why it has none. unit: of its neighbours."""
    size = high(pool.values[reading.column])
    if _is_pulse(pool, reading):
        middle = float(np.nanmedian(pool.values[reading.column]))
        return f"pulse widths around {middle:.0f} us are no angle: give scale and offset that make it one"
    known = reading.unit or unit
    if known is None:
        return f"reaches {size:.3g}: rad, or a share of the full deflection? give `scale` for a share"
    line = entry(reading, known)
    said = [] if reading.unit else [f"unit by the size of the surfaces, {size:.3g} here"]
    if not reading.meaning.command:
        said.append("taken as the command" if not reading.meaning.reached else "said to be measured, not commanded")
    return replace(line, assumed="; ".join(said))


def _airspeed(pool: Pool, reading: Reading, velocity: np.ndarray | None) -> Entry:
    """Unit by the header, else the one that comes nearest to the speed over ground."""
    if reading.unit or velocity is None:
        return replace(entry(reading, reading.unit or "m/s"), assumed="" if reading.unit else "unit")
    speed = float(np.nanmedian(np.sqrt((velocity**2).sum(0))))
    middle = float(np.nanmedian(pool.values[reading.column]))
    unit = min(SPEEDS, key=lambda u: abs(math.log(max(middle * Entry("", u).si(np.ones(1), "m/s")[0], 1e-9) / max(speed, 1e-9))))
    return replace(entry(reading, unit), assumed="unit by the speed over ground, which wind blurs")


def _accelerations(
    pool: Pool, seconds: np.ndarray, velocity: np.ndarray | None, angles: Mapping[str, np.ndarray] | None
) -> tuple[tuple[tuple[str, str, str], str, str] | None, tuple[tuple[str, str, str], ...], tuple[str, ...]]:
    """((columns, unit, measures) or None, what was left out and why, notes): accelerometers show the acceleration minus gravity, filters
    of an autopilot may have put it back."""
    chosen = pool.all(("a_x", "a_y", "a_z"))
    if chosen is None:
        return None, (), ()
    x, y, z = (r.column for r in chosen)
    columns = (x, y, z)
    named = {r.unit for r in chosen}
    if velocity is None or angles is None or any(r.meaning.sign < 0 for r in chosen) or len(named) > 1:
        return None, (("acceleration", ", ".join(columns), "could not be held against velocity and attitude"),), ()
    width = max(2, int(round(0.4 / float(np.median(np.diff(seconds))))))
    R = rotation_body_to_ned(angles["phi"], angles["theta"], angles["psi"])
    slope = tuple(_slope(v, seconds, width) for v in velocity)
    kinematic = np.array(rotate_back(R, slope))
    force = kinematic - GRAVITY * np.array(R[2])
    raw = np.array([pool.values[c] for c in columns])
    found = []
    for measures, truth in (("specific_force", force), ("kinematic", kinematic)):
        for unit in (chosen[0].unit,) if chosen[0].unit else ("m/s2", "g", "ft/s2"):
            values = raw * Entry("", unit).si(np.ones(1), "m/s2")[0]
            error = np.sqrt(((values - truth) ** 2).sum(0))
            found.append((float(np.nanmedian(error)) / max(float(np.nanmedian(np.sqrt((truth**2).sum(0)))), 1e-9), measures, unit))
    share, measures, unit = min(found)
    if share > 0.4:
        return None, (("acceleration", ", ".join(columns), f"misses dv/dt by {100 * share:.0f} %, with gravity and without"),), ()
    return (columns, unit, measures), (), (f"accelerations are {measures.replace('_', ' ')}: they miss dv/dt by {100 * share:.0f} %",)


def _slope(x: np.ndarray, seconds: np.ndarray, width: int) -> np.ndarray:
    i = np.arange(x.size)
    low, high_ = np.maximum(i - width // 2, 0), np.minimum(i + (width + 1) // 2, x.size - 1)
    return (x[high_] - x[low]) / np.maximum(seconds[high_] - seconds[low], 1e-9)
