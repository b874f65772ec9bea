"""The University of Minnesota UAV laboratory's MATLAB files (Ultra Stick 25e and its sisters) -> FlightLog.

A file holds one struct `flight_data`: 50 Hz, SI, radians, degrees in lat and lon, NED, body FRD. What the fields mean was read from the
laboratory's flight code (github.com/UASLab/OpenFlight, MIT) and checked in flight: ax, ay, az are specific force less their bias (they
agree with d/dt of the navigation velocity without it), p, q, r likewise; the navigation filter takes each GNSS fix as it comes. The motor's
recorder runs on a clock of its own.
"""

from pathlib import Path

import numpy as np

from awescli.flightlog.autopilot import Autopilot, Channel, assembled, kinematic, local_ned, mixed
from awescli.flightlog.clocks import clock_offset
from awescli.flightlog.log import FlightLog
from awescli.flightlog.mat5 import read_mat
from awescli.flightlog.table import ABSURD
from awescli.notation.errors import BadInput, did_you_mean

STRUCT = "flight_data"

FIELDS = {
    "p": "p", "q": "q", "r": "r", "a_x": "ax", "a_y": "ay", "a_z": "az", "phi": "phi", "theta": "theta", "psi": "psi",
    "v_n": "navvn", "v_e": "navve", "v_d": "navvd",
}  # fmt: skip
"""Quantity -> field, SI as it stands; all are needed."""

AIR = {"V_a": "ias", "alpha": "aoa", "beta": "aos"}
"""Quantity -> field of the air data probe, where there is one."""

COMMANDS = {"aileron": (("da_r", 0.5), ("da_l", -0.5)), "elevator": (("de", 1.0),), "rudder": (("dr", 1.0),), "throttle": (("dthr", 1.0),)}
"""Set-point -> sum of command fields (left and right ailerons are logged after mixing: what rolls is half their difference). A flight.yaml
may mix others: `mix: {flaps: {of: {df_l: 0.5, df_r: 0.5}, unit: rad}}`."""

BY_HAND = 1.0
"""`mode` in which the pilot's sticks (`*_in`) drive the surfaces and the command fields stand at their trim."""

STANDING = 2.0
"""m/s: slower, before the first flight, the aircraft stands where its origin is put."""

GAS_CONSTANT, LAPSE, SEA_LEVEL = 287.05, 0.0065, 288.15
"""J/(kg K), K/m, K: International Standard Atmosphere, for the density from the static pressure; temperature is not logged."""

MOTOR_SEARCH = 60.0
"""s by which the motor's clock is looked for."""


def read_umn(path: Path, max_gap: float = 0.2, how: Autopilot | None = None) -> FlightLog:
    """A UMN .mat file as a flight log. Raises BadInput for files that are damaged, hold MATLAB objects, or lack a field."""
    how = how or Autopilot()
    struct = _load(path)
    stamps = _field(path, struct, "time")
    count = stamps.size

    def channel(name: str) -> Channel | None:
        values = struct.get(name)
        return Channel(stamps, _plain(values)) if isinstance(values, np.ndarray) and values.shape == (count,) else None

    def needed(name: str) -> np.ndarray:
        return _field(path, struct, name, count)

    notes = ["alpha, beta and V_a come from the air data probe as they were logged, V_a as indicated airspeed."]
    # the filter gives zeros before its first fix and coasts without fixes: neither is a measurement
    navigated = (needed("navlat") != 0) & (needed("navValid") == 0)
    signals = {q: needed(f) for q, f in FIELDS.items()}
    latitude, longitude, height = (needed(n) for n in ("navlat", "navlon", "navalt"))
    standing = navigated & (np.hypot(signals["v_n"], signals["v_e"]) < STANDING)
    if not navigated.any():
        raise BadInput("the navigation filter was never valid", f"{path}: {STRUCT}.navValid", "Is this a whole flight?")
    first_fast = int(np.argmax(navigated & ~standing)) if (navigated & ~standing).any() else count
    rest = standing & (np.arange(count) < first_fast)
    rest = rest if rest.any() else navigated
    origin = float(np.median(latitude[rest])), float(np.median(longitude[rest])), float(np.median(height[rest]))
    signals |= dict(zip(("p_n", "p_e", "p_d"), local_ned(latitude, longitude, height, origin), strict=True))
    for name in ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi"):
        signals[name] = np.where(navigated, signals[name], np.nan)
    signals |= {q: needed(f) for q, f in AIR.items() if f in struct}
    by_hand = needed("mode") == BY_HAND
    for quantity, parts in COMMANDS.items():
        if any(f not in struct for f, _ in parts):
            continue
        flown = {f: np.where(by_hand, needed(f"{f}_in"), needed(f)) if by_hand.any() else needed(f) for f, _ in parts}
        signals[quantity] = np.sum([k * flown[f] for f, k in parts], axis=0)
    if "throttle" in signals:
        signals["throttle"] = np.clip(signals["throttle"], 0.0, 1.0)
    if by_hand.any():
        notes.append(f"In {by_hand.sum() * np.median(np.diff(stamps)):.0f} s flown by hand the surfaces are the pilot's sticks (*_in).")
    channels = {name: Channel(stamps, values) for name, values in signals.items()}
    if how.navigation == "gnss":
        channels |= _gnss(path, struct, stamps, count, origin)
        notes.append("Position and velocity are the GNSS receiver's, which count where they are new.")
    channels |= kinematic(_known(channels))
    channels |= mixed(how, channel, lambda: sorted(k for k, v in struct.items() if isinstance(v, np.ndarray) and v.shape == (count,)))
    if (motor := _motor(struct, channels, notes)) is not None:
        channels["motor_speed"] = motor
    return assembled(
        path.resolve().parent.name, 0.0, channels, how, str(path), max_gap, density=_density(struct, height, navigated), notes=tuple(notes)
    )


def _known(channels: dict[str, Channel]) -> dict[str, Channel]:
    """The channels with the attitude held over where it is not known: an acceleration there is not known either, and is marked so by it."""
    result = dict(channels)
    for name in ("phi", "theta", "psi"):
        good = np.isfinite(channels[name].values)
        result[name] = Channel(channels[name].stamps[good], channels[name].values[good])
    return result


def _gnss(path: Path, struct: dict, stamps: np.ndarray, count: int, origin: tuple[float, float, float]) -> dict[str, Channel]:
    """Position and velocity of the receiver, at the samples at which it gave a new fix."""
    week = _field(path, struct, "GPS_TOW", count)
    new = np.flatnonzero(np.diff(week, prepend=week[0]) != 0)
    if new.size < 3:
        raise BadInput("the GNSS receiver gave no fixes", f"{path}: {STRUCT}.GPS_TOW", "Use navigation: estimator.")
    fix = {n: _field(path, struct, n, count)[new] for n in ("lat", "lon", "alt", "vn", "ve", "vd")}
    position = local_ned(np.deg2rad(fix["lat"]), np.deg2rad(fix["lon"]), fix["alt"], origin)
    values = dict(zip(("p_n", "p_e", "p_d", "v_n", "v_e", "v_d"), (*position, fix["vn"], fix["ve"], fix["vd"]), strict=True))
    return {name: Channel(stamps[new], signal) for name, signal in values.items()}


def _motor(struct: dict, channels: dict[str, Channel], notes: list[str]) -> Channel | None:
    """Revolutions of the motor per second, moved to the aircraft's clock by its recorder's throttle; None where that does not show."""
    found = [struct.get(n) for n in ("motor_time", "motor_throttle", "motor_RPM")]
    own = [x for x in found if isinstance(x, np.ndarray) and x.ndim == 1 and x.size > 100]
    if len(own) < 3 or len({x.shape for x in own}) > 1 or "throttle" not in channels:
        return None
    time, throttle, rpm = (_plain(x) for x in own)
    dt = float(np.median(np.diff(time)))
    both = [channels["throttle"].at(time), throttle]
    moving = np.flatnonzero(np.abs(np.diff(both[0], prepend=both[0][0])) > 0)
    if moving.size < 50 or not dt > 0:
        return None
    part = slice(moving[0], moving[-1] + 1)
    # over the time in which the throttle moves: before and after, both stand still and agree about nothing
    first, second = ((x[part] - x[part].mean()) / (x[part].std() or 1.0) for x in both)
    seen = clock_offset(first, second, dt, MOTOR_SEARCH)
    if seen is None or not seen.clear:
        notes.append("motor_RPM runs on a clock of its own that its throttle does not place; it was left out.")
        return None
    agreement = f"its throttle against the aircraft's, correlation {seen.correlation:.2f}"
    notes.append(f"The motor's recorder runs {seen.late:+.1f} s late ({agreement}); it was moved.")
    return Channel(time - seen.late, rpm / 60)


def _density(struct: dict, height: np.ndarray, navigated: np.ndarray) -> float | None:
    """Mean air density [kg/m3] from the static pressure [kPa] and the standard temperature at that height."""
    pressure = struct.get("Ps")
    if not isinstance(pressure, np.ndarray) or pressure.shape != height.shape:
        return None
    temperature = SEA_LEVEL - LAPSE * float(np.mean(height[navigated]))
    return float(np.mean(pressure[navigated])) * 1000 / (GAS_CONSTANT * temperature)


def _load(path: Path) -> dict:
    kinds, struct = read_mat(path, STRUCT, "Expected the University of Minnesota's flight file, a struct flight_data.")
    if STRUCT not in kinds:
        raise BadInput(f"no variable '{STRUCT}'", str(path), did_you_mean(STRUCT, kinds))
    if not isinstance(struct, dict):
        raise BadInput(f"'{STRUCT}' is no struct", str(path), f"Expected the fields time, p, q, r, ...; this is a {kinds[STRUCT]}.")
    return struct


def _field(path: Path, struct: dict, name: str, count: int | None = None) -> np.ndarray:
    """A field of numbers (count,); what no sensor reports becomes NaN."""
    where = f"{path}: {STRUCT}.{name}"
    if name not in struct:
        raise BadInput(f"the field '{name}' is missing", f"{path}: {STRUCT}", did_you_mean(name, struct))
    values = struct[name]
    if not isinstance(values, np.ndarray) or values.ndim != 1 or values.size < 3 or (count is not None and values.size != count):
        shape = values.shape if isinstance(values, np.ndarray) else getattr(values, "kind", "a struct")
        raise BadInput(f"{shape} instead of {count or 'N'} numbers", where, "Is the file complete?")
    return _plain(values)


def _plain(values: np.ndarray) -> np.ndarray:
    return np.where(np.abs(values) < ABSURD, values, np.nan)
