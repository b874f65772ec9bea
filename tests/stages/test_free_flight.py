"""A flight without a tether, under power, through the stages: read, checked, identified, traced, evaluated, flown on its own."""

import pytest
from free_flight import THOR, free_flight, umn_struct
from scipy.io import savemat

from awescli.artifacts import read_json
from awescli.flightlog.read import missing_for_model, read_flight
from awescli.notation.errors import BadInput
from awescli.notation.parameters import ParameterTable
from awescli.physics.declaration import KiteDeclaration, kite_text, read_kite
from awescli.physics.kite import candidates
from awescli.stages import STAGES
from awescli.stages.plan import read_plan
from awescli.stages.runner import run_plan

PLAN = """
flight: flight
kite: kite.yaml
out: out
split: {train: 0.5, validation: 0.25, test: 0.25, order: interleaved}
stages:
  identify: {horizon: 2.0, curriculum: []}
  trace-residual: {horizon: 2.0, curriculum: [], candidates: ["airspeed_scale", "actuator_lag:throttle", "heading_bias"]}
  train-hybrid: {horizons: [0.5], hidden: [4], batch: 8, rounds: 1, patience: 1, budget: 5.0}
  simulate: {surfaces: recorded, duration: 5.0}
  evaluate: {horizon: 2.0, horizons: [1.0, 2.0], report: true}
"""

WRONG = {"CL_alpha": 0.8, "Cm_alpha": 1.3, "Cm_de": 0.8, "Cl_da": 0.8, "Cn_beta": 1.3, "thrust.scale": 0.85}
"""Declared values over the true ones."""
SCALE = 0.93


def wrongly_declared() -> KiteDeclaration:
    table = THOR.table()
    return THOR.with_parameters(ParameterTable(table.with_values({n: k * table[n].value for n, k in WRONG.items()}).rows))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two minutes of Thor in the Minnesota layout, with a pitot that reads 7 % low and a kite file that is 15 to 30 % off."""
    path = tmp_path_factory.mktemp("free")
    (path / "flight").mkdir()
    struct = umn_struct(free_flight(seconds=120.0, seed=3))
    struct["ias"] = SCALE * struct["ias"]
    savemat(path / "flight" / "flight.mat", {"flight_data": struct})
    (path / "kite.yaml").write_text(kite_text(wrongly_declared()))
    (path / "stages.yaml").write_text(PLAN)
    run_plan(read_plan(path / "stages.yaml", STAGES, {}), STAGES)
    return path / "out"


def test_derivatives_come_back(folder):
    """Guards the whole chain on truth: with the scale of the airspeed traced, what was flown comes back; and already beside its drift
    no moment has to stand in for the dynamic pressure (1 / 0.93^2)."""
    rows = read_json(folder / "identify" / "params.json")["parameters"]
    traced, truth = read_kite(folder / "trace-residual" / "kite.yaml").table(), THOR.table()
    for name in ("CL_alpha", "Cm_alpha", "Cm_de", "Cm_q", "Cl_da", "Cl_p", "Cn_beta"):
        true = truth[name].value
        assert abs(traced[name].value - true) < 0.06 * abs(true), (name, traced[name].value, true)
        assert name not in WRONG or abs(traced[name].value - true) < 0.4 * abs(WRONG[name] - 1) * abs(true), name
    assert abs(rows["Cl_da"]["value"] / truth["Cl_da"].value - 1) < 0.5 * (1 / SCALE**2 - 1)
    metrics = read_json(folder / "identify" / "metrics.json")
    assert metrics["nrmse"]["test"]["mean"] < 0.6 * metrics["initial"]["nrmse"]["test"]["mean"]


def test_the_pitot_is_traced(folder):
    """Guards tracing without loops and without a line: the undeclared scale is named, with its size."""
    effects = read_json(folder / "trace-residual" / "effects.json")
    assert effects["verdict"] == "found" and effects["effects"][0]["name"] == "airspeed_scale"
    s = effects["effects"][0]["parameters"]["s"]
    assert abs(s["value"] - SCALE) < max(4 * s["std"], 0.02)
    assert effects["error"]["after"]["mean"] <= effects["error"]["before"]["mean"]


def test_every_stage_runs_and_tells_of_blocks(folder):
    """Guards the page and the rest: no winch where there is none, a log of the simulated flight that is a free flight again."""
    page = (folder / "evaluate" / "report.html").read_text()
    assert "no tether: " in page and "blocks of" in page and "above the winch" not in page
    metrics = read_json(folder / "evaluate" / "metrics.json")
    assert metrics["with_effects"]["nrmse"]["test"]["mean"] <= metrics["initial"]["nrmse"]["test"]["mean"]
    assert "tension" not in metrics["initial"]["nrmse"]["test"]
    again = read_flight(folder / "simulate" / "flight")
    assert missing_for_model(again, ("throttle",)) == [] and not again.on_line and "throttle" in again
    assert "tether_length" not in read_json(folder / "train-hybrid" / "network.json")["inputs"]


def test_nothing_of_a_line_is_a_candidate():
    """Guards the library: a kite that flies free is asked for no line, one without a motor for no throttle."""
    keys = candidates(THOR, ["V_a", "alpha", "beta"], ["aileron", "elevator", "rudder", "throttle"])
    assert "actuator_lag:throttle" in keys and "airspeed_scale" in keys
    assert not any(k.startswith(("tether", "winch", "load_cell", "clock")) for k in keys)
    gliding = THOR.model_copy(update={"effects": ("gravity", "aerodynamics")})
    assert not any(k.endswith(":throttle") for k in candidates(gliding, ["V_a"], ["aileron", "throttle"]))


def test_a_missing_throttle_is_one_clear_error(tmp_path):
    """Guards the message that a powered kite's stage gives: what is missing, in which flight, and where to look."""
    (tmp_path / "flight").mkdir()
    struct = umn_struct(free_flight(seconds=40.0, noise=False))
    del struct["dthr"]
    savemat(tmp_path / "flight" / "flight.mat", {"flight_data": struct})
    (tmp_path / "kite.yaml").write_text(kite_text(THOR))
    (tmp_path / "stages.yaml").write_text(PLAN)
    with pytest.raises(BadInput, match="lacks what a model needs: throttle") as told:
        run_plan(read_plan(tmp_path / "stages.yaml", STAGES, {}), STAGES, only=["identify"])
    assert told.value.exit_code == 2 and not (tmp_path / "out" / "identify").exists()
