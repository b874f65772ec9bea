"""Attitude and rates: units, and which way each counts, by what Euler angles and gyros say of each other and where the kite goes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from awescli.flightlog.drafting.headers import Reading
from awescli.flightlog.drafting.pool import Entry, Pool, also, entry, high
from awescli.flightlog.motion import euler_rates, forwardness

ANGLES, RATES = ("phi", "theta", "psi"), ("p", "q", "r")
CLEAR = 0.15
"""By so much more forward the kite must go, or its rates must agree, for an unusual sign to be believed."""
HEADINGS = {
    "": (1, 0.0), "counted from east": (-1, 90.0), "counter-clockwise": (-1, 0.0), "the tail's": (1, 180.0), "90 deg off": (1, 90.0),
}  # fmt: skip
"""What a yaw column may be: in words -> (sign, offset [deg])."""
PER_RADIAN = 180 / math.pi


@dataclass(frozen=True)
class Turning:
    """entries: quantity -> entry; angles: (N,) rad where known; notes: what bears them out."""

    entries: Mapping[str, Entry]
    angles: Mapping[str, np.ndarray]
    notes: tuple[str, ...] = ()


def find_attitude(pool: Pool) -> Turning:
    """Roll, pitch and yaw as their headers name them, deg or rad by header or size."""
    chosen = {q: r for q in ANGLES if (r := pool.best(q))}
    named = {r.unit for r in chosen.values() if r.unit}
    sizes = {q: high(pool.values[r.column]) for q, r in chosen.items()}
    # rad never exceeds a turn, and roll, pitch and yaw come in one unit
    guess = next(iter(named)) if len(named) == 1 else "deg" if max(sizes.values(), default=0.0) > 2 * math.pi + 0.3 else "rad"
    entries = {}
    for quantity, reading in chosen.items():
        said = "" if reading.unit else f"unit of its neighbours, reaches {sizes[quantity]:.3g}"
        entries[quantity] = entry(reading, reading.unit or guess, said)
    return Turning(entries, _angles(pool, entries))


def _angles(pool: Pool, entries: Mapping[str, Entry]) -> dict[str, np.ndarray]:
    return {q: e.si(pool.values[e.column], "rad") for q, e in entries.items()}


def turned_forward(pool: Pool, turning: Turning, velocity: np.ndarray) -> Turning:
    """The attitude with the signs of pitch and yaw that let the kite go where it points. velocity: (3, N) NED."""
    if set(turning.entries) != set(ANGLES):
        return turning
    found = []
    for (word, (sign, offset)), up in product(HEADINGS.items(), (1, -1)):
        entries = dict(turning.entries)
        yaw, unit = entries["psi"], 1.0 if entries["psi"].unit == "deg" else 1 / PER_RADIAN
        entries["psi"] = replace(yaw, sign=sign, offset=offset * unit, why=also(yaw.why, word))
        entries["theta"] = replace(entries["theta"], sign=up, why=also(entries["theta"].why, "nose down positive" if up < 0 else ""))
        angles = _angles(pool, entries)
        found.append((forwardness(angles, velocity), entries, angles))
    if not np.isfinite(found[0][0]):
        return turning
    usual, best = found[0], max(found, key=lambda f: f[0])
    if best[0] < usual[0] + CLEAR:
        best = usual
    note = f"the kite goes {100 * best[0]:.0f} % forward in its own axes"
    return Turning(best[1], best[2], (note if best[0] > 0.7 else f"CHECK: {note}; a wing in flight goes more than 70 %",))


def find_rates(pool: Pool, seconds: np.ndarray, turning: Turning) -> Turning:
    """Body rates, and the sign of roll, by what the Euler angles do. The given attitude is in the result."""
    chosen = {q: r for q in RATES if (r := pool.best(q))}
    if set(chosen) != set(RATES) or set(turning.entries) != set(ANGLES):
        return replace(turning, entries={**turning.entries, **{q: _by_size(pool, r) for q, r in chosen.items()}})
    gyros = np.array([r.meaning.sign * pool.values[r.column] for r in chosen.values()])
    found = []
    for roll in (1, -1):
        seen = np.array(euler_rates(roll * turning.angles["phi"], turning.angles["theta"], turning.angles["psi"], seconds))
        good = np.isfinite(seen.sum(0)) & np.isfinite(gyros.sum(0)) & (np.abs(turning.angles["theta"]) < 1.3)
        if good.sum() < 100:
            break
        agree = np.array([_correlation(s, g) for s, g in zip(seen[:, good], gyros[:, good], strict=True)])
        sizes = [np.median(np.sqrt((x[:, good] ** 2).sum(0))) for x in (gyros, seen)]
        # an axis that hardly turns says nothing of its sign
        found.append((float(np.abs(agree).sum()) - CLEAR * (agree < 0).sum(), roll, agree, sizes[0] / max(sizes[1], 1e-9)))
    if not found:
        return replace(turning, entries={**turning.entries, **{q: _by_size(pool, r) for q, r in chosen.items()}})
    usual, best = found[0], max(found, key=lambda f: f[0])
    if best[0] < usual[0] + CLEAR:
        best = usual
    _, roll, agree, ratio = best
    unit = min(("rad/s", "deg/s"), key=lambda u: abs(math.log(max(ratio, 1e-9) * (1.0 if u == "rad/s" else 1 / PER_RADIAN))))
    entries, notes = dict(turning.entries), []
    if roll < 0:
        entries["phi"] = replace(entries["phi"], sign=-1, why=also(entries["phi"].why, "left wing down positive, by the gyros"))
    for (quantity, reading), c in zip(chosen.items(), agree, strict=True):
        line = entry(reading, reading.unit or unit)
        sign = -1 if c < -0.5 else 1
        entries[quantity] = replace(line, sign=sign * line.sign, why=f"correlates {c:+.2f} with the Euler angles")
    left = ratio * (1.0 if (chosen["p"].unit or unit) == "rad/s" else 1 / PER_RADIAN)
    said = f"gyros turn {left:.3g} times as fast as the Euler angles (correlation {', '.join(f'{c:.2f}' for c in agree)})"
    notes.append(said if 0.7 < left < 1.4 and (np.abs(agree) > 0.7).sum() >= 2 else f"CHECK: {said}")
    return Turning(entries, _angles(pool, {q: entries[q] for q in ANGLES}), (*turning.notes, *notes))


def _by_size(pool: Pool, reading: Reading) -> Entry:
    """Rates without an attitude to hold them against: a wing turns by less than 10 rad/s."""
    size = high(pool.values[reading.column])
    return entry(reading, reading.unit or ("deg/s" if size > 10 else "rad/s"), f"reaches {size:.3g}")


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    spread = a.std() * b.std()
    return float(((a - a.mean()) * (b - b.mean())).mean() / spread) if spread > 0 else 0.0
