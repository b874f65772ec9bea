"""Position and velocity: which columns, in which frame and units, so that one is the change of the other."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from awescli.flightlog.drafting.headers import Reading
from awescli.flightlog.drafting.pool import Entry, Pool, entry, high, units_for
from awescli.flightlog.geodesy import ned_from_geodetic
from awescli.flightlog.motion import FRAMES, IN_WORDS, changes, forwardness
from awescli.notation.frames import rotate, rotation_body_to_ned

POSITION, VELOCITY = ("p_n", "p_e", "p_d"), ("v_n", "v_e", "v_d")
LENGTHS, SPEEDS = ("m", "ft", "km", "cm", "mm"), ("m/s", "kt", "km/h", "ft/s", "mph", "cm/s")
GOOD = 0.25
"""Share of the speed that may be missed for a velocity to be called the change of position."""
SAME = 0.03
"""Shares that differ by less than this are alike: units that do as well are named."""
MOST = 3000
"""Samples at which the alternatives are compared."""

Angles = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Alternative:
    """One way to read columns as a position or a velocity. entries: quantity, or part of a position, -> entry; ned: (3, N) SI; rare: how
    far down the list of usual ones it stands; frame: of the columns; unit: where no header names it."""

    entries: Mapping[str, Entry]
    ned: np.ndarray
    rare: float
    frame: str
    unit: str = ""


@dataclass(frozen=True)
class Path:
    """What was found of the motion: position, velocity as they are read (None where there are no columns); notes: what bears it out."""

    position: Alternative | None
    velocity: Alternative | None
    notes: tuple[str, ...] = ()


def find_path(pool: Pool, seconds: np.ndarray, angles: Angles | None) -> Path:
    """Position and velocity. seconds: (N,) stamps, rising; angles: phi, theta, psi (N,) [rad], to tell the heading by, where known.

    Where no header names a unit, a line length whose header does tells how far the kite is.
    """
    positions, velocities = list(_positions(pool)), list(_velocities(pool, angles))
    if not positions or not velocities:
        left = (positions or velocities or [None])[0]
        position, velocity = (left, None) if positions else (None, left)
        note = () if left is None else (f"the log has no {'velocity' if positions else 'position'} to hold it against",)
        return Path(position, velocity, note)
    compared = sorted(_compared(positions, velocities, seconds, angles, _line(pool)), key=lambda c: c[0])
    if not compared:
        return Path(positions[0], velocities[0], ("position and velocity could not be compared: too little moves",))
    score, share, position, velocity = compared[0]
    notes = [f"the velocity is the change of position but for {100 * share:.0f} % of the speed"]
    if share > GOOD:
        notes = [f"CHECK: read in no frame or unit is the velocity the change of position; {100 * share:.0f} % of the speed are missed"]
    likewise = [(p.unit, v.unit) for other, _, p, v in compared[1:] if other < score + SAME and p.frame == position.frame]
    if position.unit and velocity.unit and (pairs := [x for x in dict.fromkeys(likewise) if x != (position.unit, velocity.unit)]):
        others = ", ".join(f"{a} with {b}" for a, b in pairs[:3])
        notes.append(f"CHECK: no header names these units; {position.unit} with {velocity.unit} fit, so would {others}")
    return Path(position, velocity, tuple(notes))


def _line(pool: Pool) -> float | None:
    """Median length of the line [m], where its header names the unit."""
    reading = pool.best("tether_length")
    if reading is None or reading.unit is None:
        return None
    return float(np.nanmedian(entry(reading, reading.unit).si(pool.values[reading.column], "m")))


def _compared(
    positions: Sequence[Alternative], velocities: Sequence[Alternative], seconds: np.ndarray, angles: Angles | None, line: float | None
) -> Iterator[tuple[float, float, Alternative, Alternative]]:
    """(score, share of the speed that is missed, position, velocity): the velocity is the change of position, the kite flies above its
    winch, as far as the line is long, and goes where it points."""
    along = [forwardness(angles, v.ned) if angles is not None else 1.0 for v in velocities]
    for position in positions:
        off = 0.0
        if line is not None and position.unit:
            off = 0.2 * min(1.0, abs(math.log(max(_size(position.ned[:, np.isfinite(position.ned.sum(0))]), 1e-9) / max(line, 1e-9))))
        for velocity, forward in zip(velocities, along, strict=True):
            change, mean = changes(seconds, position.ned, velocity.ned, MOST)
            if change.shape[1] < 50 or (speed := _size(change)) < 0.5:
                continue
            share = _size(change - mean) / speed
            # where a frame was chosen, and not named, the kite must fly above its winch
            below = position.frame not in ("", "NED") and float(np.nanmedian(position.ned[2])) > 0
            turned = 1.0 - forward if np.isfinite(forward) else 0.0
            yield share + turned + below + off + position.rare + velocity.rare, share, position, velocity


def _size(vectors: np.ndarray) -> float:
    """Median length of (3, K)."""
    return float(np.sqrt(np.median((vectors**2).sum(0))))


def _positions(pool: Pool) -> Iterator[Alternative]:
    if triple := _triple(pool, POSITION, "position"):
        yield from _cartesian(pool, *triple, POSITION, LENGTHS, "m")
    elif angles := pool.all([f"position.{part}" for part in ("elevation", "azimuth", "distance")]):
        yield from _spherical(pool, angles)
    elif level := pool.all(["position.latitude", "position.longitude"]):
        if height := pool.best("p_d") or pool.best("position.z"):
            yield _geodetic(pool, level, height)


def _velocities(pool: Pool, angles: Angles | None) -> Iterator[Alternative]:
    triple = _triple(pool, VELOCITY, "velocity")
    body = pool.all([f"velocity.{axis}" for axis in "uvw"])
    if triple is not None:
        yield from _cartesian(pool, *triple, VELOCITY, SPEEDS, "m/s")
        # x, y and z may be body axes as well
        body = triple[0] if len(triple[1]) > 1 else None
    if body is not None and angles is not None:
        R = rotation_body_to_ned(angles["phi"], angles["theta"], angles["psi"])
        for found in _cartesian(pool, body, ("NED",), VELOCITY, SPEEDS, "m/s"):
            yield replace(found, ned=np.array(rotate(R, tuple(found.ned))), frame="BODY", rare=found.rare + 0.01)


def _triple(pool: Pool, names: Sequence[str], kind: str) -> tuple[list[Reading], tuple[str, ...]] | None:
    """(columns, frames to try): north, east, down by name, or x, y, z of axes that the header does not tell."""
    if named := pool.all(names):
        return named, ("NED",)
    if plain := pool.all([f"{kind}.{axis}" for axis in "xyz"]):
        return plain, tuple(FRAMES)
    # x and y in the plane, and a height by its own name
    if kind == "position" and (level := pool.all(["position.x", "position.y"])) and (height := pool.best("p_d")):
        return [*level, height], ("NED", "END")
    return None


def _cartesian(
    pool: Pool, chosen: Sequence[Reading], frames: Sequence[str], names: Sequence[str], usual: Sequence[str], si: str
) -> Iterator[Alternative]:
    """Three columns in every frame, and in every unit where headers name none."""
    unnamed = [r for r in chosen if r.unit is None]
    units = units_for(unnamed[0], usual) if unnamed else ("",)
    # a column without a unit is likeliest to share that of its neighbours
    beside = [r.unit for r in chosen if r.unit is not None]
    units = tuple(dict.fromkeys((*(u for u in beside if unnamed), *units)))
    for (k, frame), (j, unit) in product(enumerate(frames), enumerate(units)):
        entries = {}
        for name, (i, sign) in zip(names, FRAMES[frame], strict=True):
            line = entry(chosen[i], chosen[i].unit or unit, "" if chosen[i].quantity == name else f"axes {IN_WORDS[frame]}")
            entries[name] = replace(line, sign=sign * line.sign, assumed="" if chosen[i].unit else "unit")
        ned = np.array([e.si(pool.values[e.column], si) for e in entries.values()])
        yield Alternative(entries, ned, 1e-3 * k + 1e-4 * j, frame, "" if not unnamed else unit)


def _spherical(pool: Pool, angles: list[Reading]) -> Iterator[Alternative]:
    """Elevation, azimuth and distance; the azimuth counted either way, from any side."""
    elevation, azimuth, distance = angles
    unit = elevation.unit or azimuth.unit or ("rad" if high(pool.values[elevation.column]) < math.pi / 2 else "deg")
    quarter = 90.0 if unit == "deg" else math.pi / 2
    for k, (turns, sign) in enumerate(product((0, 2, 1, 3), (1, -1))):
        entries = {
            "position.elevation": entry(elevation, unit), "position.distance": entry(distance, distance.unit or "m"),
            "position.azimuth": replace(entry(azimuth, unit), sign=sign, offset=turns * quarter),
        }  # fmt: skip
        el, d, az = (e.si(pool.values[e.column], si) for e, si in zip(entries.values(), ("rad", "m", "rad"), strict=True))
        ned = np.array([d * np.cos(el) * np.cos(az), d * np.cos(el) * np.sin(az), -d * np.sin(el)])
        yield Alternative(entries, ned, 1e-3 * k, "angles")


def _geodetic(pool: Pool, level: list[Reading], height: Reading) -> Alternative:
    """Latitude, longitude and altitude, from the first place that is known; where the winch stands is asked later."""
    entries = {}
    for name, reading in zip(("latitude", "longitude"), level, strict=True):
        size = high(pool.values[reading.column])
        # whole numbers of 1e-7 deg are how autopilots keep them
        scale = 1e-7 if size > 1000 else 1.0
        entries[f"position.{name}"] = entry(reading, reading.unit or "deg", scale=scale)
    entries["position.altitude"] = replace(entry(height, height.unit or "m"), sign=1 if height.quantity != "p_d" else -height.meaning.sign)
    lat, lon, alt = (e.si(pool.values[e.column], si) for e, si in zip(entries.values(), ("rad", "rad", "m"), strict=True))
    known = np.flatnonzero(np.isfinite(lat + lon + alt))
    first = (float(lat[known[0]]), float(lon[known[0]]), float(alt[known[0]])) if known.size else (0.0, 0.0, 0.0)
    return Alternative(entries, np.array(ned_from_geodetic(lat, lon, alt, first)), 0.0, "geodetic")
