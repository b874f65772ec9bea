"""flight.yaml: units and factors, weather in a file of its own, other forms of a position, and all mistakes of a file in one go."""

import numpy as np
import polars as pl
import pytest
from flightlog.synthetic import circle, write_folder

from awescli.flightlog.flight_check import read_flight_file
from awescli.flightlog.geodesy import SEMI_MAJOR, earth_fixed, ned_from_geodetic
from awescli.flightlog.read import read_flight
from awescli.flightlog.unit_words import units_spelled
from awescli.flightlog.units import VOCABULARY, factor_to_si
from awescli.notation.errors import BadInput, BadInputs
from awescli.notation.frames import rotate_back, rotation_body_to_ned
from awescli.notation.names import meanings, nearest_quantity, words
from awescli.notation.quantities import INPUTS, MEASURED

FOOT, KNOT, LBF = 0.3048, 1852 / 3600, 4.4482216152605

MAPPING = """
file: log.csv
time: {column: t, unit: s}
position: {columns: [east, north, up], unit: ft, frame: ENU}
velocity: {columns: [vn, ve, vd], unit: kt}
signals:
  phi: {column: roll, unit: deg}
  theta: {column: pitch, unit: deg}
  psi: {column: yaw, unit: degrees}
  tension: {column: load, unit: lbf}
  rudder: {column: rudder, unit: rad}
"""


def foreign(log) -> pl.DataFrame:
    """The log in feet, knots, degrees and pounds-force, its clock counting from zero."""
    degrees = {"roll": "phi", "pitch": "theta", "yaw": "psi"}
    columns = {"t": log.time, "east": log["p_e"] / FOOT, "north": log["p_n"] / FOOT, "up": -log["p_d"] / FOOT}
    columns |= {name: log[q] / KNOT for name, q in (("vn", "v_n"), ("ve", "v_e"), ("vd", "v_d"))}
    columns |= {name: np.rad2deg(log[q]) for name, q in degrees.items()} | {"load": log["tension"] / LBF, "rudder": log["rudder"]}
    return pl.DataFrame(columns)


@pytest.fixture
def log():
    return circle(seconds=20.0, rate=25.0)


def folder_with(folder, log, mapping: str, frame=None, **others):
    """A folder with log.csv, flight.yaml and other files."""
    folder.mkdir(parents=True, exist_ok=True)
    (foreign(log) if frame is None else frame).write_csv(folder / "log.csv")
    (folder / "flight.yaml").write_text(mapping)
    for name, text in others.items():
        (folder / name.replace("_csv", ".csv")).write_text(text)
    return folder


def test_feet_knots_pounds_and_a_factor_of_ones_own(tmp_path, log):
    mapping = MAPPING.replace("rudder, unit: rad", "rudder, unit: deg, scale: 28.64788975654116")
    back = read_flight(folder_with(tmp_path / "a", log, mapping))
    assert back.dt == 0.04
    for name in ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "tension"):
        assert np.abs(back[name] - log[name]).max() < 1e-9, name
    assert np.abs(back["rudder"] - 0.5 * log["rudder"]).max() < 1e-9


@pytest.mark.parametrize(
    "unit, si_unit, factor",
    [
        ("kt", "m/s", 0.514444444444), ("mph", "m/s", 0.44704), ("mi/h", "m/s", 0.44704), ("ft/min", "m/s", 0.00508), ("nmi", "m", 1852.0),
        ("lbf", "N", 4.4482216152605), ("daN", "N", 10.0), ("slug/ft3", "kg/m3", 515.3788184), ("lb/ft3", "kg/m3", 16.01846337),
        ("rpm", "1/s", 1 / 60), ("psi", "Pa", 6894.757293), ("ft/s2", "m/s2", 0.3048),
    ],
)  # fmt: skip
def test_factors_are_those_of_the_tables(unit, si_unit, factor):
    """NIST Special Publication 811, appendix B."""
    assert factor_to_si(unit, si_unit) == pytest.approx(factor, rel=1e-9)


def test_units_are_read_as_people_write_them():
    for text, unit in {"knots": "kt", "Kts": "kt", "m s-1": "m/s", "FT/S": "ft/s", "lbs": "lbf", "°": "deg", "dps": "deg/s", "[ft]": "ft",
                       "deg per sec": "deg/s", "kilogram": None, "N": "N", "mps2": "m/s2", "m/s^2": "m/s2"}.items():  # fmt: skip
        found = units_spelled(text)
        assert (found[0] if found else None) == unit, (text, found)
    assert {"ms", "m/s"} <= set(units_spelled("ms"))
    assert all(units_spelled(unit)[0] == unit for unit in VOCABULARY)


ERRORS = """
file: log.csv
time: {column: t, unit: s}
position: {columns: [east, nort, up], unit: ft, frame: ENW}
velocity: {columns: [vn, ve, vd], unit: kt}
signals:
  roll: {column: roll, unit: deg}
  pitch: {column: pitch, unit: deg}
  heading: {column: yaw, unit: deg}
  altitude: {column: up, unit: ft}
  tension: {column: lod, unit: deg}
  rudder: {column: rudder, unit: degg}
  V_a: {column: airspeed}
unchecked: [load]
wnid: {}
"""


def test_all_mistakes_of_a_file_are_told_at_once(tmp_path, log):
    with pytest.raises(BadInputs) as e:
        read_flight(folder_with(tmp_path, log, ERRORS))
    said = str(e.value)
    lines = {n: line for n, line in enumerate(ERRORS.splitlines(), 1)}
    for where, what in (
        ("frame: ENW", "frame"), ("roll: {column: roll", "Did you mean 'phi'?"), ("pitch: {column", "Did you mean 'theta'?"),
        ("heading:", "Did you mean 'psi'?"), ("altitude:", "Did you mean 'p_d', with `sign: -1`?"), ("tension:", "not a unit of force"),
        ("tension:", "Did you mean 'load'?"), ("rudder:", "unknown unit 'degg'"), ("V_a:", "missing key 'unit'"), ("wnid:", "unknown key"),
    ):  # fmt: skip
        at = next(n for n, line in lines.items() if where in line)
        assert any(f"flight.yaml:{at}: " in str(one) and what in str(one) for one in e.value.errors), (where, what, said)
    # what a wrong entry drags along is no mistake of its own
    assert "missing key 'columns'" not in said and len(e.value.errors) == 11, said


def test_the_words_of_other_programs_lead_to_the_quantity():
    known = (*MEASURED, *INPUTS)
    for word, quantity in {"roll": "phi", "pitch": "theta", "yaw": "psi", "heading": "psi", "airspeed": "V_a", "aoa": "alpha",
                           "line_length": "tether_length", "winch speed": "reel_out_speed", "gyro_x": "p",
                           "TetherForce": "tension"}.items():  # fmt: skip
        assert nearest_quantity(word, known) == f"Did you mean '{quantity}'?"
    assert "sign: -1" in nearest_quantity("altitude", known) and "Known: " in nearest_quantity("xyzzy", known)


def test_no_phrase_stands_for_two_quantities():
    """Of one kind of file, a name means one thing."""
    from awescli.notation.names import PARTS, PHRASES

    seen = {}
    for quantity, phrases in {**PHRASES, **PARTS}.items():
        for phrase in phrases:
            flat = "".join(words(phrase))
            assert seen.setdefault(flat, quantity) == quantity, (phrase, seen[flat], quantity)
    assert all(meanings(words(q))[0].quantity == q for q in (*MEASURED, *INPUTS))


def weather(log, columns: dict) -> str:
    return pl.DataFrame(columns).write_csv()


WIND = """
wind:
  file: met.csv
  time: {column: clock, unit: min}
  direction: {column: to, unit: deg, offset: 180}
  speed: {column: ws, unit: kt}
  temperature: {column: T, unit: degF}
  pressure: {column: p, unit: hPa}
  height: {column: z, unit: ft}
"""


def test_weather_in_a_file_of_its_own(tmp_path, log):
    mapping = MAPPING + WIND
    rows = {"clock": [0.0, 0.0, 1.0, 1.0], "to": [10.0, 20.0, 30.0, 40.0], "ws": [10.0, 20.0, 12.0, 22.0]}
    rows |= {"T": [59.0] * 4, "p": [1013.25] * 4, "z": [0.0, 1000.0, 0.0, 1000.0]}
    back = read_flight(folder_with(tmp_path, log, mapping, met_csv=weather(log, rows)))
    assert back.wind.time.tolist() == [0.0, 60.0] and back.wind.height == pytest.approx([0.0, 304.8])
    assert back.wind.speed == pytest.approx(np.array([[10, 20], [12, 22]]) * KNOT)
    assert np.rad2deg(back.wind.direction) % 360 == pytest.approx(np.array([[190, 200], [210, 220]]))
    # 15 degC and 1013.25 hPa: the standard atmosphere at sea level (ISO 2533)
    assert back.wind.density == pytest.approx([1.225, 1.225], rel=1e-4)


def test_clocks_of_log_and_weather_must_be_of_one_kind(tmp_path, log):
    mapping = MAPPING + WIND.replace("unit: min", "unit: s")
    rows = {"clock": [1.7e9, 1.7e9 + 60], "to": [10.0, 10.0], "ws": [9.0, 9.0], "T": [50.0, 50.0], "p": [1000.0, 1000.0], "z": [10.0, 10.0]}
    folder = folder_with(tmp_path, log, mapping, met_csv=weather(log, rows))
    with pytest.raises(BadInput, match="the weather counts in unix time and the log does not\n.*`start: UNIX_SECONDS` under time"):
        read_flight(folder)
    (folder / "flight.yaml").write_text(mapping.replace("time: {column: t, unit: s}", "time: {column: t, unit: s, start: 1700000000}"))
    back = read_flight(folder)
    assert back.start == 1.7e9 and back.wind.time.tolist() == [0.0, 60.0]
    (folder / "flight.yaml").write_text(mapping.replace("time: {column: t, unit: s}", "time: {column: t, unit: s, start: 1700050000}"))
    with pytest.raises(BadInput, match="13.9 h away from the flight"):
        read_flight(folder)


def test_a_weather_file_beside_a_mapped_log_is_used_or_named(tmp_path, log):
    """Kitemill's weather format is read as it lies there; anything else is said, never dropped in silence."""
    mapping = MAPPING.replace("unit: s}", f"unit: s, start: {log.start}}}")
    kitemill = write_folder(tmp_path / "kitemill", log)
    beside = folder_with(tmp_path / "a", log, mapping, wind_csv=(kitemill / "wind.csv").read_text())
    back = read_flight(beside)
    assert back.wind.speed[0, 0] == pytest.approx(8.0) and any("wind.csv lies beside the log" in n and "used" in n for n in back.notes)
    other = read_flight(folder_with(tmp_path / "b", log, mapping, wind_csv="when,from,kn\n1,2,3\n"))
    unused = "wind.csv lies beside the log and is not used: the column '_time' is missing"
    assert other.wind is None and any(unused in n for n in other.notes)
    named = read_flight(folder_with(tmp_path / "c", log, mapping + "wind: {file: w.csv}\n", w_csv=(kitemill / "wind.csv").read_text()))
    assert named.wind.speed[0, 0] == pytest.approx(8.0)


def test_clocks_of_text(tmp_path, log):
    """Dates and times, with and without a zone, and times of day: the same samples; a weather file of dates beside a log of dates."""
    from datetime import UTC, datetime, timedelta, timezone

    when = [datetime.fromtimestamp(log.start + t, UTC) for t in log.time.tolist()]
    east = timezone(timedelta(hours=2))
    clocks = {
        "zulu": [w.isoformat().replace("+00:00", "Z") for w in when], "no zone": [w.replace(tzinfo=None).isoformat(" ") for w in when],
        "east": [w.astimezone(east).isoformat() for w in when], "of day": [w.time().isoformat() for w in when],
    }  # fmt: skip
    rows = {"at": [clocks["zulu"][0], clocks["zulu"][-1]], "dir": [305.0, 306.0], "v": [9.0, 9.5]}
    met = pl.DataFrame(rows).write_csv()
    wind = "wind: {file: met.csv, time: {column: at, unit: iso}, direction: {column: dir, unit: deg}, speed: {column: v, unit: m/s}}\n"
    for name, cells in clocks.items():
        frame = foreign(log).with_columns(t=pl.Series(cells))
        mapping = MAPPING.replace("{column: t, unit: s}", "{column: t, unit: iso}") + ("" if name == "of day" else wind)
        back = read_flight(folder_with(tmp_path / name, log, mapping, frame, met_csv=met))
        assert back.dt == pytest.approx(0.04) and len(back) == len(log) and back.valid.all(), name
        assert back.start == pytest.approx(log.start if name != "of day" else log.start % 86400, abs=1e-5)
        assert name == "of day" or back.wind.time == pytest.approx([0.0, log.time[-1]], abs=1e-5)
    with pytest.raises(BadInput, match="'roll' is no date and time|is no date and time"):
        read_flight(folder_with(tmp_path / "no", log, MAPPING.replace("{column: t, unit: s}", "{column: roll, unit: iso}")))


def test_body_velocities_and_accelerometers(tmp_path, log):
    """Velocity in body axes comes back in NED; an accelerometer's specific force becomes the kinematic acceleration."""
    R = rotation_body_to_ned(log["phi"], log["theta"], log["psi"])
    body = rotate_back(R, (log["v_n"], log["v_e"], log["v_d"]))
    force = [log[n] - 9.80665 * R[2][i] for i, n in enumerate(("a_x", "a_y", "a_z"))]
    frame = foreign(log).with_columns(**{f"u{i}": c for i, c in enumerate(body)}, **{f"f{i}": c for i, c in enumerate(force)})
    mapping = MAPPING.replace("velocity: {columns: [vn, ve, vd], unit: kt}", "velocity: {columns: [u0, u1, u2], unit: m/s, frame: BODY}")
    mapping += "acceleration: {columns: [f0, f1, f2], unit: m/s2, frame: BODY, measures: specific_force}\n"
    back = read_flight(folder_with(tmp_path, log, mapping, frame))
    for name in ("v_n", "v_e", "v_d", "a_x", "a_y", "a_z"):
        assert np.abs(back[name] - log[name]).max() < 1e-6, name


def test_latitude_and_longitude(tmp_path, log):
    """Positions on the ellipsoid come back as north, east, down from the winch."""
    lat, lon = np.radians(58.1), np.radians(6.56)
    # the inverse by Newton steps on the forward formula, so that the two do not share a mistake in the rotation
    position = np.zeros((3, len(log)))
    position[0], position[1], position[2] = lat, lon, 20.0
    for _ in range(4):
        found = np.array(ned_from_geodetic(*position, (lat, lon, 20.0)))
        error = np.array([log["p_n"], log["p_e"], log["p_d"]]) - found
        position += error * np.array([[1 / SEMI_MAJOR], [1 / (SEMI_MAJOR * np.cos(lat))], [-1.0]])
    frame = foreign(log).with_columns(lat=np.degrees(position[0]) * 1e7, lon=np.degrees(position[1]), alt=position[2] / FOOT)
    where = MAPPING.splitlines()[3]
    geodetic = (
        "position: {latitude: {column: lat, unit: deg, scale: 1e-7}, longitude: {column: lon, unit: deg},"
        " altitude: {column: alt, unit: ft}, origin: {latitude: 58.1, longitude: 6.56, altitude: 20.0}}"
    )
    back = read_flight(folder_with(tmp_path, log, MAPPING.replace(where, geodetic), frame))
    assert max(np.abs(back[n] - log[n]).max() for n in ("p_n", "p_e", "p_d")) < 1e-3
    # a metre along the axis and the equator's radius of the ellipsoid
    assert np.linalg.norm(earth_fixed(0.0, 0.0, 1.0)) == pytest.approx(SEMI_MAJOR + 1)


@pytest.mark.parametrize(
    "old, new, says",
    [
        # declared ENU, and the columns are NED: and the other way round
        ("velocity: {columns: [vn, ve, vd], unit: kt}", "velocity: {columns: [vn, ve, vd], unit: kt, frame: ENU}",
         r"read as ENU the velocity misses the change of position by [\d.]+ m/s, as NED \(north, east, down\) it fits to .* m/s"),
        ("[east, north, up], unit: ft, frame: ENU", "[east, north, up], unit: ft, frame: NED", r"as ENU .* it fits to .* below its winch"),
        ("[east, north, up], unit: ft, frame: ENU", "[north, east, up], unit: ft, frame: NED", r"as NEU \(north, east, up\) it fits"),
        ("phi: {column: roll, unit: deg}", "phi: {column: roll, unit: rad}", r"phi reaches 28\.\d rad"),
        ("theta: {column: pitch, unit: deg}", "theta: {column: pitch, unit: rad}", r"theta reaches 17\.\d rad"),
        ("psi: {column: yaw, unit: degrees}", "psi: {column: yaw, unit: deg, sign: -1, offset: 90}",
         "the heading lies .* counted from east"),
        ("time: {column: t, unit: s}", "time: {column: t, unit: ms}",
         "the samples are 4e-05 s apart, 2.5e.04 Hz\n.*It looks like s: 25 Hz"),
    ],
)  # fmt: skip
def test_implausible_frames_and_magnitudes_are_refused_with_the_number(tmp_path, log, old, new, says):
    assert old in MAPPING
    with pytest.raises(BadInput, match=says):
        read_flight(folder_with(tmp_path, log, MAPPING.replace(old, new)))


def test_a_kitemill_log_with_north_and_east_exchanged_is_refused(tmp_path, log):
    def exchange(frame):
        frame = frame.rename({"r_eb_eN": "a", "v_eb_eN": "b"})
        return frame.rename({"r_eb_eE": "r_eb_eN", "v_eb_eE": "v_eb_eN", "a": "r_eb_eE", "b": "v_eb_eE"})

    with pytest.raises(BadInput, match="north and east are exchanged in position and velocity"):
        read_flight(write_folder(tmp_path, log, exchange))


def test_a_heading_that_counts_turns_is_no_heading_in_degrees(tmp_path, log):
    frame = foreign(log).with_columns(yaw=np.unwrap(log["psi"]))
    mapping = MAPPING.replace("unit: degrees", "unit: rad")
    back = read_flight(folder_with(tmp_path, log, mapping, frame))
    assert np.ptp(np.unwrap(log["psi"])) > 12 and np.abs(np.angle(np.exp(1j * (back["psi"] - log["psi"])))).max() < 1e-9


def test_a_text_alone_is_checked_without_its_files(tmp_path):
    assert read_flight_file(tmp_path / "flight.yaml", MAPPING).file.velocity.unit == "kt"
