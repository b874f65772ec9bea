"""PX4's ULog files (.ulg) -> FlightLog, read by `pyulog` (BSD-3; the extra `px4`).

Topics and fields: PX4 user guide, uORB message reference. Every topic has its own rate; times are microseconds since boot. Attitude is a
quaternion body to NED, accelerations are specific force.
"""

import contextlib
import io
import struct
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from awescli.flightlog.autopilot import TRAVEL, Autopilot, Channel, assembled, euler_angles_of, kinematic, local_ned, mixed
from awescli.flightlog.log import FlightLog, WindRecord
from awescli.notation.errors import BadInput

Topics = Mapping[str, Mapping[str, np.ndarray]]
"""Topic -> field -> samples."""
MICRO = 1e-6

POSITION = "vehicle_local_position"
NAVIGATION = {"p_n": "x", "p_e": "y", "p_d": "z", "v_n": "vx", "v_e": "vy", "v_d": "vz"}

RATES = (("vehicle_angular_velocity", "xyz[{}]"), ("sensor_combined", "gyro_rad[{}]"))
FORCES = (("vehicle_acceleration", "xyz[{}]"), ("sensor_combined", "accelerometer_m_s2[{}]"))
"""Three axes each; the first topic that the log has."""

AIRSPEED = (("airspeed_validated", "true_airspeed_m_s"), ("airspeed", "true_airspeed_m_s"))
WIND = ("wind", "wind_estimate")
DENSITY = (("vehicle_air_data", "rho"),)

COMMANDS = (
    {"aileron": ("actuator_controls_0", "control[0]"), "elevator": ("actuator_controls_0", "control[1]"),
     "rudder": ("actuator_controls_0", "control[2]"), "throttle": ("actuator_controls_0", "control[3]"),
     "flaps": ("actuator_controls_0", "control[4]")},
    {"aileron": ("vehicle_torque_setpoint", "xyz[0]"), "elevator": ("vehicle_torque_setpoint", "xyz[1]"),
     "rudder": ("vehicle_torque_setpoint", "xyz[2]"), "throttle": ("vehicle_thrust_setpoint", "xyz[0]")},
)  # fmt: skip
"""Set-point -> (topic, field), shares of full command, up to v1.13 and since: the first group that the log has counts."""

ACTUATORS = ("actuator_servos", "actuator_outputs", "actuator_motors", "actuator_controls_0", "vehicle_torque_setpoint")
REVOLUTIONS = (("rpm", "indicated_frequency_rpm"), ("esc_status", "esc[0].esc_rpm"))

TOPICS = (
    POSITION, "vehicle_attitude", "vehicle_gps_position", "sensor_gps", "vehicle_thrust_setpoint",
    *(t for t, _ in (*RATES, *FORCES, *AIRSPEED, *DENSITY, *REVOLUTIONS)), *WIND, *ACTUATORS,
)  # fmt: skip


def read_px4(path: Path, max_gap: float = 0.2, how: Autopilot | None = None) -> FlightLog:
    """A .ulg file as a flight log. Raises BadInput without `pyulog`, for files that it cannot read, and for missing topics."""
    how = how or Autopilot()
    topics = _topics(path, (*TOPICS, *(name.partition(".")[0] for mix in how.mix.values() for name in mix.of)))

    def channel(name: str) -> Channel | None:
        """`topic.field`, e.g. actuator_servos.control[0]."""
        topic, _, field = name.partition(".")
        return _channel(topics, topic, field)

    channels: dict[str, Channel] = {}
    notes: list[str] = []
    for quantity, field in NAVIGATION.items():
        _put(channels, quantity, _channel(topics, POSITION, field))
    quaternion = [q for i in range(4) if (q := _channel(topics, "vehicle_attitude", f"q[{i}]")) is not None]
    if len(quaternion) == 4:
        angles = euler_angles_of(*(q.values for q in quaternion))
        channels |= {n: Channel(quaternion[0].stamps, a) for n, a in zip(("phi", "theta", "psi"), angles, strict=True)}
    for names, sources in ((("p", "q", "r"), RATES), (("a_x", "a_y", "a_z"), FORCES)):
        for i, name in enumerate(names):
            _put(channels, name, _first(topics, ((topic, field.format(i)) for topic, field in sources)))
    if all(n in channels for n in ("a_x", "a_y", "a_z", "phi")):
        channels |= kinematic(channels)
    _put(channels, "V_a", _first(topics, AIRSPEED))
    if how.navigation == "gnss":
        channels |= _gnss(path, topics)
        notes.append("Position and velocity are the GNSS receiver's, which count where they are new.")
    channels |= _commands(topics, notes, bool(how.mix))
    if (turns := _first(topics, REVOLUTIONS)) is not None:
        channels["motor_speed"] = Channel(turns.stamps, turns.values / 60)
    channels |= mixed(how, channel, lambda: sorted(f"{t}.{f}" for t, fields in topics.items() for f in fields if f != "timestamp"))
    wind, density = _wind(topics, channels), _first(topics, DENSITY)
    there = ", ".join(t for t in ACTUATORS if t in topics)
    return assembled(
        path.resolve().parent.name, _unix(topics), channels, how, str(path), max_gap, wind=wind,
        density=None if density is None else float(np.nanmean(density.values)), notes=tuple(notes), surfaces=there,
    )  # fmt: skip


def _topics(path: Path, names: tuple[str, ...]) -> dict[str, dict[str, np.ndarray]]:
    """topic -> field -> values, of the first instance of every wanted topic that the file has."""
    try:
        from pyulog import ULog
        from pyulog.core import ULogException
    except ImportError:
        raise BadInput("reading .ulg files needs pyulog", str(path), "Install it with the extra: pip install 'awes[px4]'.") from None
    try:
        # pyulog tells of odd files on the terminal, which is not its place here
        with contextlib.redirect_stdout(io.StringIO()), path.open("rb") as file:
            found = ULog(file, list(dict.fromkeys(names)))
    except (ULogException, OSError, struct.error, ValueError, TypeError, IndexError, KeyError, AttributeError, MemoryError) as e:
        raise BadInput(f"not a readable ULog file ({type(e).__name__}: {str(e)[:100]})", str(path), "Copy the file again.") from None
    topics: dict[str, dict[str, np.ndarray]] = {}
    for data in sorted(found.data_list, key=lambda d: d.multi_id):
        if data.name not in topics and data.data.get("timestamp", np.empty(0)).size:
            topics[data.name] = data.data
    if not topics:
        raise BadInput("the log has none of the topics of a flight", str(path), f"Expected {', '.join(TOPICS[:4])}, ...")
    return topics


def _unix(topics: Topics) -> float:
    """Unix time [s] at stamp 0, from the receiver's clock; 0 where the log has none."""
    utc = _first(topics, ((t, "time_utc_usec") for t in ("vehicle_gps_position", "sensor_gps")))
    if utc is None or not (utc.values > 0).any():
        return 0.0
    first = int(np.flatnonzero(utc.values > 0)[0])
    return float(utc.values[first] * MICRO - utc.stamps[first])


def _channel(topics: Topics, topic: str, field: str) -> Channel | None:
    fields = topics.get(topic, {})
    if field not in fields:
        return None
    return Channel(fields["timestamp"] * MICRO, np.asarray(fields[field], dtype=float))


def _first(topics: Topics, sources: Iterable[tuple[str, str]]) -> Channel | None:
    """The first channel that the log has and that holds a number."""
    found = (_channel(topics, topic, field) for topic, field in sources)
    return next((c for c in found if c is not None and np.isfinite(c.values).any()), None)


def _put(channels: dict[str, Channel], name: str, channel: Channel | None) -> None:
    if channel is not None:
        channels[name] = channel


def _commands(topics: Topics, notes: list[str], silent: bool) -> dict[str, Channel]:
    """Set-points by their conventional channels. silent: a flight.yaml says what counts, and knows."""
    for group in COMMANDS:
        found = {q: c for q, (t, f) in group.items() if (c := _channel(topics, t, f)) is not None}
        if any(q != "throttle" for q in found):
            if not silent:
                notes.append(
                    f"Surfaces are shares of full command ({', '.join(sorted({t for t, _ in group.values()}))}), taken as "
                    f"{np.rad2deg(TRAVEL):.0f} deg at full: say in a flight.yaml what they are (`mix`)."
                )
            return {q: c if q == "throttle" else Channel(c.stamps, TRAVEL * c.values) for q, c in found.items()}
    return {}


def _gnss(path: Path, topics: Topics) -> dict[str, Channel]:
    """Position and velocity of the receiver; degrees since v1.14, integers of 1e-7 deg and mm before."""
    fields = topics.get("vehicle_gps_position") or topics.get("sensor_gps")
    if fields is None:
        raise BadInput("the log has no vehicle_gps_position", str(path), "Use navigation: estimator.")
    stamps = fields["timestamp"] * MICRO
    names = ("latitude_deg", "longitude_deg", "altitude_msl_m") if "latitude_deg" in fields else ("lat", "lon", "alt")
    factors = (1.0, 1.0, 1.0) if "latitude_deg" in fields else (1e-7, 1e-7, 1e-3)
    lat, lon, alt = (np.asarray(fields[n], dtype=float) * k for n, k in zip(names, factors, strict=True))
    position = local_ned(np.deg2rad(lat), np.deg2rad(lon), alt, (np.deg2rad(lat[0]), np.deg2rad(lon[0]), alt[0]))
    velocity = (np.asarray(fields[f"vel_{a}_m_s"], dtype=float) for a in "ned")
    return {n: Channel(stamps, v) for n, v in zip(("p_n", "p_e", "p_d", "v_n", "v_e", "v_d"), (*position, *velocity), strict=True)}


def _wind(topics: Topics, channels: dict[str, Channel]) -> WindRecord | None:
    """The estimator's wind, at the mean height of flight; None where the log has none."""
    for topic in WIND:
        north, east = (_channel(topics, topic, f"windspeed_{a}") for a in ("north", "east"))
        if north is not None and east is not None and "p_d" in channels:
            return wind_of(north, east, channels["p_d"])
    return None


def wind_of(north: Channel, east: Channel, down: Channel) -> WindRecord | None:
    """A record of wind components [m/s, towards], at the mean height above the origin; None where no value is a number."""
    good = np.isfinite(north.values) & np.isfinite(east.values)
    if good.sum() < 1:
        return None
    stamps, n, e = north.stamps[good], north.values[good], east.values[good]
    height = np.array([max(float(-np.nanmean(down.values)), 1.0)])
    direction = np.unwrap(np.arctan2(-e, -n))[:, None]
    return WindRecord(stamps, height, np.hypot(n, e)[:, None], direction, np.zeros((n.size, 1)))
