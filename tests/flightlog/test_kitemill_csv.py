"""Kitemill's format: there and back, and every way a file can be wrong has one clear error."""

import numpy as np
import polars as pl
import pytest
from flightlog.synthetic import SHARED, circle, write_folder
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from awescli.flightlog.kitemill_csv import COLUMNS, to_kitemill_csv
from awescli.flightlog.quality import data_quality
from awescli.flightlog.read import missing_for_model, read_flight
from awescli.notation.errors import AwesError, BadInput


@pytest.fixture(scope="module")
def log():
    return circle(noise=0.002)


def test_there_and_back_is_exact_to_the_columns_precision(tmp_path, log):
    back = read_flight(write_folder(tmp_path, log))
    assert back.dt == log.dt and len(back) == len(log) and back.valid.all() and back.start == log.start
    half = 0.5e-4 + 1e-9
    factor = {"deg": np.pi / 180, "deg/s": np.pi / 180, "kgf": 9.80665, "%": 0.01}
    for name, (_, unit, _) in COLUMNS.items():
        assert np.abs(back[name] - log[name]).max() <= half * factor.get(unit, 1.0), name
    assert np.allclose(back.wind.speed, 8.0) and np.allclose(back.wind.direction, np.pi + 0.1, atol=1e-5) and back.wind.height == [10.0]
    # the text of what was read is the text that was read
    assert to_kitemill_csv(back) == to_kitemill_csv(read_flight(write_folder(tmp_path / "again", back)))
    assert missing_for_model(back) == []


def test_column_order_and_unknown_columns_do_not_matter(tmp_path, log):
    def shuffle(frame):
        return frame.select(sorted(frame.columns, reverse=True)).with_columns(pl.lit("abc").alias("comment"))

    back = read_flight(write_folder(tmp_path / "b", log, shuffle))
    again = read_flight(write_folder(tmp_path / "a", log))
    assert all(np.array_equal(back[n], again[n]) for n in COLUMNS)
    assert any("comment" in note for note in back.notes)


def test_optional_columns_may_be_absent(tmp_path, log):
    drop = ["elevator_sp", "a_eb_bX", "a_eb_bY", "a_eb_bZ", "V_a", "LoadFiltered", "intern_time", "flaps_sp"]
    back = read_flight(write_folder(tmp_path, log, lambda f: f.drop(drop)))
    assert "V_a" not in back and "elevator" not in back and "rudder" in back
    assert data_quality(back).loop_count >= 6


def radians(*names):
    return lambda f: f.with_columns(*(pl.col(n) * np.pi / 180 for n in names))


def scaled(factor, *names):
    return lambda f: f.with_columns(*(pl.col(n) * factor for n in names))


@pytest.mark.parametrize(
    "change, says",
    [
        (lambda f: f.drop("rudder_sp"), "'rudder_sp' is missing"),
        (lambda f: f.rename({"r_eb_eN": "r_eb_en"}), "Did you mean 'r_eb_en'"),
        (radians("phi", "theta", "psi"), "units: {psi: rad}"),
        (radians("p", "q", "r"), "units: {p: rad/s}"),
        (radians("aileron_sp", "rudder_sp", "elevator_sp", "flaps_sp"), "units: {rudder_sp: rad}"),
        (scaled(9.80665, "LoadFiltered"), "units: {LoadFiltered: N}"),
        (scaled(1 / 0.3048, "r_eb_eN", "r_eb_eE", "r_eb_eD"), "looks like ft"),
        (scaled(3.6, "v_eb_eN", "v_eb_eE", "v_eb_eD"), "looks like km/h"),
        (scaled(-1, "r_eb_eD"), "below its winch"),
        (scaled(0.001, "epoch_ms"), "unix time in s"),
        (lambda f: f.with_columns(psi=pl.lit("abc")), "'abc' is not a number"),
        (lambda f: f.head(0), "no samples"),
        (lambda f: f.head(2), "At least 3"),
    ],
)
def test_wrong_files_give_one_clear_error(tmp_path, log, change, says):
    with pytest.raises(BadInput) as e:
        read_flight(write_folder(tmp_path, log, change))
    text = str(e.value)
    assert says in text.replace("It looks like", "looks like") and "kite.csv" in text and e.value.exit_code == 2


def test_declared_units_are_believed(tmp_path, log):
    folder = write_folder(tmp_path, log, lambda f: scaled(9.80665, "LoadFiltered")(radians("psi")(f)))
    (folder / "flight.yaml").write_text("format: kitemill\nunits: {LoadFiltered: N, psi: rad}\n")
    back = read_flight(folder)
    assert np.abs(back["tension"] - log["tension"]).max() < 1e-2 and np.abs(back["psi"] - log["psi"]).max() < 1e-5
    (folder / "flight.yaml").write_text("format: kitemill\nunits: {LoadFilterd: N}\n")
    with pytest.raises(BadInput, match="Did you mean 'LoadFiltered'"):
        read_flight(folder)
    (folder / "flight.yaml").write_text("format: kitemill\nunits: {LoadFiltered: deg}\n")
    with pytest.raises(BadInput, match="not a unit of force"):
        read_flight(folder)


def test_truncated_file(tmp_path, log):
    folder = write_folder(tmp_path, log)
    text = (folder / "kite.csv").read_text()
    (folder / "kite.csv").write_text(text[: len(text) // 2 - 40].rsplit(",", 3)[0])
    with pytest.raises(BadInput, match=r"kite.csv:\d+: the file is cut off"):
        read_flight(folder)


def test_few_bad_cells_are_dropouts_with_a_note(tmp_path, log):
    def spoil(f):
        row = pl.int_range(pl.len())
        text = f.with_columns(pl.col("V_a").cast(pl.String))
        return text.with_columns(
            pl.when(row.is_between(500, 503)).then(pl.lit("###")).when(row.is_between(900, 999)).then(None).otherwise("V_a").alias("V_a")
        )

    back = read_flight(write_folder(tmp_path, log, spoil))
    assert any("kite.csv:502: column V_a holds '###'; 4 unreadable" in note for note in back.notes)
    assert back.valid[495:510].all() and not back.valid[900:1000].any() and back.valid[899] and back.valid[1000]


def test_missing_weather_and_weather_of_another_day(tmp_path, log):
    folder = write_folder(tmp_path, log)
    wind = (folder / "wind.csv").read_text()
    (folder / "wind.csv").write_text(wind.replace("\n17000", "\n16000"))
    with pytest.raises(BadInput, match="h away from the flight"):
        read_flight(folder)
    (folder / "wind.csv").unlink()
    assert missing_for_model(read_flight(folder)) == ["wind (direction and speed)"]


def test_two_hours_at_50_hz_are_read_whole(tmp_path):
    """How fast and in how much memory: benchmarks/long_logs.py."""
    long = circle(seconds=7200.0, noise=0.002, reel=0.01)
    folder = write_folder(tmp_path, long)
    back = read_flight(folder)
    assert len(back) == 360_000 and back.valid.all()


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_bytes_never_give_a_traceback(tmp_path, data):
    folder = tmp_path / "fuzz"
    if not folder.exists():
        write_folder(folder, circle(seconds=4.0))
        (folder / "kite.orig").write_bytes((folder / "kite.csv").read_bytes())
        (folder / "wind.orig").write_bytes((folder / "wind.csv").read_bytes())
    for name in ("kite", "wind"):
        raw = bytearray((folder / f"{name}.orig").read_bytes())
        for _ in range(data.draw(st.integers(0, 6))):
            at = data.draw(st.integers(0, len(raw) - 1)) if data.draw(st.booleans()) else data.draw(st.integers(0, 400)) % len(raw)
            raw[at : at + data.draw(st.integers(0, 30))] = data.draw(st.binary(max_size=12))
        (folder / f"{name}.csv").write_bytes(bytes(raw))
    try:
        data_quality(read_flight(folder)).as_dict()
    except AwesError:
        pass


@pytest.mark.skipif(not SHARED.is_dir(), reason="the shared flights are not beside this checkout")
@pytest.mark.parametrize("name", [f"d{k:02d}" for k in range(1, 11)])
def test_development_flights(name):
    log = read_flight(SHARED / "flights" / "dev" / name)
    assert log.dt == 0.02 and len(log) == 7500 and log.valid.all() and missing_for_model(log) == []
    quality = data_quality(log)
    assert 14 <= quality.loop_count <= 19 and quality.phases == {"traction": 150.0}
    noise = {c.name: c.noise for c in quality.channels}
    # the README and nominal.yaml of these flights state the noise
    if name == "d09":  # turbulence shakes the airspeed and the kite at all frequencies
        noise |= {"V_a": 0.3, "a_x": 0.2}
    truth = {"p_n": 0.1, "p_d": 0.15, "v_n": 0.05, "phi": 0.2, "p": 0.3, "V_a": 0.3, "a_x": 0.2}
    assert all(abs(noise[k] / value - 1) < 0.08 for k, value in truth.items())
    failed = {c.name: c.value for c in quality.checks if not c.ok}
    if name == "d10":  # 0.16 s of position latency
        assert abs(failed.pop("position lag") - 0.16) < 0.01 and "position against velocity" in failed
    else:
        assert not failed
    first, _ = to_kitemill_csv(log)
    wanted = pl.read_csv(SHARED / "flights" / "dev" / name / "kite.csv")
    written = pl.read_csv(first.encode())
    for column in (c for c, _, _ in COLUMNS.values() if c in wanted.columns):
        assert np.array_equal(written[column].to_numpy(), wanted[column].to_numpy()), column
    assert set(wanted.columns) - {"camber_sp"} <= set(written.columns)  # which has no effect of its own


@pytest.mark.skipif(not SHARED.is_dir(), reason="the shared flights are not beside this checkout")
def test_real_weather_file_without_heights(tmp_path):
    text = (SHARED / "flights" / "lista-lighthouse" / "2022-04-28.csv").read_text()
    log = circle(seconds=10.0)
    moved = type(log)("x", 1651152925.0, log.dt, log.time, log.measured, log.inputs, log.valid)
    folder = write_folder(tmp_path, moved)
    (folder / "wind.csv").unlink()
    (folder / "lista_fyr_lighthouse.csv").write_text(text)
    wind = read_flight(folder).wind
    assert wind.height.tolist() == [10.0] and wind.speed[:, 0].tolist() == [14.2, 14.8, 13.3, 12.8] and wind.density is not None
    assert abs(wind.time[0] - 0.055) < 1e-3 and np.allclose(np.rad2deg(wind.direction[:, 0]), [297, 296, 297, 300])
