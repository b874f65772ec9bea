"""evaluate: what it says of power, in its artifact and at its end."""

import numpy as np
import pytest
from small_run import make_small_run

from awescli.artifacts import read_arrays, read_json
from awescli.flightlog.loops import find_loops
from awescli.flightlog.read import read_flight
from awescli.stages import STAGES
from awescli.stages.evaluate import cycle_line, power_line
from awescli.stages.plan import read_plan
from awescli.stages.runner import run_plan


def block(share, interval=None):
    return {"mean_W": 2500.0, "measured_mean_W": 2500.0, "error_share": share, "interval_share": interval}


def test_the_last_line_names_measured_power_and_every_models_error():
    """Guards the one line that an operator reads: kW, percent with signs, the last model's interval over loops."""
    line = power_line({"initial": block(-0.287), "with_effects": block(-0.0097, [-0.012, 0.003])})
    assert line == "2.5 kW measured; initial -28.7 %, with_effects -1.0 % (-1.2 to +0.3)" and len(line) <= 80
    known = {**block(-0.009), "interval_W": [2495.0, 2510.0]}
    assert power_line({"hybrid": known}) == "2.5 kW measured; hybrid -0.9 %, +0.1 % as other loops correct it (-0.2 to +0.4)"
    assert power_line({"hybrid": {**known, "error_share": 0.001}}) == "2.5 kW measured; hybrid +0.1 % (-0.2 to +0.4)"
    assert power_line({"initial": block(None)}) == "2.5 kW measured"
    assert power_line({}) == ""
    astray = {**known, "diverged": {"train": 0, "test": 5}, "by_cycle": [{"measured_J": 1e5, "predicted_J": 1e9}]}
    assert power_line({"initial": block(-0.2), "identified": astray}) == "2.5 kW measured; initial -20.0 %, identified diverged"
    assert cycle_line({"identified": astray}) == "100 kJ measured in 1; identified diverged"
    assert power_line({"initial": block(-0.0001)}) == "2.5 kW measured; initial +0.0 %"


def evaluated(folder, settings=()):
    """metrics.json of evaluate alone, in a small run."""
    run_plan(read_plan(make_small_run(folder), STAGES, {"evaluate.report": "false", **dict(settings)}), STAGES, only=["evaluate"])
    return read_json(folder / "out" / "evaluate" / "metrics.json")


def test_a_linear_model_stands_beside_the_others(tmp_path):
    """Guards the baseline's place: scored like every model, on the same predictions, in the table, the closing lines and the arrays."""
    metrics = evaluated(tmp_path)
    linear, initial, arrays = metrics["linear"], metrics["initial"], read_arrays(tmp_path / "out" / "evaluate" / "predictions.npz")
    assert linear["predictions"] == initial["predictions"] and linear["by_horizon"].keys() == initial["by_horizon"].keys()
    assert linear["nrmse"]["test"].keys() == initial["nrmse"]["test"].keys()
    assert linear["one_step"]["predictions"] == initial["one_step"]["predictions"]
    assert arrays["linear_phi"].shape == arrays["initial_phi"].shape and not np.array_equal(arrays["linear_phi"], arrays["initial_phi"])
    short, long = (
        own["mean"] >= its["mean"]
        for own, its in (
            (initial["by_horizon"]["0.5"]["nrmse"], linear["by_horizon"]["0.5"]["nrmse"]),
            (initial["nrmse"]["test"], linear["nrmse"]["test"]),
        )
    )
    baseline = metrics["baseline"]
    assert baseline["not_beaten"] == {"initial": [*(["0.5"] if short else []), *(["1"] if long else [])]}
    assert baseline["outcome"] == "fitted" and "rudder" in baseline["inputs"] and linear["nrmse"]["test"]["mean"] < 0.2
    summary = read_json(tmp_path / "out" / "evaluate" / "provenance.json")["summary"]
    said = " ".join(summary["answer"])
    assert "a linear model (ARX)" in said and ", linear 0." in said and "linear" in summary["errors"]


def test_the_linear_model_of_a_gappy_log_and_of_a_closed_loop(tmp_path):
    """Guards the baseline where the log has holes, and where the fitted law moves the surfaces: then it is not told them either."""
    plan = make_small_run(tmp_path)
    rows = (tmp_path / "flight" / "kite.csv").read_text().splitlines(keepends=True)
    (tmp_path / "flight" / "kite.csv").write_text("".join(rows[:200] + rows[240:900] + rows[1000:]))
    run_plan(read_plan(plan, STAGES, {"evaluate.report": "false"}), STAGES, only=["fit-controller", "evaluate"])
    told = read_json(tmp_path / "out" / "evaluate" / "metrics.json")
    assert told["baseline"]["outcome"] == "fitted" and told["linear"]["predictions"] == told["initial"]["predictions"]
    closed = {"evaluate.report": "false", "evaluate.surfaces": "controller"}
    run_plan(read_plan(plan, STAGES, closed), STAGES, only=["evaluate"])
    blind = read_json(tmp_path / "out" / "evaluate" / "metrics.json")
    assert "rudder" in blind["baseline"]["outputs"] and "rudder" not in blind["baseline"]["inputs"]
    assert "rudder" in told["baseline"]["inputs"] and blind["linear"]["nrmse"]["test"].keys() == blind["initial"]["nrmse"]["test"].keys()


def test_power_is_in_the_artifact_and_is_that_of_the_predictions(tmp_path):
    """Guards the contract's `power` block: tension times reel-out speed of the very predictions that predictions.npz holds."""
    evaluated(tmp_path)
    power = read_json(tmp_path / "out" / "evaluate" / "metrics.json")["initial"]["power"]
    arrays, log = read_arrays(tmp_path / "out" / "evaluate" / "predictions.npz"), read_flight(tmp_path / "flight")
    speed = log["reel_out_speed"][arrays["first"][:, None] + np.arange(arrays["time"].size)]
    predicted, measured = ((arrays[f"{who}_tension"] * speed).mean() for who in ("initial", "measured"))
    assert power["error_share"] == pytest.approx(predicted / measured - 1, abs=0.02)
    assert power["measured_mean_W"] == pytest.approx(measured, rel=0.02)
    assert power["interval_share"][0] < power["error_share"] < power["interval_share"][1]
    assert power["loops"] == len(power["by_loop"]) >= 2 and power["energy_per_loop_J"]["nrmse"] > 0
    bounds = find_loops(log).bounds
    assert power["loop_seconds"] == pytest.approx(sum(bounds[row["loop"] - 1] @ [-1, 1] for row in power["by_loop"]) * log.dt)
    assert power["seconds"] <= power["loop_seconds"]


def test_bands_of_every_physical_model_are_in_the_artifacts(tmp_path):
    """Guards the block `bands` and its arrays: the share inside is that of the measured samples between the arrays; the linear model says
    that it has none."""
    metrics = evaluated(tmp_path)
    told, arrays = metrics["initial"]["bands"], read_arrays(tmp_path / "out" / "evaluate" / "predictions.npz")
    assert told["outcome"] == "computed" and told["level"] == 0.9 and metrics["linear"]["bands"]["outcome"].startswith("none: ")
    inside = (arrays["low_initial_V_a"] <= arrays["measured_V_a"]) & (arrays["measured_V_a"] <= arrays["high_initial_V_a"])
    assert told["inside"]["V_a"] == pytest.approx(inside.mean()) and told["half_width"]["V_a"] > 0
    half = (arrays["high_initial_V_a"] - arrays["low_initial_V_a"]) / 2
    assert told["half_width"]["V_a"] == pytest.approx(half.mean())
    # the kite is as declared: what is not known of its parameters is most of the band
    assert told["std"]["parameters"]["V_a"] > told["std"]["noise"]["V_a"] > 0
    measured = evaluated(tmp_path / "measured", {"evaluate.initial_states": "measured"})
    assert measured["initial"]["bands"]["outcome"].startswith("none: it begins at measured states")
