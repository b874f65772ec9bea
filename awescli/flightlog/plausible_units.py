"""Do the numbers fit the units they are said to have? A flight in other units is refused, not flown.

Only contradictions inside the log are used (a heading against the course, a rate against the attitude), or limits that no
kite of this size can reach, so that a strange flight is not taken for a wrong unit.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from awescli.flightlog.resample import usable_stamps
from awescli.flightlog.units import factor_to_si
from awescli.notation.errors import BadInput, BadInputs
from awescli.notation.quantities import CONTROL_SURFACES

TURNS = 2 * np.pi
"""rad of course change after which a heading must have moved as well."""

FLYING = 8.0
"""m/s: above, course and heading have to do with each other."""

MAX_FORCE_AREA = 12.0
"""m2, tension / dynamic pressure: a 3 m2 wing reaches 3 to 5, and a load in N taken for kgf ten times that."""

FULL_THROTTLE = 1.5
"""A throttle of 1 is full; trims and calibration may carry it a little beyond."""

CONFUSED = 0.12
"""A ratio this near to a conversion factor is taken for it."""

SPEEDS = {"km/h": 3.6, "kt": 3600 / 1852, "ft/s": 1 / 0.3048, "mph": 3600 / 1609.344}
LENGTHS = {"ft": 1 / 0.3048, "cm": 100.0, "mm": 1000.0, "km": 0.001}

RATES = (0.2, 4000.0)
"""Hz: no flight log is sampled slower or faster ..."""
USUAL_RATES = (1.0, 1000.0)
"""... and those that are, are sampled so."""

STEEPEST = 2.0
"""rad: a pitch angle ends at pi/2 by its definition, and a flow angle of a wing in flight far below."""

UNWRAPPED = 10.0
"""A heading that goes on counting turns as fast as the course does, within this factor, is in rad."""

YEARS = (946684800.0, 4102444800.0)
"""Unix time [s] of the years 2000 and 2100."""


def check_clock(stamps: np.ndarray, unit: str, where: str) -> None:
    """Raise BadInput where unix stamps in `unit` lie outside the years 2000 to 2100 but would not in another unit."""
    known = stamps[np.isfinite(stamps)]
    if known.size == 0:
        raise BadInput("no time stamp can be read", where, f"Expected unix time in {unit}.")
    middle = float(np.median(known))
    if YEARS[0] <= middle * factor_to_si(unit, "s") <= YEARS[1]:
        return
    for other in ("s", "ms", "us", "ns"):
        if YEARS[0] <= middle * factor_to_si(other, "s") <= YEARS[1]:
            do = f"Convert the column, or, for the kite's clock, add `units: {{epoch_ms: {other}}}` to a flight.yaml (format: kitemill)."
            raise BadInput(f"the stamps look like unix time in {other}, expected {unit}", where, do)
    raise BadInput(f"{middle:g} is no unix time in {unit}", where, "Expected the years 2000 to 2100.")


def is_unix(seconds: float) -> bool:
    """Is a stamp [s] unix time of the years 2000 to 2100?"""
    return YEARS[0] <= seconds <= YEARS[1]


def check_interval(seconds: np.ndarray, unit: str, where: str) -> None:
    """Raise BadInput where stamps [s], read in `unit`, are apart as no flight log's are, but would be in another unit."""
    step = np.diff(seconds[np.isfinite(seconds)])
    if not (step > 0).any():
        return
    typical = float(np.median(step[step > 0]))
    if 1 / RATES[1] <= typical <= 1 / RATES[0]:
        return
    for other in ("s", "ms", "us", "ns"):
        if 1 / USUAL_RATES[1] <= (apart := typical / factor_to_si(unit, "s") * factor_to_si(other, "s")) <= 1 / USUAL_RATES[0]:
            do = f"It looks like {other}: {1 / apart:.4g} Hz."
            raise BadInput(f"read in {unit} the samples are {typical:.3g} s apart, {1 / typical:.3g} Hz", where, do)


def check_units(
    seconds: np.ndarray, signals: Mapping[str, np.ndarray], places: Mapping[str, tuple[str, str]], believed: Iterable[str], cure: str
) -> None:
    """Raise BadInput(s) for signals whose numbers contradict their units.

    seconds: (N,) stamps; signals: quantity -> (N,) SI as converted, NaN where missing; places: quantity -> (where, column);
    believed: columns whose unit is not to be doubted; cure: what to do, with {column} and {unit} to be filled in.
    """
    rows = usable_stamps(seconds)[0]  # repeated and swapped rows would look like other speeds
    seconds, signals = seconds[rows], {name: values[rows] for name, values in signals.items()}
    if rows.size < 50:
        return
    s = {name: values for name, values in signals.items() if np.isfinite(values).mean() > 0.5}
    found = [
        *_angles(s),
        *_rates(s, seconds),
        *_positions(s, seconds),
        *_height(s),
        *_airspeed(s),
        *_tension(s),
        *_surfaces(s),
    ]
    errors = []
    for quantity, looks, why in found:
        where, column = places.get(quantity, (quantity, quantity))
        if column not in believed:
            do = f"It looks like {looks}. " + cure.format(column=column, unit=looks)
            errors.append(BadInput(why, where, do))
    if errors:
        raise errors[0] if len(errors) == 1 else BadInputs(errors)


Signals = Mapping[str, np.ndarray]
Finding = tuple[str, str, str]  # quantity, the unit it looks like, why


def _speed(s: Signals) -> np.ndarray | None:
    return np.sqrt(s["v_n"] ** 2 + s["v_e"] ** 2 + s["v_d"] ** 2) if {"v_n", "v_e", "v_d"} <= s.keys() else None


def _turned(s: Signals) -> float:
    """Range of the unwrapped course over ground while flying [rad]."""
    speed = _speed(s)
    if speed is None:
        return 0.0
    flying = np.flatnonzero(speed > FLYING)
    return float(np.ptp(np.unwrap(np.arctan2(s["v_e"][flying], s["v_n"][flying])))) if flying.size > 50 else 0.0


def _angles(s: Signals) -> list[Finding]:
    """Angles in deg read as rad exceed what there is; in rad read as deg they stay within 6.4 deg while the course goes round."""
    size = {n: float(np.nanpercentile(np.abs(s[n]), 99.5)) for n in ("phi", "theta", "psi", "alpha", "beta") if n in s}
    most = {"phi": 2 * np.pi + 0.2, "theta": STEEPEST, "psi": 2 * np.pi + 0.2, "alpha": STEEPEST, "beta": STEEPEST}
    large = [n for n in size if size[n] > most[n] and not (n == "psi" and _counts_turns(s))]
    found = [(n, "deg", f"{n} reaches {size[n]:.3g} rad, {size[n] / (2 * np.pi):.2g} turns") for n in large]
    if not found and {"phi", "theta", "psi"} <= s.keys() and _turned(s) > TURNS:
        if np.nanmax(s["psi"]) - np.nanmin(s["psi"]) < np.deg2rad(2 * np.pi + 0.1):
            why = "{} stays within {:.2f} deg while the course turns by {:.0f} deg"
            small = [n for n in ("phi", "theta", "psi") if size[n] < np.deg2rad(6.4)]
            return [(n, "rad", why.format(n, np.rad2deg(size[n]), np.rad2deg(_turned(s)))) for n in small]
    return found


def _counts_turns(s: Signals) -> bool:
    """Does the heading move as fast as the course over ground, sample by sample, and only goes on counting where others wrap?"""
    speed = _speed(s)
    if speed is None:
        return False
    course = np.arctan2(s["v_e"], s["v_n"])
    moved, turned = np.abs(np.diff(s["psi"])), np.abs(np.angle(np.exp(1j * np.diff(course))))
    flying = (speed[1:] > FLYING) & (turned > 1e-3) & np.isfinite(moved)
    return bool(flying.sum() > 50 and np.median(moved[flying] / turned[flying]) < UNWRAPPED)


def _apart(seconds: np.ndarray, apart: float) -> tuple[np.ndarray, np.ndarray]:
    """(i, j): pairs of samples at least `apart` [s] from each other, and not much more: by the clock, whatever bursts rows come in."""
    i = np.arange(seconds.size)
    j = np.searchsorted(seconds, seconds + (1 - 1e-9) * apart)
    i, j = i[j < seconds.size], j[j < seconds.size]
    near = seconds[j] - seconds[i] < max(1.5 * apart, 2.5 * float(np.median(np.diff(seconds))))
    return i[near], j[near]


def _rates(s: Signals, seconds: np.ndarray) -> list[Finding]:
    """Body rates against what the Euler angles do: a factor of 57 is a unit."""
    if not {"phi", "theta", "psi", "p", "q", "r"} <= s.keys():
        return []
    # over many samples, so that the noise of the angles does not pass for rotation
    i, j = _apart(seconds, 0.4)
    known = np.isfinite(sum(s[n][i] + s[n][j] for n in ("phi", "theta", "psi")))
    i, j = i[known], j[known]
    turn = [np.angle(np.exp(1j * (s[n][j] - s[n][i]))) / (seconds[j] - seconds[i]) for n in ("phi", "theta", "psi")]
    phi, theta = s["phi"][i], s["theta"][i]
    seen = [
        turn[0] - turn[2] * np.sin(theta),
        turn[1] * np.cos(phi) + turn[2] * np.sin(phi) * np.cos(theta),
        -turn[1] * np.sin(phi) + turn[2] * np.cos(phi) * np.cos(theta),
    ]
    moving = np.sum(np.square(seen), axis=0) > 0.1**2
    if moving.sum() < 20:
        return []
    ratio = float(np.nanmedian(np.sqrt(sum(s[n][i] ** 2 for n in "pqr"))[moving] / np.sqrt(sum(x**2 for x in seen))[moving]))
    why = f"the rates are {ratio:.3g} times what the Euler angles do"
    if 30 < ratio < 110:
        return [(n, "deg/s", why) for n in "pqr"]
    if 30 < 1 / max(ratio, 1e-9) < 110:
        return [(n, "rad/s", why) for n in "pqr"]
    return []


def _positions(s: Signals, seconds: np.ndarray) -> list[Finding]:
    """Way over ground against speed; tether length against range."""
    found: list[Finding] = []
    speed = _speed(s)
    if speed is None or not {"p_n", "p_e", "p_d"} <= s.keys():
        return found
    i, j = _apart(seconds, 1.0)
    way = np.sqrt(sum((s[n][j] - s[n][i]) ** 2 for n in ("p_n", "p_e", "p_d"))) / (seconds[j] - seconds[i])
    flying = (speed[i] > 3.0) & np.isfinite(way)
    if flying.sum() > 50:
        ratio = float(np.median(way[flying] / speed[i][flying]))
        if unit := _confused(ratio, LENGTHS):
            why = f"positions change {ratio:.3g} times as fast as the velocity says"
            found += [(n, unit, why) for n in ("p_n", "p_e", "p_d")]
        elif unit := _confused(1 / max(ratio, 1e-9), SPEEDS):
            found += [(n, unit, f"the velocity is {1 / ratio:.3g} times the change of position") for n in ("v_n", "v_e", "v_d")]
    if "tether_length" in s and not found:
        distance = np.sqrt(s["p_n"] ** 2 + s["p_e"] ** 2 + s["p_d"] ** 2)
        away = np.flatnonzero((distance > 50) & np.isfinite(s["tether_length"]))
        if away.size > 50:
            ratio = float(np.median(s["tether_length"][away] / distance[away]))
            if unit := _confused(ratio, LENGTHS):
                found.append(("tether_length", unit, f"the tether is {ratio:.3g} times as long as the kite is far"))
    return found


def _height(s: Signals) -> list[Finding]:
    """A flying kite is above its winch: p_d < 0."""
    speed = _speed(s)
    if speed is None or "p_d" not in s:
        return []
    flying = (speed > FLYING) & np.isfinite(s["p_d"])
    if flying.sum() > 50 and float(np.median(s["p_d"][flying])) > 5.0:
        low = float(np.median(s["p_d"][flying]))
        why = f"the kite flies {low:.0f} m below its winch: the down position is positive"
        return [("p_d", "height above ground (positive up)", why)]
    return []


def _airspeed(s: Signals) -> list[Finding]:
    """Pitot against speed over ground, in fast flight, where the wind is the smaller part."""
    speed = _speed(s)
    if speed is None or "V_a" not in s:
        return []
    fast = (speed > 15.0) & np.isfinite(s["V_a"])
    if fast.sum() < 50:
        return []
    ratio = float(np.median(s["V_a"][fast] / speed[fast]))
    # a strong wind may double the ratio, so knots (1.9) cannot be distinguished from weather
    unit = _confused(ratio, {"km/h": 3.6, "ft/s": 1 / 0.3048})
    return [("V_a", unit, f"the airspeed is {ratio:.2g} times the speed over ground")] if unit else []


def _tension(s: Signals) -> list[Finding]:
    """Tension per dynamic pressure is an area, and the wing has only so much of it."""
    airspeed = s.get("V_a") if "V_a" in s else _speed(s)
    if "tension" not in s or airspeed is None:
        return []
    fast = (airspeed > 15.0) & np.isfinite(s["tension"])
    if fast.sum() < 50:
        return []
    area = float(np.percentile(s["tension"][fast] / (0.6 * airspeed[fast] ** 2), 75))
    if area > MAX_FORCE_AREA:
        return [("tension", "N", f"the load needs a wing of {area:.0f} m2 at this airspeed")]
    return []


def _surfaces(s: Signals) -> list[Finding]:
    """Surfaces that never leave +-1 deg do not turn a kite; those beyond +-90 deg do not exist."""
    there = [n for n in CONTROL_SURFACES if n in s]
    size = {n: float(np.nanmax(np.abs(s[n]))) for n in there}
    found = [(n, "deg", f"{n} reaches {size[n]:.1f} rad") for n in there if size[n] > np.pi / 2]
    if "throttle" in s and (most := float(np.nanmax(s["throttle"]))) > FULL_THROTTLE:
        found.append(("throttle", "%", f"the throttle reaches {most:.3g}, and 1 is all of it"))
    moving = [n for n in there if np.nanstd(s[n]) > 0]
    if not found and moving and max(size.values()) < np.deg2rad(1.0) and _turned(s) > TURNS:
        return [(n, "rad", f"no surface leaves +-{np.rad2deg(max(size.values())):.2f} deg while the kite turns") for n in moving]
    return found


def _confused(ratio: float, factors: Mapping[str, float]) -> str | None:
    """The unit whose factor `ratio` is."""
    return next((unit for unit, factor in factors.items() if abs(ratio / factor - 1) < CONFUSED), None)
