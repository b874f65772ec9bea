"""A free, powered flight of the published Thor, flown by a small autopilot, and the same flight in the formats of three recorders."""

import struct
from functools import cache
from pathlib import Path

import numpy as np

from awescli.flightlog.log import FlightLog, WindRecord
from awescli.notation.frames import rotate_back, rotation_body_to_ned
from awescli.notation.quantities import MEASURED, OF_LINE, STATES, SURFACES
from awescli.physics.declaration import KiteDeclaration, read_kite
from awescli.physics.kite import Kite
from awescli.simulation.segments import noise_std, wrap
from awescli.simulation.synthetic import simulate_flight, with_effects

THOR: KiteDeclaration = read_kite(Path(__file__).parents[1] / "examples" / "umn_thor" / "kite.yaml")
HEIGHT = 60.0
GRAVITY = 9.80665


def autopilot(x, u=(), c=()):
    """Set-points from the states: the recorded set-points, which come in behind them, are what bank, pitch and speed are asked for."""
    z = dict(zip(STATES, x, strict=False))
    asked = dict(zip(SURFACES, x[-len(SURFACES) :], strict=True))
    aileron = 0.35 * (z["phi"] - asked["aileron"]) + 0.06 * z["p"]
    elevator = -0.04 + 0.5 * (z["theta"] - asked["elevator"] - 0.006 * (HEIGHT + z["p_d"])) + 0.1 * z["q"]
    throttle = 0.65 + 0.08 * (asked["throttle"] - z["u"])
    return [aileron, elevator, 0.05 * asked["rudder"], 0.0, throttle]


@cache
def free_flight(seconds: float = 120.0, seed: int = 0, noise: bool = True, effects: tuple = (), breeze: float = 6.0) -> FlightLog:
    """Turns to both sides, climbs, a doublet every few seconds; measured with the kite file's noise, vanes included."""
    declaration = with_effects(THOR, {k: dict(v) for k, v in effects})
    dt, random = 0.02, np.random.default_rng(seed)
    n = int(round(seconds / dt)) + 1
    time = np.arange(n) * dt
    steps = lambda size, hold: np.repeat(random.choice((-size, size), n // int(hold / dt) + 1), int(hold / dt))[:n]  # noqa: E731
    asked = np.zeros((n, len(SURFACES)))
    asked[:, 0] = 0.5 * np.sin(2 * np.pi * time / 23.0) + steps(0.12, 0.6)
    asked[:, 1] = 0.06 + steps(0.05, 0.7)
    asked[:, 2] = steps(1.0, 0.5)
    asked[:, 4] = 17.0 + 2.0 * np.sin(2 * np.pi * time / 31.0)
    both = np.ones((2, 1))
    wind = WindRecord(np.array([-1.0, seconds + 1]), np.array([HEIGHT]), breeze * both, 4.5 * both, 0.0 * both, np.full(2, 1.19))
    kite = Kite(declaration, wind.height)
    start = np.array([30.0, 20.0, -HEIGHT, 17.0, 0.0, 1.0, 0.0, 0.06, 0.3, 0.0, 0.0, 0.0])
    flown = simulate_flight(
        kite, autopilot, wind, None, pattern=None, duration=seconds, dt=dt, start=start, setpoints=asked, seed=seed, step=0.01
    )
    assert not flown.departed
    measured = {}
    for name in (n for n in MEASURED if n not in OF_LINE):
        truth = flown.outputs[name]
        measured[name] = truth + noise * random.standard_normal(len(truth)) * noise_std(declaration.noise, name, truth)
    for angle in ("phi", "psi"):
        measured[angle] = wrap(measured[angle])
    inputs = {name: flown.outputs[name].copy() for name in SURFACES}
    return FlightLog("free", 1.65e9, dt, flown.time, measured, inputs, np.ones(len(flown.time), bool), wind)


def specific_force(log: FlightLog) -> tuple:
    """What accelerometers say of the log's kinematic acceleration."""
    R = rotation_body_to_ned(log["phi"], log["theta"], log["psi"])
    zero = np.zeros(len(log))
    gravity = rotate_back(R, (zero, zero, zero + GRAVITY))
    return tuple(log[n] - g for n, g in zip(("a_x", "a_y", "a_z"), gravity, strict=True))


def geodetic(log: FlightLog, origin=(0.7911, -1.6272, 245.0)) -> tuple:
    """(latitude, longitude [rad], height [m]) of the log's positions, by the radii of curvature of WGS 84 at the origin."""
    a, e2 = 6378137.0, 0.00669437999014
    w = 1 - e2 * np.sin(origin[0]) ** 2
    north, east = a * (1 - e2) / w**1.5 + origin[2], (a / np.sqrt(w) + origin[2]) * np.cos(origin[0])
    return origin[0] + log["p_n"] / north, origin[1] + log["p_e"] / east, origin[2] - log["p_d"]


def umn_struct(log: FlightLog, ground: float = 20.0, motor_late: float = -7.7) -> dict:
    """The flight as the University of Minnesota's struct flight_data: with time on the ground before it, the middle third by hand."""
    n, lead = len(log), int(ground / log.dt)

    def with_ground(signal, rest=0.0):
        return np.concatenate([np.full(lead, rest), signal])

    lat, lon, alt = geodetic(log)
    f = specific_force(log)
    N = n + lead
    time = 0.02 + np.arange(N) * log.dt
    mode = np.full(N, 2.0)
    by_hand = slice(lead + n // 3, lead + 2 * n // 3)
    mode[:lead] = mode[by_hand] = 1.0
    fields = {
        "time": time, "mode": mode, "navValid": np.zeros(N), "GPS_TOW": 1000.0 + np.floor(time),
        "navlat": with_ground(lat, 0.7911), "navlon": with_ground(lon, -1.6272), "navalt": with_ground(alt, 245.0),
        "ax": with_ground(f[0]), "ay": with_ground(f[1]), "az": with_ground(f[2], -GRAVITY), "Ps": np.full(N, 98.0),
        **{name: with_ground(log[name]) for name in ("p", "q", "r", "phi", "theta", "psi")},
        "navvn": with_ground(log["v_n"]), "navve": with_ground(log["v_e"]), "navvd": with_ground(log["v_d"]),
        "ias": with_ground(log["V_a"]), "aoa": with_ground(log["alpha"]), "aos": with_ground(log["beta"]),
    }  # fmt: skip
    held = np.floor(np.arange(N) * log.dt).astype(int)
    first = np.searchsorted(held, held)  # the sample at which the receiver's second began
    for name, signal in (("lat", np.rad2deg(fields["navlat"])), ("lon", np.rad2deg(fields["navlon"])), ("alt", fields["navalt"]),
                         ("vn", fields["navvn"]), ("ve", fields["navve"]), ("vd", fields["navvd"])):  # fmt: skip
        fields[name] = signal[first]
    fields["GPS_TOW"] = 1000.0 + held
    commands = {"da_r": log["aileron"], "da_l": -log["aileron"], "de": log["elevator"], "dr": log["rudder"], "dthr": log["throttle"]}
    for name, flown in commands.items():
        flown = with_ground(flown)
        fields[name], fields[f"{name}_in"] = flown.copy(), np.full(N, 0.3)
        # by hand the sticks fly and the commands stand still
        fields[f"{name}_in"][mode == 1.0], fields[name][mode == 1.0] = flown[mode == 1.0], 0.1
    motor_time = np.arange(0.0, time[-1] - 10.0, 0.5)
    throttle = np.interp(motor_time - motor_late, time, with_ground(log["throttle"]))
    fields |= {"motor_time": motor_time, "motor_throttle": 1.2 + 0.6 * throttle, "motor_RPM": 4000 + 1000 * throttle}
    return fields


def topics_of(log: FlightLog) -> dict[str, tuple[float, dict[str, np.ndarray]]]:
    """The flight as PX4 topics: name -> (rate [Hz], field -> values at that rate)."""

    def at(rate):
        t = np.arange(0.0, log.time[-1], 1 / rate)

        def take(name):
            x = np.unwrap(log[name]) if name in ("phi", "psi") else log[name]
            return np.interp(t, log.time, x)

        return take, t

    result = {}
    take, t = at(10)
    result["vehicle_local_position"] = (
        10,
        dict(zip(("x", "y", "z", "vx", "vy", "vz"), map(take, ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d")), strict=True)),
    )
    take, t = at(50)
    f, th, ps = take("phi") / 2, take("theta") / 2, take("psi") / 2
    c, s = np.cos, np.sin
    result["vehicle_attitude"] = 50, {
        "q[0]": c(ps) * c(th) * c(f) + s(ps) * s(th) * s(f), "q[1]": c(ps) * c(th) * s(f) - s(ps) * s(th) * c(f),
        "q[2]": c(ps) * s(th) * c(f) + s(ps) * c(th) * s(f), "q[3]": s(ps) * c(th) * c(f) - c(ps) * s(th) * s(f),
    }  # fmt: skip
    take, t = at(200)
    result["vehicle_angular_velocity"] = 200, {f"xyz[{i}]": take(n) for i, n in enumerate("pqr")}
    force = [np.interp(t, log.time, x) for x in specific_force(log)]
    result["vehicle_acceleration"] = 200, {f"xyz[{i}]": x for i, x in enumerate(force)}
    take, t = at(20)
    result["airspeed_validated"] = 20, {"true_airspeed_m_s": take("V_a")}
    take, t = at(50)
    full = np.deg2rad(25.0)
    result["actuator_controls_0"] = 50, {
        "control[0]": take("aileron") / full, "control[1]": take("elevator") / full, "control[2]": take("rudder") / full,
        "control[3]": take("throttle"),
    }  # fmt: skip
    take, t = at(2)
    result["wind"] = 2, {"windspeed_north": 0 * t - 6.0 * np.cos(4.5), "windspeed_east": 0 * t - 6.0 * np.sin(4.5)}
    return result


def ulog_bytes(topics: dict, start: float = 5.0) -> bytes:
    """A ULog file (PX4 user guide, "ULog File Format", version 1): header, flag bits, formats, subscriptions, data in the order of time."""

    def message(kind: bytes, payload: bytes) -> bytes:
        return struct.pack("<HB", len(payload), kind[0]) + payload

    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message(b"B", bytes(40))]
    rows = []
    for number, (name, (rate, fields)) in enumerate(topics.items()):
        arrays: dict[str, int] = {}
        for field in fields:
            base, _, rest = field.partition("[")
            arrays[base] = max(arrays.get(base, 0), int(rest[:-1]) + 1 if rest else 0)
        declared = ";".join(["uint64_t timestamp", *(f"float[{k}] {b}" if k else f"float {b}" for b, k in arrays.items())])
        out.append(message(b"F", f"{name}:{declared};".encode()))
        columns = (
            [fields.get(f"{b}[{i}]", 0 * next(iter(fields.values()))) for b, k in arrays.items() for i in range(k)]
            if any(arrays.values())
            else list(fields.values())
        )
        table = np.stack(columns, axis=1)
        for k, row in enumerate(table):
            stamp = int((start + k / rate) * 1e6)
            rows.append((stamp, message(b"D", struct.pack("<HQ", number, stamp) + struct.pack(f"<{len(row)}f", *row))))
        out.append((number, name))
    subscriptions = [message(b"A", struct.pack("<BH", 0, n) + name.encode()) for n, name in (o for o in out if isinstance(o, tuple))]
    return b"".join([*(o for o in out if isinstance(o, bytes)), *subscriptions, *(data for _, data in sorted(rows))])


def messages_of(log: FlightLog) -> dict[str, tuple[float, str, dict[str, np.ndarray]]]:
    """The flight as ArduPilot messages: name -> (rate [Hz], format, field -> values), TimeUS left out."""

    def at(rate):
        t = np.arange(0.0, log.time[-1], 1 / rate)
        return lambda name: np.interp(t, log.time, np.unwrap(log[name]) if name in ("phi", "psi") else log[name]), t

    degrees = 180 / np.pi
    result = {}
    take, t = at(10)
    none = np.zeros(t.size)
    names = ("VN", "VE", "VD", "PN", "PE", "PD")
    result["XKF1"] = 10, "B" + "f" * 6, {"C": none} | dict(zip(names, map(take, ("v_n", "v_e", "v_d", "p_n", "p_e", "p_d")), strict=True))
    result["XKF2"] = 10, "Bff", {"C": none, "VWN": none - 6.0 * np.cos(4.5), "VWE": none - 6.0 * np.sin(4.5)}
    result["ARSP"] = 10, "Bf", {"I": none, "Airspeed": take("V_a")}
    take, t = at(25)
    result["ATT"] = (
        25,
        "fff",
        {"Roll": take("phi") * degrees, "Pitch": take("theta") * degrees, "Yaw": np.mod(take("psi") * degrees, 360.0)},
    )
    full = np.deg2rad(25.0) / 4500
    result["AETR"] = (
        25,
        "ffff",
        {"Ail": take("aileron") / full, "Elev": take("elevator") / full, "Thr": 100 * take("throttle"), "Rudd": take("rudder") / full},
    )
    take, t = at(50)
    force = [np.interp(t, log.time, x) for x in specific_force(log)]
    imu = {"I": np.zeros(t.size)} | {f"Gyr{a}": take(n) for a, n in zip("XYZ", "pqr", strict=True)}
    result["IMU"] = 50, "B" + "f" * 6, imu | {f"Acc{a}": x for a, x in zip("XYZ", force, strict=True)}
    return result


def dataflash_bytes(messages: dict, start: float = 5.0) -> bytes:
    """A DataFlash file (ArduPilot, "Downloading and Analyzing Data Logs"): FMT messages that declare the others, then these by time."""

    def declare(kind: int, length: int, name: str, form: str, columns: str) -> bytes:
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name.encode(), form.encode(), columns.encode())

    out, rows = [declare(0x80, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")], []
    for kind, (name, (rate, form, fields)) in enumerate(messages.items(), start=100):
        packing = "<Q" + form
        out.append(declare(kind, 3 + struct.calcsize(packing), name, "Q" + form, ",".join(["TimeUS", *fields])))
        for k, row in enumerate(np.stack(list(fields.values()), axis=1)):
            stamp = int((start + k / rate) * 1e6)
            values = [int(v) if c == "B" else float(v) for c, v in zip(form, row, strict=True)]
            rows.append((stamp, b"\xa3\x95" + bytes([kind]) + struct.pack(packing, stamp, *values)))
    return b"".join([*out, *(data for _, data in sorted(rows))])
