"""trace-residual from a plan: what it leaves for each kind of verdict, and how it ends."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from flightlog.synthetic import write_folder
from kites import DEVELOPMENT

from awescli.artifacts import read_json
from awescli.estimation.problem import build, simulator_of
from awescli.flightlog.split import Split
from awescli.notation.errors import NumericalFailure
from awescli.notation.parameters import ParameterTable
from awescli.physics.declaration import kite_text, read_kite
from awescli.simulation.campaign_flights import dev_like
from awescli.stages import STAGES
from awescli.stages.plan import read_plan
from awescli.stages.runner import run_plan
from awescli.stages.trace_residual import begun
from awescli.tracing import investigate as tracing
from awescli.tracing.instruments import InstrumentError

PLAN = """
flight: flight
kite: kite.yaml
out: out
split: {train: 0.5, validation: 0.25, test: 0.25}
stages:
  identify: {horizon: 2.0, curriculum: []}
  trace-residual: {horizon: 2.0, curriculum: [], candidates: [sideslip_drag, airspeed_scale, "surface_bias:yaw"]}
"""
PARTS = Split(((0, 300),), ((300, 500),), (), (1, 1, 0), "time")
GUESSED = ("CL0", "CD0", "Cndr", "dl")


def folder_of(path, effects: dict, changes: Mapping[str, float] = MappingProxyType({}), duration: float = 50.0):
    """A plan, a short flight with `effects`, and a kite file of which only GUESSED is not known; changes: factors on declared values."""
    flight = dev_like(DEVELOPMENT, 51, effects, duration=duration)
    truth, guess = flight.flown.table(), flight.declared.table()
    rows = [guess[n] if n in GUESSED else replace(guess[n], value=truth[n].value, free=False) for n in guess]
    rows = [replace(r, value=changes[r.name] * r.value, lower=-np.inf, upper=np.inf) if r.name in changes else r for r in rows]
    write_folder(path / "flight", flight.log)
    (path / "kite.yaml").write_text(kite_text(flight.declared.with_parameters(ParameterTable(rows))))
    (path / "stages.yaml").write_text(PLAN)
    return path


def run(folder) -> dict:
    """Summary of trace-residual."""
    results = run_plan(read_plan(folder / "stages.yaml", STAGES, {"out": str(folder / "out")}), STAGES)
    return next(dict(r.summary) for r in results if r.stage == "trace-residual")


def effects_of(folder) -> dict:
    return read_json(folder / "out" / "trace-residual" / "effects.json")


def test_a_trace_goes_on_from_the_levels_and_memories_of_identify():
    """Guards what is handed on: the gusts' level and memory as identify found them; what is always there (the record's error) stays as it
    is declared, and other processes are none."""
    seen = {"level": 0.6, "unit": "m/s", "memory_s": 2.0, "process": "gusts"}
    record = {"level": 0.9, "unit": "m/s", "memory_s": 40.0, "process": "wind_record"}
    identified = {
        "surfaces": "recorded", "horizon_s": 2.0, "method": "filter error", "noise_factors": {"p": 1.2},
        "nrmse": {"validation": {"mean": 0.1}}, "processes": {"horizontal gusts": seen, "wind record": record},
    }  # fmt: skip
    left = begun(identified, 2.0, "recorded")["levels"]
    flight = dev_like(DEVELOPMENT, 51, {}, duration=12.0)
    problem = build(simulator_of(flight.declared, flight.log), flight.log, PARTS, 2.0, ("p", "q"))
    told = problem.at(left.processes, left.memories, left.factors)
    there = {g.name: (g.level, g.memory) for p in told.processes for g in p.groups if g.level > 0}
    declared = {g.name: (g.level, g.memory) for p in problem.processes for g in p.groups if g.level > 0}
    assert there == declared | {"horizontal gusts": (0.6, 2.0)} and "wind record" in declared
    assert told.factors["p"] == pytest.approx(1.2)


def test_an_effect_is_found_and_handed_on(tmp_path):
    """Guards the whole stage for `found`: size and probability in effects.json, the effect in the kite file, errors of one and the same
    prediction in all files, and the trace begun where identify ended."""
    folder = folder_of(tmp_path, {"sideslip_drag": {"k": 2.5}})
    summary, effects = run(folder), effects_of(folder)
    assert summary["verdict"] == effects["verdict"] == "found" and "failure" not in summary
    (effect,) = effects["effects"]
    size = effect["parameters"]["k"]
    assert effect["name"] == "sideslip_drag" and abs(size["value"] - 2.5) < 3.5 * size["std"] and size["std"] < 0.1
    kite = read_kite(folder / "out" / "trace-residual" / "kite.yaml")
    assert "sideslip_drag" in kite.effects and kite.table()["sideslip_drag.k"].value == pytest.approx(size["value"])
    metrics = read_json(folder / "out" / "trace-residual" / "metrics.json")
    assert metrics["outcome"] == "found"
    assert metrics["before"]["nrmse"]["test"]["mean"] == effects["error"]["before"]["mean"]
    assert metrics["nrmse"]["test"]["mean"] == effects["error"]["after"]["mean"] < 0.6 * effects["error"]["before"]["mean"]
    assert sum(effects["probability"].values()) == pytest.approx(1.0) and effects["probability"]["sideslip_drag"] > 0.9
    rows = {row["name"]: row for row in effects["criteria"]}
    assert rows["null_as_identified"]["pass"] and isinstance(rows["null_as_identified"]["value"], float)


def test_without_a_verdict_what_predicts_better_is_handed_on(tmp_path, monkeypatch):
    """Guards measured flights: a trace that could not judge (here: is told that it could not) still says with what unseen flight is
    predicted better, and how much; the kite file and the parameters have it, the stage is no failure, and evaluate's page says it first."""
    folder = folder_of(tmp_path, {"sideslip_drag": {"k": 2.5}})

    def without_a_verdict(frame, null, keys, **how):
        found = tracing.investigate(frame, null, keys, **how)
        table = tuple(replace(c, passed=False) if c.name == "null_converged" else c for c in found.table)
        return replace(found, verdict="not_testable", table=table, model=null)

    monkeypatch.setattr("awescli.tracing.flight.investigate", without_a_verdict)
    off = InstrumentError("heading_bias", "b", 0.0, 0.05, 0.004, "rad", 0.026)
    monkeypatch.setattr("awescli.tracing.flight.instrument_errors", lambda *which, **how: (off, replace(off, size=0.01)))
    summary, effects = run(folder), effects_of(folder)
    assert summary["verdict"] == effects["verdict"] == "not_testable" and "failure" not in summary and effects["effects"] == []
    (better,) = effects["by_prediction"]["effects"]
    size = better["parameters"]["k"]
    assert better["name"] == "sideslip_drag" and abs(size["value"] - 2.5) < 4 * size["std"] and not better["rivals"]
    assert better["after"] < 0.7 * better["before"] and effects["error"]["after"]["mean"] < 0.7 * effects["error"]["before"]["mean"]
    assert effects["by_prediction"]["chi2"]["after"] == effects["chi2"]["validation_after"] < effects["chi2"]["validation_before"]
    assert any(line.startswith("predicts unseen flight better: sideslip_drag on coefficients, k 2.") for line in summary["answer"])
    told = "beside gusts and model error: heading_bias, b = 0.05 +- 0.0078 rad (95 %)"
    assert told in summary["answer"] and [e["found"] for e in effects["instruments"]] == [True, False]
    kite, params = (folder / "out" / "trace-residual" / n for n in ("kite.yaml", "params.json"))
    known = read_json(params)["parameters"]["sideslip_drag.k"]
    assert read_kite(kite).table()["sideslip_drag.k"].value == pytest.approx(size["value"]) and known["std"] == size["std"]
    plan = read_plan(folder / "stages.yaml", STAGES, {"out": str(folder / "out"), "evaluate.horizon": "2.0", "evaluate.horizons": "[1.0]"})
    run_plan(plan, STAGES, only=["evaluate"])
    page = (folder / "out" / "evaluate" / "report.html").read_text()
    assert "predicted better with sideslip drag" in page and "says of its instruments: heading_bias, b = 0.05" in page


def test_nothing_is_found_where_nothing_is_missing(tmp_path):
    """Guards `none`: no effect, the kite file as identified, and what would have been seen."""
    folder = folder_of(tmp_path, {})
    summary, effects = run(folder), effects_of(folder)
    assert summary["verdict"] == effects["verdict"] == "none" and effects["effects"] == []
    assert effects["kinematics"] == [] and "kinematics alone" not in summary
    assert effects["error"]["after"] == effects["error"]["before"] and set(summary["would have been seen from"]) >= {"sideslip_drag"}
    assert max(effects["probability"], key=effects["probability"].get) == "none"
    identified, traced = (read_kite(folder / "out" / s / "kite.yaml") for s in ("identify", "trace-residual"))
    assert traced.effects == identified.effects


def test_kinematics_alone_stands_beside_the_verdict(tmp_path):
    """Guards A15: a position that is late is plain without any model of forces; the verdict of the candidates here knows nothing of it."""
    folder = folder_of(tmp_path, {"position_latency": {"tau": 0.24}})
    summary = run(folder)
    (seen,) = effects_of(folder)["kinematics"]
    assert (seen["name"], seen["acts_on"], seen["unit"]) == ("position_latency", "", "s") and seen["channels"] == ["p_n", "p_e", "p_d"]
    assert abs(seen["size"] - 0.24) < max(4 * seen["std"], 0.002)
    assert summary["kinematics alone"] == seen["sentence"] and seen["sentence"].startswith("position late by 0.24")
    assert any(line.startswith("kinematics alone: position late by 0.24") for line in summary["answer"])


def test_a_kite_that_cannot_fly_the_flight_is_a_named_failure(tmp_path):
    """Guards A2: where the model diverges, artifacts say `not_testable` without an error "before", the kite is identify's, and the command
    ends as a numerical failure, again when nothing has changed."""
    folder = folder_of(tmp_path, {}, {"Cma": -8.0, "Cmq": -8.0}, 32.0)
    for _ in range(2):
        with pytest.raises(NumericalFailure, match="there is no model to trace") as told:
            run(folder)
        assert told.value.exit_code == 3 and told.value.outcome == "not_testable"
        effects = effects_of(folder)
        assert effects["verdict"] == "not_testable" and effects["reason"] and "before" not in effects["error"] and not effects["effects"]
        assert any(row["pass"] is False for row in effects["criteria"] if row["name"].startswith("null_"))
        files = [(folder / "out" / s / "kite.yaml").read_text() for s in ("identify", "trace-residual")]
        assert files[0] == files[1]
