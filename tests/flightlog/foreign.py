"""A flight in layouts that awes has never seen: any names, units, signs and frames, written from a FlightLog whose truth is known."""

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
