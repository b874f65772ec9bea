"""The measured AP2 flight, the foreign soft-kite log, and mappings with mistakes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flightlog.synthetic import SHARED, circle, write_folder
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from awescli.flightlog import ampyx_mat
from awescli.flightlog.ampyx_mat import wind_record
from awescli.flightlog.mat5 import read_mat
from awescli.flightlog.quality import data_quality
from awescli.flightlog.read import missing_for_model, read_flight
from awescli.notation.errors import AwesError, BadInput

needs_shared = pytest.mark.skipif(not SHARED.is_dir(), reason="the shared flights are not beside this checkout")


@needs_shared
def test_ampyx_ap2():
    log = read_flight(SHARED / "flights" / "ampyx-ap2")
    assert log.dt == 0.02 and len(log) == 2467 and missing_for_model(log) == []
    assert "a_x" not in log and "flaps" not in log and log.groups["tension"] == "winch"
    # the winch clock: range rate and winch speed agree only 4.3 s apart, and so do airspeed squared and tension
    assert (~log.valid).sum() == pytest.approx(4.34 / 0.02, abs=10) and any("late against the range rate" in n for n in log.notes)
    taut = log.valid & (log["tension"] > 1000)
    slack = log["tether_length"] - np.sqrt(log["p_n"] ** 2 + log["p_e"] ** 2 + log["p_d"] ** 2)
    assert np.abs(slack[taut]).max() < 6.0
    quality = data_quality(log)
    assert quality.phases["traction"] > 20 and quality.phases["retraction"] > 15 and "blocks" in quality.loops
    checks = {c.name: c for c in quality.checks}
    assert checks["airspeed bias"].ok and checks["airspeed scatter"].ok and checks["attitude against rates"].ok


@needs_shared
@pytest.mark.parametrize("wrong", [60.0, np.nan])
def test_the_line_of_the_ap2_is_not_longer_for_a_wrong_winch_speed(monkeypatch, wrong):
    """Guards the integrated length: one value of the winch's speed that is far off, or no number, leaves it as it was."""
    file = next((SHARED / "flights" / "ampyx-ap2").glob("*.mat"))
    clean = ampyx_mat.read_ampyx(file)

    def read(*asked):
        kinds, data = read_mat(*asked)
        data["response"]["tetherSpeed"] = data["response"]["tetherSpeed"].copy()
        data["response"]["tetherSpeed"][..., 900] = wrong
        return kinds, data

    monkeypatch.setattr(ampyx_mat, "read_mat", read)
    log = ampyx_mat.read_ampyx(file)
    assert np.abs(log["tether_length"] - clean["tether_length"]).max() < 0.02
    assert np.abs(log["reel_out_speed"] - clean["reel_out_speed"]).max() < 0.5


@needs_shared
def test_foreign_soft_kite_log():
    log = read_flight(Path(__file__).with_name("swinging_kite_flight.yaml"))
    assert log.dt == 0.1 and len(log) == 1195 and log["p_d"].max() < -100
    assert missing_for_model(log) == ["tether_length", "a control surface (aileron, elevator or rudder)"]
    for p, v in (("p_n", "v_n"), ("p_e", "v_e"), ("p_d", "v_d")):
        assert np.corrcoef(np.gradient(log[p], 0.1), log[v])[0, 1] > 0.97
    assert 600 < log["tension"].min() and log["tension"].max() < 5300
    assert data_quality(log).phases["retraction"] > 15
    # its attitude, rates and velocity come at 6.7 Hz
    assert {"phi", "theta", "psi", "p", "q", "r", "v_n", "v_e", "v_d"} <= set(log.fresh) and 0.6 < log.fresh["phi"].mean() < 0.7


MAPPING = """
time: {column: epoch_ms, unit: ms}
position: {columns: [r_eb_eE, r_eb_eN, up], unit: m, frame: ENU}
velocity: {columns: [v_eb_eN, v_eb_eE, v_eb_eD], unit: m/s}
signals:
  psi: {column: yaw_enu, unit: deg, sign: -1, offset: 90}
  phi: {column: phi, unit: deg}
  theta: {column: theta, unit: deg}
  tension: {column: LoadFiltered, unit: kgf}
  tether_length: {column: tether_length, unit: m}
"""


def enu(frame):
    import polars as pl

    return frame.with_columns(up=-pl.col("r_eb_eD"), yaw_enu=90 - pl.col("psi"))


def test_mapping_of_frames_signs_and_offsets(tmp_path):
    log = circle(seconds=20.0)
    folder = write_folder(tmp_path, log, enu)
    (folder / "flight.yaml").write_text("file: kite.csv\n" + MAPPING)
    back = read_flight(folder)
    for name in ("p_n", "p_e", "p_d", "v_n", "v_d", "psi", "phi"):
        assert np.abs(back[name] - log[name]).max() < 1e-4, name
    assert np.abs(back["tension"] - log["tension"]).max() < 1e-3
    assert "rudder" not in back and "p" in missing_for_model(back)


@pytest.mark.parametrize(
    "old, new, says",
    [
        ("unit: kgf", "unit: kfg", "Did you mean 'kgf'"),
        ("unit: kgf", "unit: m", "not a unit of force"),
        ("column: theta", "column: thetta", "Did you mean 'theta'"),
        ("  theta:", "  thetta:", "Did you mean 'theta'"),
        ("frame: ENU", "frame: NEU", "frame"),
        ("frame: ENU", "frame: NED", "below its winch"),
        ("phi: {column: phi, unit: deg}", "phi: {column: phi, unit: deg, sgin: -1}", "Did you mean 'sign'"),
        ("column: yaw_enu, unit: deg, sign: -1, offset: 90", "column: yaw_enu, unit: rad", "psi reaches"),
        ("time:", "tmie:", "tmie"),
        ("file: kite.csv", "file: kit.csv", "kit.csv"),
        ("[r_eb_eE, r_eb_eN, up]", "[r_eb_eE, r_eb_eN", "flight.yaml"),
    ],
)
def test_mistakes_in_the_mapping_are_named(tmp_path, old, new, says):
    folder = write_folder(tmp_path, circle(seconds=20.0), enu)
    text = "file: kite.csv\n" + MAPPING
    assert old in text
    (folder / "flight.yaml").write_text(text.replace(old, new))
    with pytest.raises(BadInput) as e:
        read_flight(folder)
    assert says in str(e.value)


def test_folders_without_a_flight(tmp_path):
    with pytest.raises(BadInput, match="no such flight folder"):
        read_flight(tmp_path / "none")
    with pytest.raises(BadInput, match="Looked for flight.yaml"):
        read_flight(tmp_path)
    (tmp_path / "x.mat").write_bytes(b"MATLAB 5.0")
    with pytest.raises(BadInput, match="MATLAB 5 file"):
        read_flight(tmp_path)
    savemat(tmp_path / "x.mat", {"other": np.zeros(3)})
    with pytest.raises(BadInput, match="no struct 'validationData'"):
        read_flight(tmp_path)
    savemat(tmp_path / "x.mat", {"validationData": {"times": np.arange(5.0), "response": {"p": np.zeros((3, 4))}}})
    with pytest.raises(BadInput, match="no field 'controls'"):
        read_flight(tmp_path)


@pytest.mark.parametrize("lost", [slice(10, 12), slice(None)])
def test_wind_of_a_mat_file_that_is_no_number_is_left_out(lost):
    """libFuzzer found a wind speed of nan among the data checks. What is kept is what the clean record holds then."""
    t = np.arange(60) * 0.02
    air = np.array([[3.0], [4.0], [0.5]]) * (1 + 0.1 * t)
    clean, dropped = wind_record(t, air, 200.0)
    assert dropped == 0 and clean.speed[:, 0] == pytest.approx(5.0 * (1 + 0.1 * t))
    holed = air.copy()
    holed[1, lost] = np.nan
    record, dropped = wind_record(t, holed, 200.0)
    assert dropped == np.isnan(holed[1]).sum()
    if dropped < 60:
        kept = np.isfinite(holed[1])
        assert (record.time == clean.time[kept]).all() and (record.speed == clean.speed[kept]).all()
    else:
        assert record is None


def test_no_wind_record_holds_what_is_no_number():
    wind = circle().wind
    for name in ("time", "height", "speed", "direction", "down"):
        with pytest.raises(BadInput, match=f"holds a {name} that is no finite number"):
            replace(wind, **{name: np.full_like(getattr(wind, name), np.nan)})


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_mat_files_never_give_a_traceback(tmp_path, data):
    n = 60
    eye = np.repeat(np.eye(3)[:, :, None], n, axis=2)
    response = {"p": np.ones((3, n)), "v": np.ones((3, n)), "R": eye, "w": np.zeros((3, n))}
    response |= {k: np.ones(n) for k in ("airspeed", "angleOfAttack", "sideSlip", "tetherTension", "tetherSpeed")}
    controls = {"times": np.arange(n) * 0.02, "wind": np.ones((3, n)), **{k: np.zeros(n) for k in ("aileron", "elevator", "rudder")}}
    folder = tmp_path / "m"
    folder.mkdir(exist_ok=True)
    savemat(folder / "a.mat", {"validationData": {"times": np.arange(n) * 0.02, "response": response, "controls": controls}})
    raw = bytearray((folder / "a.mat").read_bytes())
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(100, len(raw) - 1))
        raw[at : at + data.draw(st.integers(0, 8))] = data.draw(st.binary(max_size=8))
    (folder / "a.mat").write_bytes(bytes(raw))
    try:
        data_quality(read_flight(folder)).as_dict()
    except AwesError:
        pass
