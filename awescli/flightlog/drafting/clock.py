"""Which column is the clock, and in which unit: stamps run forward, at a rate that flight logs have, or are unix time."""

import numpy as np

from awescli.flightlog.drafting.pool import Entry, Pool, entry
from awescli.flightlog.plausible_units import USUAL_RATES, is_unix
from awescli.flightlog.text_stamps import ISO
from awescli.flightlog.units import factor_to_si

UNITS = ("s", "ms", "us", "ns", "min", "h")
FORWARD = 0.95
"""Share of the steps that run forward in a clock."""
SLOWEST_WEATHER = 86400.0
"""s between the rows of a weather file, at most."""


def clock(pool: Pool, weather: bool = False, unix: bool | None = None) -> Entry | None:
    """The entry of the clock; None where no column is one. unix: prefer a clock that is (not) unix time; weather: rows may be far apart,
    and several rows may have one stamp."""
    found = []
    for reading in pool.of("time"):
        stamps = pool.values[reading.column]
        known = stamps[np.isfinite(stamps)]
        step = np.diff(known)
        if known.size < 2 or (step >= 0 if weather else step > 0).mean() < FORWARD or not (step > 0).any():
            continue
        if reading.column in pool.text:
            found.append(((unix is not None and is_unix(float(np.median(known))) != unix), reading.rank, entry(reading, ISO, "text")))
            continue
        unit, how = _unit(known, float(np.median(step[step > 0])), reading.unit, weather)
        if unit is None:
            continue
        middle = is_unix(float(np.median(known)) * factor_to_si(unit, "s"))
        found.append(((unix is not None and middle != unix), reading.rank, entry(reading, unit, f"{how}{', unix time' if middle else ''}")))
    return min(found, key=lambda f: f[:2])[2] if found else None


def _unit(stamps: np.ndarray, step: float, named: str | None, weather: bool) -> tuple[str | None, str]:
    """(unit, how it was found)"""
    middle = float(np.median(stamps))
    for unit in UNITS[:4]:
        if is_unix(middle * factor_to_si(unit, "s")) and _fits(step, unit, weather):
            return unit, f"steps of {step * factor_to_si(unit, 's'):.4g} s"
    if named is not None and _fits(step, named, weather):
        return named, f"unit in its name, steps of {step * factor_to_si(named, 's'):.4g} s"
    fitting = [u for u in UNITS if _fits(step, u, weather)]
    return (fitting[0], f"steps of {step * factor_to_si(fitting[0], 's'):.4g} s") if fitting else (None, "")


def _fits(step: float, unit: str, weather: bool) -> bool:
    seconds = step * factor_to_si(unit, "s")
    return 1e-3 < seconds < SLOWEST_WEATHER if weather else 1 / USUAL_RATES[1] <= seconds <= 1 / USUAL_RATES[0]
