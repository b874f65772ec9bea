"""The ten development flights: identified, traced, and compared with their key. Skipped where they are not."""

import importlib.util
import json
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from awescli.estimation.prediction import predict
from awescli.flightlog.loops import find_loops
from awescli.flightlog.read import read_flight
from awescli.flightlog.split import split
from awescli.physics.declaration import read_kite
from awescli.tracing.flight import trace_flight
from awescli.tracing.summary import summary

ROOT = Path(__file__).parents[2]
FLIGHTS = ROOT.parent / "shared" / "flights" / "dev"

pytestmark = pytest.mark.skipif(not (FLIGHTS / "KEY.json").is_file(), reason="the development flights (../shared/flights/dev) are not here")

DEG = np.pi / 180
EXPECTED: dict[str, tuple[tuple[str, ...], dict[str, float]]] = {
    "d01": (("none",), {}),
    "d02": (("none",), {}),
    "d03": (("found", "cannot_tell"), {"tau": 0.225, "rate": 36.0 * DEG}),
    "d04": (("found", "cannot_tell"), {"a": 0.19}),
    "d05": (("found", "cannot_tell"), {"k": 1.65}),
    "d06": (("found", "cannot_tell"), {"b": 0.0022}),
    "d07": (("found", "cannot_tell"), {"s": 0.93, "b": 0.8}),
    "d08": (("found", "cannot_tell"), {"EA": 900000.0, "zeta": 120.0}),
    "d09": (("not_deterministic",), {}),
    "d10": (("found", "cannot_tell"), {"tau": 0.16}),
}
"""flight -> verdicts that are right, and the true sizes in the units of effects.md."""
NARROW = {"d03": "tau", "d04": "a", "d07": "s", "d10": "tau"}
"""Sizes whose interval must be no wider than 25 % (lag, shear, airspeed, latency)."""
STARTS_OFF = {"d03": ("rate", 0.05)}
"""Flight -> (size, share by which it may be off): a segment that begins while the rudder runs at its limit begins with a deflection that is
up to 17 deg off (what came before is known for 0.1 s), which makes the limit 3 % too high; its interval does not know that."""


QUICK = ("d01", "d02", "d06")
"""Traced in every run of the tests; the others take longer: `pytest -m campaign tests/acceptance`."""


def trace_of(flight: Path, kite: Path):
    """(log, parts, finding)"""
    spec = importlib.util.spec_from_file_location("declare", ROOT / "examples" / "dev_kite" / "declare.py")
    declare = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(declare)
    assert declare.main([str(flight / "nominal.yaml"), str(kite)]) == 0
    log = read_flight(flight)
    parts = split(find_loops(log), log=log)
    return log, parts, trace_flight(read_kite(kite), log, parts)


@pytest.fixture(scope="module", params=[pytest.param(n, marks=() if n in QUICK else pytest.mark.campaign) for n in EXPECTED])
def traced(request, tmp_path_factory):
    """(flight's name, its effects.json)"""
    log, parts, finding = trace_of(FLIGHTS / request.param, tmp_path_factory.mktemp(request.param) / "kite.yaml")
    before, after = (predict(model, log, parts.test, 5.0) for model in (finding.before(), finding.after()))
    return request.param, summary(finding, log, 5.0, before, after)


def test_the_verdict_and_the_name_are_right(traced):
    """Guards issue 5: the right verdict, the right effect first with at most two rivals, and nothing on a clean flight."""
    name, effects = traced
    verdicts, sizes = EXPECTED[name]
    assert effects["verdict"] in verdicts
    true_names = json.loads((FLIGHTS / "KEY.json").read_text())[name]["effects"]
    found = [e["name"] for e in effects["effects"]]
    if sizes:
        assert found[:1] == list(true_names) and len(effects["effects"][0]["rivals"]) <= 2
    else:
        assert found == []


def test_the_size_is_inside_its_interval(traced):
    """Guards stated intervals: true sizes within three standard deviations, and narrow where issue 5 asks for it."""
    name, effects = traced
    for parameter, value in EXPECTED[name][1].items():
        assert parameter in effects["effects"][0]["parameters"], f"{parameter} was not estimated"
        found = effects["effects"][0]["parameters"][parameter]
        room = STARTS_OFF[name][1] * value if STARTS_OFF.get(name, ("",))[0] == parameter else 3 * found["std"]
        assert abs(found["value"] - value) <= room, (parameter, found)
        if NARROW.get(name) == parameter:
            assert 2 * 1.96 * found["std"] <= 0.25 * value, (parameter, found)


def test_the_error_reaches_the_noise(traced):
    """Guards the proof on unseen loops: with the effect in, 5 s predictions score within 1.3 x the sensors' noise; a clean flight
    identifies to at most 0.006 to begin with. (Clean flights of the tracing campaign score 1.13 x in the median: the recorded wind errs
    on the test loops too, and no model knows how.)"""
    name, effects = traced
    error = effects["error"]
    if name in ("d01", "d02"):
        assert error["after"]["mean"] <= 0.006
    elif EXPECTED[name][1]:
        assert error["after"]["mean"] <= 1.3 * error["noise_floor"]["mean"], error["after"]["mean"] / error["noise_floor"]["mean"]
    assert error["diverged_after"] == 0


HELD = {"r_eb_e": 10, "v_eb_e": 10, "phi": 3, "theta": 3, "psi": 3, "V_a": 5}
"""Beginning of a column's name -> rows of 50 Hz in which a value stands: a receiver of 5 Hz, a filter of 17 Hz, a pitot of 10 Hz."""


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["d01", "d03", "d10"])
def test_slow_sensors_in_fast_rows_change_no_verdict(name, tmp_path):
    """Guards recorders that hold each value until the next one: name and size as without."""
    shutil.copytree(FLIGHTS / name, flight := tmp_path / name)
    table = pl.read_csv(flight / "kite.csv")
    rows = np.arange(table.height)
    held = {c: n for c in table.columns for start, n in HELD.items() if c.startswith(start)}
    table.with_columns(pl.Series(c, table[c].to_numpy()[rows // n * n]) for c, n in held.items()).write_csv(flight / "kite.csv")
    log, parts, finding = trace_of(flight, tmp_path / "kite.yaml")
    assert len(log.fresh) == len(held)
    before, after = (predict(model, log, parts.test, 5.0) for model in (finding.before(), finding.after()))
    effects = summary(finding, log, 5.0, before, after)["effects"]
    assert [e["name"] for e in effects] == list(json.loads((FLIGHTS / "KEY.json").read_text())[name]["effects"])
    for parameter, value in EXPECTED[name][1].items():
        found = effects[0]["parameters"][parameter]
        assert abs(found["value"] - value) <= max(3 * found["std"], 0.05 * value), (parameter, found)


@pytest.mark.campaign
def test_missing_rows_change_no_verdict(tmp_path):
    """Guards telemetry with gaps: forty of 3 to 24 rows in 150 s leave nothing that has no name."""
    shutil.copytree(FLIGHTS / "d05", flight := tmp_path / "d05")
    table, random = pl.read_csv(flight / "kite.csv"), np.random.default_rng(5)
    kept = np.ones(table.height, bool)
    for _ in range(40):
        first = random.integers(0, table.height - 40)
        kept[first : first + random.integers(3, 25)] = False
    table.filter(pl.Series(kept)).write_csv(flight / "kite.csv")
    _, _, finding = trace_of(flight, tmp_path / "kite.yaml")
    assert finding.verdict == "found" and finding.evidence.model.keys == ("sideslip_drag",)
    assert finding.model.table["sideslip_drag.k"].value == pytest.approx(EXPECTED["d05"][1]["k"], rel=0.05)


@pytest.mark.campaign
def test_stamps_that_wobble_change_no_verdict(tmp_path):
    """Guards recorders that stamp rows when they come, 3 ms early or late: name and size as without."""
    shutil.copytree(FLIGHTS / "d03", flight := tmp_path / "d03")
    table = pl.read_csv(flight / "kite.csv")
    stamps = table["epoch_ms"].to_numpy() + np.rint(3 * np.random.default_rng(3).standard_normal(table.height)).astype(int)
    table.with_columns(epoch_ms=pl.Series(np.maximum.accumulate(stamps))).write_csv(flight / "kite.csv")
    _, _, finding = trace_of(flight, tmp_path / "kite.yaml")
    assert finding.verdict == "found" and finding.evidence.model.keys == ("actuator_lag:rudder",)
    assert finding.model.table["actuator_lag:rudder.tau"].value == pytest.approx(EXPECTED["d03"][1]["tau"], rel=0.05)


NO_SENSOR = ("epoch_ms", "intern_time", "reel_out_speed", "tether_length")


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["d01", "d03", "d05"])
def test_errors_of_some_values_change_no_verdict(name, tmp_path):
    """Guards dirty logs: one, two and three values in a row that are off by 0.05, 0.3 or 2 times what a channel varies by, in half a per
    cent of the rows of every sensor; d03 was `unexplained`. What no reader tells is left out of the trace, and counted."""
    shutil.copytree(FLIGHTS / name, flight := tmp_path / name)
    table, random = pl.read_csv(flight / "kite.csv"), np.random.default_rng(3)
    dirty = {}
    for column in (c for c in table.columns if c not in NO_SENSOR and not c.endswith("_sp")):
        dirty[column] = x = table[column].to_numpy().copy()
        spread = x.std()
        for length, rate in ((1, 0.002), (2, 0.0007), (3, 0.0003)):
            for i in random.integers(10, x.size - 10, random.poisson(rate * x.size)):
                x[i : i + length] += random.normal(size=length) * spread * random.choice([0.05, 0.3, 2.0])
    table.with_columns(pl.Series(c, x) for c, x in dirty.items()).write_csv(flight / "kite.csv")
    _, _, finding = trace_of(flight, tmp_path / "kite.yaml")
    assert finding.verdict == EXPECTED[name][0][0] and sum(finding.outliers.values()) > 0
    named = [key.partition(":")[0] for key in finding.evidence.model.keys]
    assert named == list(json.loads((FLIGHTS / "KEY.json").read_text())[name]["effects"])


@pytest.mark.campaign
@pytest.mark.parametrize("column, length, size", [("V_a", 25, 6.0), ("phi", 5, 12.0), ("r_eb_eN", 40, 4.0)])
def test_bursts_hide_no_drag(column, length, size, tmp_path):
    """Guards dirty logs: four times a sensor is off for 0.1 to 0.8 s. What hid d05's drag is left out, and counted."""
    shutil.copytree(FLIGHTS / "d05", flight := tmp_path / "d05")
    table = pl.read_csv(flight / "kite.csv")
    x = table[column].cast(pl.Float64).to_numpy().copy()
    for i in np.random.default_rng(3).integers(500, x.size - 500, 4):
        x[i : i + length] += size
    table.with_columns(pl.Series(column, x)).write_csv(flight / "kite.csv")
    _, _, finding = trace_of(flight, tmp_path / "kite.yaml")
    assert finding.verdict == "found" and finding.evidence.model.keys == ("sideslip_drag",)
    assert sum(finding.outliers.values()) >= length


@pytest.mark.campaign
def test_accelerometers_ahead_of_the_reference_point_have_their_name(tmp_path):
    """Guards a box that stands where there was room for it: what it feels of the rotation was taken for the arm of the antenna."""
    shutil.copytree(FLIGHTS / "d01", flight := tmp_path / "d01")
    table, arm = pl.read_csv(flight / "kite.csv"), np.array([0.35, 0.0, 0.05])
    rates = np.radians(table.select("p", "q", "r").to_numpy())
    smooth = sosfiltfilt(butter(2, 8.0, fs=50, output="sos"), rates, axis=0)
    felt = np.cross(np.gradient(smooth, 0.02, axis=0), arm) + np.cross(smooth, np.cross(smooth, arm))
    columns = {n: table[n] + felt[:, i] for i, n in enumerate(("a_eb_bX", "a_eb_bY", "a_eb_bZ"))}
    table.with_columns(**columns).write_csv(flight / "kite.csv")
    _, _, finding = trace_of(flight, tmp_path / "kite.yaml")
    assert finding.verdict == "found" and finding.evidence.model.keys == ("imu_arm",)
    values = finding.model.table
    assert [values[f"imu_arm.{n}"].value for n in "xyz"] == pytest.approx(arm, abs=0.03)


@pytest.mark.campaign
def test_a_box_that_is_turned_has_its_name(tmp_path):
    """Guards an IMU that is mounted 2 deg off: `not_testable`, for a velocity said to be late."""
    shutil.copytree(FLIGHTS / "d01", flight := tmp_path / "d01")
    table, angles = pl.read_csv(flight / "kite.csv"), np.array([-1.5, 2.0, 1.0]) * DEG
    box = Rotation.from_rotvec(-angles).as_matrix()
    turned = [(names, table.select(names).to_numpy() @ box.T) for names in (["p", "q", "r"], ["a_eb_bX", "a_eb_bY", "a_eb_bZ"])]
    table.with_columns(**{n: x[:, i] for names, x in turned for i, n in enumerate(names)}).write_csv(flight / "kite.csv")
    _, _, finding = trace_of(flight, tmp_path / "kite.yaml")
    assert finding.verdict == "found" and finding.evidence.model.keys == ("imu_misalignment",)
    values = finding.model.table
    assert [values[f"imu_misalignment.{n}"].value for n in "xyz"] == pytest.approx(angles, abs=0.1 * DEG)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["d01", "d05"])
def test_a_noisy_winch_changes_no_verdict(name, tmp_path):
    """Guards winches as they are: a length in whole decimetres, a speed with noise of 0.05 m/s (a `winch_tracking` that is not there)."""
    shutil.copytree(FLIGHTS / name, flight := tmp_path / name)
    table = pl.read_csv(flight / "kite.csv")
    speed = table["reel_out_speed"].to_numpy() + 0.05 * np.random.default_rng(3).standard_normal(table.height)
    table.with_columns(pl.col("tether_length").round(1), reel_out_speed=pl.Series(speed)).write_csv(flight / "kite.csv")
    _, _, finding = trace_of(flight, tmp_path / "kite.yaml")
    assert finding.verdict == EXPECTED[name][0][0]
    assert list(finding.evidence.model.keys) == list(json.loads((FLIGHTS / "KEY.json").read_text())[name]["effects"])


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["d01", "d03", "d05"])
def test_a_noisy_rudder_changes_no_verdict(name, tmp_path):
    """Guards potentiometers: a rudder read with noise of 0.3 deg (`unexplained`, `hinge_blowback:rudder` nearest)."""
    shutil.copytree(FLIGHTS / name, flight := tmp_path / name)
    table = pl.read_csv(flight / "kite.csv")
    rudder = table["rudder_sp"].to_numpy() + 0.3 * np.random.default_rng(3).standard_normal(table.height)
    table.with_columns(rudder_sp=pl.Series(rudder)).write_csv(flight / "kite.csv")
    _, _, finding = trace_of(flight, tmp_path / "kite.yaml")
    assert finding.verdict == EXPECTED[name][0][0]
    there = json.loads((FLIGHTS / "KEY.json").read_text())[name]["effects"]
    assert [key.partition(":")[0] for key in finding.evidence.model.keys] == list(there)
