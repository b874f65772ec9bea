"""A flight in layouts that awes has never seen: any names, units, signs and frames, written from a FlightLog whose truth is known."""

import random
from pathlib import Path

import numpy as np
import polars as pl

from awescli.flightlog.log import FlightLog
from awescli.notation.frames import rotate_back, rotation_body_to_ned

FOOT, KNOT, LBF, GRAVITY = 0.3048, 1852 / 3600, 4.4482216152605, 9.80665
EPOCH_DIGITS, DIGITS = 3, 6


def plain(log: FlightLog) -> dict[str, np.ndarray]:
    """Everything that a log of this flight may hold, SI, angles in degrees, by names that no header has."""
    m = {name: log[name] for name in (*log.measured, *log.inputs)}
    R = rotation_body_to_ned(m["phi"], m["theta"], m["psi"])
    m |= dict(zip(("u", "v", "w"), rotate_back(R, (m["v_n"], m["v_e"], m["v_d"])), strict=True))
    if "a_x" in m:
        m |= {f"f_{a}": m[f"a_{a}"] - GRAVITY * R[2][i] for i, a in enumerate("xyz")}
    angles = ("phi", "theta", "psi", "p", "q", "r", "aileron", "elevator", "rudder", "flaps")
    return {name: np.rad2deg(x) if name in angles else x for name, x in m.items()}


def write_csv(path: Path, columns: dict[str, np.ndarray], every: int = 1) -> Path:
    """The columns as a CSV, every so many rows."""
    path.parent.mkdir(parents=True, exist_ok=True)
    frame = pl.DataFrame({name: np.round(np.asarray(x)[::every], DIGITS) for name, x in columns.items()})
    frame.write_csv(path, float_precision=DIGITS)
    return path


def knots_and_feet(log: FlightLog, folder: Path, every: int = 2) -> Path:
    """The layout of the newcomer: knots, feet, degrees, pounds, east before north, altitude up, no airspeed; weather in a file of its own.
    Returns the log's file."""
    x = plain(log)
    columns = {
        "Time [ms]": np.rint((log.start + log.time) * 1000), "East [ft]": x["p_e"] / FOOT, "North [ft]": x["p_n"] / FOOT,
        "Alt [ft]": -x["p_d"] / FOOT, "VE(kt)": x["v_e"] / KNOT, "VN(kt)": x["v_n"] / KNOT, "climb_kt": -x["v_d"] / KNOT,
        "roll_deg": x["phi"], "pitch_deg": x["theta"], "hdg": x["psi"] % 360, "gyro_x": x["p"], "gyro_y": x["q"], "gyro_z": x["r"],
        "load_lbf": x["tension"] / LBF, "line_length_ft": x["tether_length"] / FOOT, "winch speed": x["reel_out_speed"] / KNOT,
        "rudder_cmd": x["rudder"], "aileron_cmd": x["aileron"], "elevator_cmd": x["elevator"], "flap_cmd": x["flaps"],
        "battery_V": 24.0 + 0 * log.time,
    }  # fmt: skip
    wind, heights = log.wind, log.wind.height.size
    weather = {
        "utc_s": np.repeat(log.start + wind.time, heights), "height_ft": np.tile(wind.height, wind.time.size) / FOOT,
        "wind_from_deg": np.rad2deg(wind.direction.ravel()) % 360, "wind_kt": wind.speed.ravel() / KNOT,
        "air_density": np.repeat(wind.density, heights),
    }  # fmt: skip
    write_csv(folder / "met_station.csv", weather)
    return write_csv(folder / "flight_017.csv", columns, every)


SPELLED = {"m/s": "mps", "kt": "kt", "ft/s": "fps", "km/h": "kmh", "deg/s": "dps", "rad/s": "radps"}
AXES = {"ned": ("p_n", "p_e", "p_d", 1), "neu": ("p_n", "p_e", "p_d", -1), "enu": ("p_e", "p_n", "p_d", -1)}
"""Kind of axes -> quantities of the three columns, sign of the third."""


def random_layout(log: FlightLog, seed: int) -> dict[str, np.ndarray]:
    """The flight in names, units, axes, signs and an order drawn at random; units are named in the headers, or not. One thing of each group
    of columns that only a header can tell (the unit of a load, one length of several) is always said."""
    rng = random.Random(seed)
    x, columns, style = plain(log), {}, rng.choice(["{}_{}", "{} [{}]", "{}({})", "{} ({})"])

    def add(name: str, unit: str, values: np.ndarray, said: bool) -> None:
        spelled = SPELLED.get(unit, unit) if "_" in style else unit
        columns[style.format(name, spelled) if said else name] = values

    def either() -> bool:
        return rng.random() < 0.5

    unit, factor = rng.choice([("s", 1.0), ("ms", 1e3), ("us", 1e6)])
    zero = rng.choice([0.0, log.start, 17.25])
    add(rng.choice(["time", "t", "timestamp", "Time"]), unit, np.round((zero + log.time) * factor, 3 if unit == "s" else 0), either())
    length, metres = rng.choice([("m", 1.0), ("ft", FOOT)])
    speed, mps = rng.choice([("m/s", 1.0), ("kt", KNOT), ("ft/s", FOOT), ("km/h", 1 / 3.6)])
    lengths_said, speeds_said = either(), either()
    positions = {"ned": ("north", "pos_e", "down"), "neu": ("pos_n", "East", "Alt"), "enu": ("x", "y", "z")}
    velocities = {"ned": ("vn", "ve", "vd"), "neu": ("vel_north", "vel_east", "climb_rate"), "enu": ("vx", "vy", "vz")}
    groups = ((positions, "p", metres, length, lengths_said), (velocities, "v", mps, speed, speeds_said))
    for names, quantity, one, word, said in groups:
        kind = rng.choice(list(AXES))
        *places, sign = AXES[kind]
        for name, place, way in zip(names[kind], places, (1, 1, sign), strict=True):
            add(name, word, way * x[place.replace("p", quantity, 1)] / one, said)
    angle, turn = rng.choice([("deg", 1.0), ("rad", np.pi / 180)])
    said = either()
    heading = x["psi"] % 360 if either() else x["psi"]
    for names, values in ((("roll", "bank"), x["phi"]), (("pitch", "theta"), x["theta"]), (("yaw", "hdg"), heading)):
        add(rng.choice(names), angle, values * turn, said)
    rate, turn = rng.choice([("deg/s", 1.0), ("rad/s", np.pi / 180)])
    said, form = either(), rng.choice([("p", "q", "r"), ("gyro_x", "gyro_y", "gyro_z"), ("roll_rate", "pitch_rate", "yaw_rate")])
    for name, quantity in zip(form, "pqr", strict=True):
        add(name, rate, x[quantity] * turn, said)
    force, newton = rng.choice([("N", 1.0), ("kgf", GRAVITY), ("lbf", LBF), ("daN", 10.0), ("kN", 1000.0)])
    add(rng.choice(["load", "tether_force", "line tension"]), force, x["tension"] / newton, True)
    length, metres = rng.choice([("m", 1.0), ("ft", FOOT)])
    add(rng.choice(["line_length", "tether length"]), length, x["tether_length"] / metres, either() or not (lengths_said or speeds_said))
    add(rng.choice(["winch speed", "reel_out_speed"]), "m/s", rng.choice([1, -1]) * x["reel_out_speed"], either())
    angle, turn = rng.choice([("deg", 1.0), ("rad", np.pi / 180)])
    said = either()
    for surface in ("rudder", "elevator", "aileron", "flaps"):
        add(f"{surface}_{rng.choice(['cmd', 'sp'])}", angle, x[surface] * turn, said)
    columns |= {"battery": 24 + 0 * log.time, "mode": 3 + 0 * log.time}
    order = list(columns.items())
    rng.shuffle(order)
    return dict(order)
