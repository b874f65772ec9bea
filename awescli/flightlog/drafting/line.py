"""Line and winch: length against the range, reeling against the length, and where the winch stands if positions count from elsewhere."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from awescli.flightlog.drafting.headers import Reading
from awescli.flightlog.drafting.pool import Entry, Pool, entry, units_for

LENGTHS, SPEEDS = ("m", "ft", "km", "cm"), ("m/s", "ft/s", "m/min", "ft/min", "km/h", "kt", "mm/s", "cm/s")
TAUT = 0.1
"""Relative difference between range and line up to which the one is the other."""
FAR = 10.0
"""m between the log's origin and the winch, from which it is worth a word."""


@dataclass(frozen=True)
class Line:
    """entries: quantity -> entry; length: (N,) m where known; notes."""

    entries: Mapping[str, Entry]
    length: np.ndarray | None
    notes: tuple[str, ...] = ()


def find_line(pool: Pool, seconds: np.ndarray, distance: np.ndarray | None) -> Line:
    """Tether length and reel-out speed. distance: (N,) m of the kite from the origin of its positions, where known."""
    entries, notes, length = {}, [], None
    if (reading := pool.best("tether_length")) is not None:
        values = reading.meaning.sign * pool.values[reading.column]
        unit = _unit_of_length(reading, values, distance)
        entries["tether_length"] = replace(entry(reading, unit), assumed="" if reading.unit else "unit by the distance")
        length = entries["tether_length"].si(pool.values[reading.column], "m")
        if distance is not None and (both := np.isfinite(length) & np.isfinite(distance)).sum() > 50:
            off = (length - distance)[both]
            spread = 1.4826 * _deviation(off)
            notes.append(f"the line is {np.median(off) + 0.0:.1f} m longer than the kite is far, give or take {spread:.1f} m")
    if (reading := pool.best("reel_out_speed")) is not None:
        entries["reel_out_speed"], said = _reeling(pool, reading, seconds, length if length is not None else distance)
        notes += said
    return Line(entries, length, tuple(notes))


def _deviation(x: np.ndarray) -> float:
    return float(np.median(np.abs(x - np.median(x))))


def _unit_of_length(reading: Reading, values: np.ndarray, distance: np.ndarray | None) -> str:
    """The unit in the header, else the one that makes the line as long as the kite is far."""
    units = units_for(reading, LENGTHS)
    if distance is None or len(units) == 1:
        return units[0]
    ratio = float(np.nanmedian(distance) / max(np.nanmedian(values), 1e-9))
    return min(units, key=lambda u: abs(math.log(max(ratio, 1e-9) / Entry("", u).si(np.ones(1), "m")[0])))


def _reeling(pool: Pool, reading: Reading, seconds: np.ndarray, length: np.ndarray | None) -> tuple[Entry, list[str]]:
    """Unit and sign of the reel-out speed by how the length grows, over a second."""
    values = reading.meaning.sign * pool.values[reading.column]
    units = units_for(reading, SPEEDS)
    line = replace(entry(reading, units[0]), assumed="" if reading.unit else "unit")
    width = max(1, int(round(1.0 / float(np.median(np.diff(seconds)))))) if seconds.size > 1 else 1
    if length is None or seconds.size <= 2 * width:
        return line, ["the reel-out speed could not be held against a length"]
    grown = (length[width:] - length[:-width]) / (seconds[width:] - seconds[:-width])
    mean = np.convolve(values, np.ones(width + 1) / (width + 1), "valid")
    good = np.isfinite(grown) & np.isfinite(mean)
    if good.sum() < 50 or grown[good].std() < 0.05:
        return line, ["the line hardly moves: unit and sign of the reel-out speed could not be checked"]
    # length sensors are coarse: the slope of one against the other, not a ratio sample by sample
    slope = float((grown[good] * mean[good]).sum() / max((mean[good] ** 2).sum(), 1e-12))
    unit = min(units, key=lambda u: abs(math.log(max(abs(slope), 1e-9) / Entry("", u).si(np.ones(1), "m/s")[0])))
    left = abs(slope) / Entry("", unit).si(np.ones(1), "m/s")[0]
    note = f"the line grows {left:.3g} times as fast as its reel-out speed says"
    sign = -1 if slope < 0 else 1
    line = replace(entry(reading, unit), sign=sign * reading.meaning.sign, assumed="" if reading.unit else "unit by the length")
    return line, [note if 0.8 < left < 1.25 else f"CHECK: {note}"]


def winch_height(position: np.ndarray, length: np.ndarray) -> tuple[np.ndarray, float] | None:
    """As `winch_place`, where only the zero of the altitude is another: the kite is sqrt(l^2 - n^2 - e^2) above the winch."""
    square = length**2 - position[0] ** 2 - position[1] ** 2
    good = np.isfinite(square) & np.isfinite(position[2]) & (square > 0)
    if good.sum() < 100:
        return None
    down = position[2][good] + np.sqrt(square[good])
    place = np.array([0.0, 0.0, float(np.median(down))])
    away = position[:, good] - place[:, None]
    left = float(np.sqrt(np.mean((np.sqrt((away**2).sum(0)) - length[good]) ** 2)))
    return place, left


def winch_place(position: np.ndarray, length: np.ndarray) -> tuple[np.ndarray, float] | None:
    """(the place (3,) from which the positions (3, N) are as far as the line is long, what is left [m]); None where no place is.

    |p - o| = l is linear in o and |o|^2 after squaring; Gauss-Newton steps on the distances follow.
    """
    good = np.isfinite(position.sum(0)) & np.isfinite(length)
    every = max(1, int(good.sum()) // 5000)
    p, line = position[:, good][:, ::every], length[good][::every]
    if p.shape[1] < 100:
        return None
    middle = p.mean(1, keepdims=True)
    A = np.vstack([-2 * (p - middle), np.ones(p.shape[1])]).T
    o = np.linalg.lstsq(A, line**2 - ((p - middle) ** 2).sum(0), rcond=None)[0][:3] + middle[:, 0]
    for _ in range(20):
        away = p - o[:, None]
        distance = np.sqrt((away**2).sum(0))
        o = o + np.linalg.lstsq(-(away / distance).T, line - distance, rcond=None)[0]
    left = float(np.sqrt(np.mean((np.sqrt(((p - o[:, None]) ** 2).sum(0)) - line) ** 2)))
    return (o, left) if np.isfinite(o).all() and left < 10.0 else None
