"""From the channels of an autopilot's log, each at its own rate, to a FlightLog: what the readers of such formats share."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from awescli.flightlog.flight_file import Mix
from awescli.flightlog.log import FlightLog, WindRecord
from awescli.flightlog.resample import RawFlight, sample_interval, uniform_log, usable_stamps
from awescli.flightlog.spikes import without_spikes
from awescli.flightlog.units import GRAVITY, factor_to_si
from awescli.flightlog.wind_triangle import with_some_wind
from awescli.notation.errors import BadInput, did_you_mean
from awescli.notation.frames import rotate_back, rotation_body_to_ned
from awescli.notation.quantities import CONTROL_SURFACES, UNITS

FASTEST = 100.0
"""Hz of the common clock at most: rigid wings do nothing faster, and inertial sensors that are faster are averaged."""

TRAVEL = np.deg2rad(25.0)
"""rad of a surface at full command, where a log has commands as shares of full travel and nobody says how much that is."""

NEEDED = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r")


@dataclass(frozen=True)
class Channel:
    """One channel at its own rate: stamps (N,) s on the flight's clock, values (N,)."""

    stamps: np.ndarray
    values: np.ndarray

    def at(self, stamps: np.ndarray) -> np.ndarray:
        """Values at other stamps, linear between its own."""
        return np.interp(stamps, self.stamps, self.values)


@dataclass(frozen=True)
class Autopilot:
    """What a flight.yaml says of such a log. mix: quantity -> sum of channels; navigation: whose position and velocity; where: the file
    that says it; late: clock group -> s by which its records come late."""

    mix: Mapping[str, Mix] = field(default_factory=dict)
    navigation: str = "estimator"
    where: str = ""
    late: Mapping[str, float] = field(default_factory=dict)


def mixed(how: Autopilot, lookup: Callable[[str], Channel | None], known: Callable[[], list[str]]) -> dict[str, Channel]:
    """The quantities that flight.yaml mixes from channels. lookup: name of a channel -> it; known: names for an error."""
    result = {}
    for quantity, mix in how.mix.items():
        parts = []
        for name, factor in mix.of.items():
            channel = lookup(name)
            if channel is None:
                raise BadInput(f"the log has no channel '{name}'", f"{how.where}: mix.{quantity}.of", did_you_mean(name, known()))
            parts.append((factor, channel))
        try:
            unit = factor_to_si(mix.unit, UNITS[quantity])
        except BadInput as e:
            raise BadInput(e.what, f"{how.where}: mix.{quantity}.unit", e.do) from None
        stamps = parts[0][1].stamps
        total = sum((factor * channel.at(stamps) for factor, channel in parts), np.zeros(len(stamps)))
        result[quantity] = Channel(stamps, (total + mix.offset) * unit)
    return result


def kinematic(channels: Mapping[str, Channel]) -> dict[str, Channel]:
    """a_x, a_y, a_z as kinematic acceleration, from channels that hold the specific force f: f + R^T (0, 0, g)."""
    stamps = channels["a_x"].stamps
    angles = (Channel(channels[n].stamps, np.unwrap(channels[n].values)).at(stamps) for n in ("phi", "theta", "psi"))
    zero = np.zeros(stamps.size)
    weight = rotate_back(rotation_body_to_ned(*angles), (zero, zero, zero + GRAVITY))
    return {name: Channel(stamps, channels[name].at(stamps) + g) for name, g in zip(("a_x", "a_y", "a_z"), weight, strict=True)}


def assembled(
    name: str, start: float, channels: Mapping[str, Channel], how: Autopilot, path: str, max_gap: float, *,
    wind: WindRecord | None = None, density: float | None = None, notes: tuple[str, ...] = (), surfaces: str = "",
) -> FlightLog:  # fmt: skip
    """The flight on one clock, that of the rates (at most FASTEST), from when all needed channels are there until one of them ends.

    start: unix time of stamp 0 [s]; wind: as logged, or None: it is then found from airspeed and velocity, or taken for zero;
    density [kg/m3]; surfaces: what the log has instead, for the error where no control surface is among the channels.
    """
    if missing := [n for n in NEEDED if n not in channels]:
        raise BadInput(f"the log lacks {', '.join(missing)}", path, "A model needs position, velocity, attitude and rates.")
    if not any(n in channels for n in CONTROL_SURFACES):
        what = "the log has no surface outputs that awes knows" + (f"; it has {surfaces}" if surfaces else "")
        do = "Log the actuators, or say in a flight.yaml what drives what: `mix: {elevator: {of: {CHANNEL: 0.4}, unit: rad}}`."
        raise BadInput(what, path, do)
    channels, spikes = _clean(channels)
    if short := [n for n in NEEDED if channels[n].stamps.size < 3]:
        raise BadInput(f"{', '.join(short)} have fewer than 3 values", path, "Is the log complete?")
    first, last = max(channels[n].stamps[0] for n in NEEDED), min(channels[n].stamps[-1] for n in NEEDED)
    dt = max(sample_interval(channels["p"].stamps), 1 / FASTEST)
    if last - first < 3 * dt:
        raise BadInput("position, attitude and rates do not overlap in time", path, "Do all topics run on one clock?")
    clock = first + dt * np.arange(int((last - first) / dt) + 1)
    groups = {n: "motor" if n == "motor_speed" else "onboard" for n in channels} | {"wind": "weather"}
    raw = RawFlight(
        name, start, clock, {n: c.values for n, c in channels.items()}, path, groups, dict(how.late), wind, notes, spikes,
        own_stamps={n: c.stamps for n, c in channels.items()},
    )  # fmt: skip
    return with_some_wind(uniform_log(raw, max_gap), density)


def _clean(channels: Mapping[str, Channel]) -> tuple[dict[str, Channel], dict[str, int]]:
    """(channels without what is missing, without stamps that do not run forward and without spikes; quantity -> spikes it had)."""
    clean, spikes = {}, {}
    for name, channel in channels.items():
        rows = np.flatnonzero(np.isfinite(channel.values) & np.isfinite(channel.stamps))
        rows = rows[usable_stamps(channel.stamps[rows])[0]]
        signals, found = without_spikes({name: channel.values}, rows)
        rows = rows[np.isfinite(signals[name][rows])]
        clean[name] = Channel(channel.stamps[rows], signals[name][rows])
        spikes |= found
    return clean, spikes


def euler_angles_of(q0: np.ndarray, q1: np.ndarray, q2: np.ndarray, q3: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(phi, theta, psi), each (N,) rad, ZYX, of body-to-NED quaternions, scalar first (Beard & McLain, eq. B.1)."""
    return (
        np.arctan2(2 * (q0 * q1 + q2 * q3), q0 * q0 + q3 * q3 - q1 * q1 - q2 * q2),
        np.arcsin(np.clip(2 * (q0 * q2 - q1 * q3), -1.0, 1.0)),
        np.arctan2(2 * (q0 * q3 + q1 * q2), q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3),
    )


def local_ned(
    latitude: np.ndarray, longitude: np.ndarray, height: np.ndarray, origin: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(p_n, p_e, p_d), each (N,) m, from geodetic positions [rad, rad, m], by the radii of curvature at the origin (WGS 84)."""
    a, e2 = 6378137.0, 6.69437999014e-3
    lat, lon, high = origin
    w = 1 - e2 * np.sin(lat) ** 2
    north, east = a * (1 - e2) / w**1.5 + high, a / np.sqrt(w) + high
    return (latitude - lat) * north, (longitude - lon) * east * np.cos(lat), high - height
