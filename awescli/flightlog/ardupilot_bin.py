"""ArduPilot's DataFlash files (.bin) -> FlightLog, read by `pymavlink` (LGPL-3; the extra `ardupilot`).

Messages and fields: ArduPilot Plane, "Onboard Message Log Messages". Every message has its own rate; TimeUS is microseconds since boot.
Angles are in degrees, accelerations are specific force. Of several instances (I) or filter cores (C) the first counts.
"""

import contextlib
import io
import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from awescli.flightlog.autopilot import TRAVEL, Autopilot, Channel, assembled, kinematic, local_ned, mixed
from awescli.flightlog.log import FlightLog
from awescli.flightlog.px4_ulog import wind_of
from awescli.notation.errors import BadInput

MICRO = 1e-6
GPS_EPOCH, LEAP_SECONDS = 315964800.0, 18.0
"""s: unix time at which GPS weeks begin to count, and by how much GPS time is ahead of UTC since 2017."""
DEGREE = np.pi / 180

NAVIGATION = (("p_n", "PN"), ("p_e", "PE"), ("p_d", "PD"), ("v_n", "VN"), ("v_e", "VE"), ("v_d", "VD"))
FILTERS = ("XKF1", "NKF1")
"""EKF3 and EKF2: navigation; their second message has the wind (VWN, VWE)."""
WIND = ("XKF2", "NKF2")

ATTITUDE = (("phi", "Roll"), ("theta", "Pitch"), ("psi", "Yaw"))
INERTIAL = (("p", "GyrX"), ("q", "GyrY"), ("r", "GyrZ"), ("a_x", "AccX"), ("a_y", "AccY"), ("a_z", "AccZ"))
AIRSPEED = (("ARSP", "Airspeed"),)
REVOLUTIONS = (("RPM", "rpm1"), ("RPM", "RPM"), ("ESC", "RPM"))

COMMANDS = {"aileron": "Ail", "elevator": "Elev", "rudder": "Rudd"}
FULL_COMMAND, FULL_THROTTLE = 4500.0, 100.0
"""AETR holds what goes into the mixer: -4500 to 4500 of a surface, 0 to 100 of throttle and flaps."""

DAMAGED = (OSError, struct.error, ValueError, TypeError, IndexError, KeyError, AttributeError, AssertionError, MemoryError)
"""What pymavlink runs into on bytes that are no log."""

ACTUATORS = ("AETR", "RCOU")
MESSAGES = (*FILTERS, *WIND, "ATT", "IMU", "ARSP", "GPS", "RPM", "ESC", *ACTUATORS)


def read_ardupilot(path: Path, max_gap: float = 0.2, how: Autopilot | None = None) -> FlightLog:
    """A DataFlash .bin file as a flight log. Raises BadInput without `pymavlink`, for files it cannot read, and for missing messages."""
    how = how or Autopilot()
    messages = _messages(path, (*MESSAGES, *(name.partition(".")[0] for mix in how.mix.values() for name in mix.of)))

    def channel(name: str) -> Channel | None:
        """`message.field`, e.g. RCOU.C1."""
        message, _, field = name.partition(".")
        fields = messages.get(message, {})
        return Channel(fields["TimeUS"] * MICRO, fields[field]) if field in fields else None

    def put(name: str, wanted: str, factor: float = 1.0) -> None:
        if (found := channel(wanted)) is not None:
            channels[name] = Channel(found.stamps, factor * found.values)

    channels: dict[str, Channel] = {}
    notes: list[str] = []
    estimator = next((m for m in FILTERS if m in messages), FILTERS[0])
    for quantity, field in NAVIGATION:
        put(quantity, f"{estimator}.{field}")
    for quantity, field in ATTITUDE:
        put(quantity, f"{'ATT' if 'ATT' in messages else estimator}.{field}", DEGREE)
    for quantity, field in INERTIAL:
        put(quantity, f"IMU.{field}")
    if all(n in channels for n in ("a_x", "a_y", "a_z", "phi", "theta", "psi")):
        channels |= kinematic(channels)
    for quantity, sources, factor in (("V_a", AIRSPEED, 1.0), ("motor_speed", REVOLUTIONS, 1 / 60)):
        for message, field in sources:
            if quantity not in channels:
                put(quantity, f"{message}.{field}", factor)
    if how.navigation == "gnss":
        channels |= _gnss(path, messages)
        notes.append("Position and velocity are the GNSS receiver's, which count where they are new.")
    for quantity, field in COMMANDS.items():
        put(quantity, f"AETR.{field}", TRAVEL / FULL_COMMAND)
    put("throttle", "AETR.Thr", 1 / FULL_THROTTLE)
    put("flaps", "AETR.Flap", TRAVEL / FULL_THROTTLE)
    if "AETR" in messages and not how.mix:
        full = f"{np.rad2deg(TRAVEL):.0f} deg at full"
        notes.append(f"Surfaces are shares of full command (AETR), taken as {full}: say in a flight.yaml what they are (`mix`).")
    channels |= mixed(how, channel, lambda: sorted(f"{m}.{f}" for m, fields in messages.items() for f in fields if f != "TimeUS"))
    wind = None
    for message in WIND:
        north, east = channel(f"{message}.VWN"), channel(f"{message}.VWE")
        if wind is None and north is not None and east is not None and "p_d" in channels:
            wind = wind_of(north, east, channels["p_d"])
    there = ", ".join(m for m in ACTUATORS if m in messages)
    name = path.resolve().parent.name
    return assembled(name, _unix(messages), channels, how, str(path), max_gap, wind=wind, notes=tuple(notes), surfaces=there)


def _messages(path: Path, names: tuple[str, ...]) -> dict[str, dict[str, np.ndarray]]:
    """message -> field -> values (N,), numbers only, of the first instance of every wanted message that the file has."""
    try:
        from pymavlink import DFReader
    except ImportError:
        do = "Install it with the extra: pip install 'awes[ardupilot]'."
        raise BadInput("reading .bin files needs pymavlink", str(path), do) from None

    class Reader(DFReader.DFReader_binary):
        """With the index in Python: the one in C believes the lengths in the file, and prints."""

        def init_arrays_fast(self, progress_callback=None):
            self.init_arrays(progress_callback)

    rows: dict[str, list[list]] = {}
    columns: dict[str, list[str]] = {}
    first: dict[str, object] = {}
    wanted = set(names)
    try:
        if path.stat().st_size < 4:
            raise ValueError("the file is empty")
        # pymavlink tells of odd bytes on the terminal, which is not its place here
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            reader = Reader(str(path), zero_time_base=True)
            while (message := reader.recv_match(type=wanted)) is not None:
                kind = message.get_type()
                fields = message.to_dict()
                which = fields.get("I", fields.get("C"))
                if "TimeUS" not in fields or first.setdefault(kind, which) != which:
                    continue
                names_of = columns.setdefault(kind, [n for n, v in fields.items() if isinstance(v, int | float)])
                rows.setdefault(kind, []).append([fields[n] for n in names_of])
    except Exception as e:
        # pymavlink tells of some damage with an Exception that has no name of its own; whatever has another one is no damaged file
        if type(e) is not Exception and not isinstance(e, DAMAGED):
            raise
        raise BadInput(f"not a readable DataFlash file ({type(e).__name__}: {str(e)[:100]})", str(path), "Copy the file again.") from None
    if not rows:
        raise BadInput("the log has none of the messages of a flight", str(path), f"Expected {', '.join(MESSAGES[:6])}, ...")
    return {kind: dict(zip(columns[kind], np.array(table, dtype=float).T, strict=True)) for kind, table in rows.items()}


def _unix(messages: Mapping[str, Mapping[str, np.ndarray]]) -> float:
    """Unix time [s] at stamp 0, from the receiver's week and time of week; 0 where the log has no fix."""
    fields = messages.get("GPS", {})
    if not {"GWk", "GMS"} <= fields.keys() or not (known := np.flatnonzero(fields["GWk"] > 0)).size:
        return 0.0
    k = known[0]
    return float(GPS_EPOCH + 604800 * fields["GWk"][k] + fields["GMS"][k] / 1000 - LEAP_SECONDS - fields["TimeUS"][k] * MICRO)


def _gnss(path: Path, messages: Mapping[str, Mapping[str, np.ndarray]]) -> dict[str, Channel]:
    """Position and velocity of the receiver where it has a fix in three dimensions."""
    fields = messages.get("GPS")
    if fields is None or not (good := fields["Status"] >= 3).any():
        raise BadInput("the log has no GPS fix", str(path), "Use navigation: estimator.")
    stamps, lat, lon, alt = (fields[n][good] for n in ("TimeUS", "Lat", "Lng", "Alt"))
    position = local_ned(lat * DEGREE, lon * DEGREE, alt, (lat[0] * DEGREE, lon[0] * DEGREE, alt[0]))
    speed, course, down = (fields[n][good] for n in ("Spd", "GCrs", "VZ"))
    values = (*position, speed * np.cos(course * DEGREE), speed * np.sin(course * DEGREE), down)
    return {n: Channel(stamps * MICRO, v) for n, v in zip(("p_n", "p_e", "p_d", "v_n", "v_e", "v_d"), values, strict=True)}
