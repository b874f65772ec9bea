"""A draft of flight.yaml from header and numbers: the flight that comes back is the one that was written, in whatever layout."""

from pathlib import Path

import numpy as np
import pytest
from flightlog.foreign import FOOT, KNOT, LBF, knots_and_feet, plain, random_layout, write_csv

from awescli.flightlog.drafting.draft import draft
from awescli.flightlog.drafting.headers import readings
from awescli.flightlog.drafting.line import winch_place
from awescli.flightlog.drafting.text import draft_text
from awescli.flightlog.drafting.weather import weather_files
from awescli.flightlog.geodesy import geodetic_from_ned, ned_from_geodetic
from awescli.flightlog.read import missing_for_model, read_flight
from awescli.notation.errors import BadInput

ROOT = Path(__file__).parents[2]
RAD = np.pi / 180
TOLERANCE = {"p": 0.01, "v": 0.01, "a": 0.02}
"""m, m/s, m/s2: the digits written."""


@pytest.fixture(scope="module")
def log():
    """The first minute of the bundled flight."""
    whole = read_flight(ROOT / "data" / "km1_demo")
    return whole.between(0, 3000)


def drafted(path: Path):
    """(draft, the log that its text gives)"""
    found = draft(path, weather_files(path.parent, path))
    declaration = path.parent / "flight.yaml"
    declaration.write_text(draft_text(found, path.parent))
    return found, read_flight(declaration)


def basis(log) -> dict:
    """A complete log in the words of a textbook; layouts replace parts of it."""
    x = plain(log)
    names = {
        "north_m": "p_n", "east_m": "p_e", "down_m": "p_d", "vel_n_mps": "v_n", "vel_e_mps": "v_e", "vel_d_mps": "v_d", "roll_deg": "phi",
        "pitch_deg": "theta", "yaw_deg": "psi", "p_dps": "p", "q_dps": "q", "r_dps": "r", "airspeed_mps": "V_a",
        "tether_force_N": "tension",
        "rudder_cmd_deg": "rudder", "elevator_cmd_deg": "elevator", "aileron_cmd_deg": "aileron", "flaps_cmd_deg": "flaps",
        "tether_length_m": "tether_length", "reel_out_speed_mps": "reel_out_speed",
    }  # fmt: skip
    return {"t_s": log.time, **{name: x[q] for name, q in names.items()}}


def without(columns: dict, *names) -> dict:
    return {n: x for n, x in columns.items() if n not in names}


POSITION, VELOCITY = ("north_m", "east_m", "down_m"), ("vel_n_mps", "vel_e_mps", "vel_d_mps")
ANGLES, RATES = ("roll_deg", "pitch_deg", "yaw_deg"), ("p_dps", "q_dps", "r_dps")


def bare(log):
    """No header names a unit: they follow from what position, velocity, attitude, rates, line and winch say of each other."""
    units = ("m", "mps", "deg", "dps")
    return {name.rpartition("_")[0] if name.rpartition("_")[2] in units else name: v for name, v in basis(log).items()}


def axes_of_no_name(log):
    """x, y, z that are east, north, up for the position and north, east, down for the velocity."""
    x = plain(log)
    columns = {"x": x["p_e"], "y": x["p_n"], "z": -x["p_d"], "vx": x["v_n"], "vy": x["v_e"], "vz": x["v_d"]}
    return {**without(basis(log), *POSITION, *VELOCITY), **columns}


def radians(log):
    """Angles and rates in rad, named so or not; yaw counted from east, pitch positive nose down, roll positive left wing down."""
    x = plain(log)
    columns = {"roll": -x["phi"] * RAD, "pitch": -x["theta"] * RAD, "yaw": np.angle(np.exp(1j * (90 - x["psi"]) * RAD))}
    columns |= {"gyro_x": x["p"] * RAD, "gyro_y": -x["q"] * RAD, "gyro_z": x["r"] * RAD}
    return {**without(basis(log), *ANGLES, *RATES), **columns}


def feet(log):
    """Feet without a word about it, but for the line."""
    x = plain(log)
    columns = {"pos_n": x["p_n"] / FOOT, "pos_e": x["p_e"] / FOOT, "altitude": -x["p_d"] / FOOT}
    columns |= {"vn": x["v_n"] / FOOT, "ve": x["v_e"] / FOOT, "climb rate": -x["v_d"] / FOOT, "line length [ft]": x["tether_length"] / FOOT}
    return {**without(basis(log), *POSITION, *VELOCITY, "tether_length_m"), **columns}


def reeling_in(log):
    """The winch counts inwards, in feet per minute, without a unit; the load in pounds."""
    x = plain(log)
    columns = {"winch speed": -x["reel_out_speed"] / FOOT * 60, "Line Load (lbs)": x["tension"] / LBF}
    return {**without(basis(log), "reel_out_speed_mps", "tether_force_N"), **columns}


def body_velocity(log):
    """u, v, w instead of a velocity over ground in north and east."""
    x = plain(log)
    return {**without(basis(log), *VELOCITY), "u": x["u"], "v": x["v"], "w": x["w"]}


def accelerometers(log):
    """What an accelerometer shows, in g, and microseconds of an autopilot."""
    x = plain(log)
    columns = {f"acc_{a}": x[f"f_{a}"] / 9.80665 for a in "xyz"}
    return {"TimeUS": np.rint(log.time * 1e6) + 12345, **without(basis(log), "t_s"), **columns}


def above_sea_level(log):
    """Altitude above the sea, 212 m above the winch's zero."""
    x = plain(log)
    return {**without(basis(log), "down_m"), "Altitude MSL [ft]": (-x["p_d"] + 212.0) / FOOT}


def around_the_globe(log):
    """Latitude and longitude as an autopilot keeps them, altitude above the ellipsoid."""
    x = plain(log)
    lat, lon, alt = np.array([geodetic_from_ned(p, HOME) for p in np.array([x["p_n"], x["p_e"], x["p_d"]]).T]).T
    columns = {"lat": np.rint(np.degrees(lat) * 1e7), "lon": np.rint(np.degrees(lon) * 1e7), "alt_m": alt}
    return {**without(basis(log), *POSITION), **columns}


HOME = (np.radians(58.1), np.radians(6.56), 31.0)
LAYOUTS = (basis, bare, axes_of_no_name, radians, feet, reeling_in, body_velocity, accelerometers, above_sea_level)


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda f: f.__name__)
@pytest.mark.parametrize("every", [1, 5])
def test_the_flight_comes_back(layout, every, log, tmp_path):
    found, back = drafted(write_csv(tmp_path / "log.csv", layout(log), every))
    assert back.dt == pytest.approx(0.02 * every) and found.needed == ("wind",), draft_text(found, tmp_path)
    # the winch of the moved altitude is where its line's length says, and that sags
    loose = {"p_d": 3.0} if layout is above_sea_level else {}
    for name in (*log.measured, *log.inputs):
        if name not in back:
            assert name in ("a_x", "a_y", "a_z") and layout is not accelerometers, name
            continue
        error = np.abs(back[name] - log[name][::every])
        error = np.minimum(error, 2 * np.pi - error) if name in ("psi", "phi") else error
        most = loose.get(name, TOLERANCE.get(name[0], 1e-3) if "_" in name else 1e-4)
        assert error.max() < most if name != "tension" else error.max() < 0.1, (name, error.max())
    if layout is not above_sea_level:
        assert not found.doubtful or layout in (bare, feet), found.doubtful


@pytest.mark.parametrize("seed", range(24))
def test_layouts_drawn_at_random_come_back(seed, log, tmp_path):
    every = (1, 2, 5)[seed % 3]
    found, back = drafted(write_csv(tmp_path / "log.csv", random_layout(log, seed), every))
    assert found.needed == ("wind",) and set(found.unused) == {"battery", "mode"}
    for name in (*log.measured, *log.inputs):
        if name[0] == "a" and name != "aileron" or name == "V_a":
            continue
        error = np.abs(back[name] - log[name][::every])
        error = np.minimum(error, 2 * np.pi - error) if name in ("psi", "phi") else error
        assert error.max() < {"tension": 0.1}.get(name, 0.02 if "_" in name else 1e-3), (name, error.max())


def test_a_clock_of_text_is_found(log, tmp_path):
    from datetime import UTC, datetime

    import polars as pl

    path = write_csv(tmp_path / "log.csv", without(basis(log), "t_s"))
    stamps = [datetime.fromtimestamp(log.start + t, UTC).isoformat() for t in log.time.tolist()]
    pl.read_csv(path).with_columns(pl.Series("Timestamp", stamps)).write_csv(path)
    found, back = drafted(path)
    assert (found.time.column, found.time.unit) == ("Timestamp", "iso") and back.start == pytest.approx(log.start, abs=1e-5)


def test_latitude_and_longitude_and_a_winch_that_nobody_wrote_down(log, tmp_path):
    """The line's length says where the winch stands, within what a line's sag and its loops' small angle allow."""
    found, back = drafted(write_csv(tmp_path / "log.csv", around_the_globe(log)))
    assert found.origin is not None and any("surveyed" in n for n in found.doubtful)
    lat, lon, alt = found.origin
    off = np.array(ned_from_geodetic(*np.array([[np.radians(lat)], [np.radians(lon)], [alt]]), HOME)).ravel()
    assert np.linalg.norm(off) < 15.0, off
    assert np.abs(np.hypot(back["v_n"], back["v_e"]) - np.hypot(log["v_n"], log["v_e"])).max() < 0.01
    moved = np.array([back[n] - log[n] for n in ("p_n", "p_e", "p_d")])
    assert np.abs(moved - moved.mean(1, keepdims=True)).max() < 1.0


def test_the_newcomers_log(log, tmp_path):
    """Knots, feet and degrees at 25 Hz, no airspeed, weather in a file of its own: complete at once."""
    found, back = drafted(knots_and_feet(log, tmp_path))
    assert not found.needed and not found.doubtful and missing_for_model(back) == [] and "V_a" not in back
    assert found.unused == ("battery_V",)
    assert back.wind.speed == pytest.approx(log.wind.speed, abs=1e-5) and back.wind.density == pytest.approx(log.wind.density)
    assert np.cos(back.wind.direction - log.wind.direction) == pytest.approx(1.0)
    assert back.wind.height == pytest.approx(log.wind.height, abs=1e-5) and back.wind.time == pytest.approx(log.wind.time)


def test_what_cannot_be_known_is_left_as_a_comment(log, tmp_path):
    columns = without(basis(log), "tether_force_N", "q_dps", "rudder_cmd_deg", "aileron_cmd_deg", "elevator_cmd_deg", "flaps_cmd_deg")
    columns |= {"load": plain(log)["tension"], "rudder_pwm": 1500 + 10 * plain(log)["rudder"]}
    found = draft(write_csv(tmp_path / "log.csv", columns))
    text = draft_text(found, tmp_path)
    assert found.needed == ("q", "rudder", "wind") and "tension" not in found.signals
    for line in ("# tension: {column: load, unit: ...}", "no unit in its name: N, kgf, lbf",
                 "# q: {column: ..., unit: rad/s}    # NEEDED by a model", "pulse widths around 14",
                 "NEEDED by a model: the wind"):  # fmt: skip
        assert line in text, line


def test_wind_that_blows_to_is_turned(log, tmp_path):
    """The kite flies downwind of its winch."""
    wind = {"seconds": np.array([0.0, 60.0]), "wind_dir": np.full(2, 305.0 - 180.0), "wind_speed_kt": np.full(2, 12.0 / KNOT)}
    write_csv(tmp_path / "weather.csv", wind)
    found, back = drafted(write_csv(tmp_path / "log.csv", basis(log)))
    assert np.degrees(back.wind.direction[0, 0]) % 360 == pytest.approx(305.0) and back.wind.speed[0, 0] == pytest.approx(12.0)
    assert "where it blows to" in draft_text(found, tmp_path) and "ASSUMED: height of the station" in draft_text(found, tmp_path)


def test_density_from_temperature_and_pressure(log, tmp_path):
    wind = {"t": np.array([0.0, 60.0]), "direction": np.full(2, 305.0), "speed": np.full(2, 9.0), "temp": np.full(2, 59.0),
            "pressure": np.full(2, 1013.25)}  # fmt: skip
    write_csv(tmp_path / "weather.csv", wind)
    _, back = drafted(write_csv(tmp_path / "log.csv", basis(log)))
    assert back.wind.density == pytest.approx([1.225, 1.225], rel=1e-3)


def test_headers_that_mean_nothing_to_us():
    for name in ("mag_x", "battery temperature", "course", "satellites", "roll_cmd", "mode"):
        assert readings(name) == [], name


def test_a_file_without_a_clock_is_refused(tmp_path):
    with pytest.raises(BadInput, match="no column is a clock"):
        draft(write_csv(tmp_path / "log.csv", {"roll": np.arange(100.0), "time": np.zeros(100)}))


def test_the_winch_is_found_where_it_stands():
    """Positions around a known place, the line straight: the place comes back to a micrometre."""
    random = np.random.default_rng(0)
    place = np.array([120.0, -40.0, 15.0])
    away = random.normal(size=(3, 500)) * np.array([[60.0], [60.0], [40.0]]) + np.array([[300.0], [100.0], [-200.0]])
    found, left = winch_place(away + place[:, None], np.sqrt((away**2).sum(0)))
    assert np.abs(found - place).max() < 1e-6 and left < 1e-6
