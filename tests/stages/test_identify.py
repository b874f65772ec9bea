"""identify from a plan: two flights of one kite in one fit, and what is refused."""

from dataclasses import fields
from types import SimpleNamespace

import pytest
from flightlog.synthetic import write_folder
from kites import DEVELOPMENT, flight

from awescli.artifacts import read_json
from awescli.control.path_following import PathFollowing
from awescli.notation.errors import BadInput
from awescli.physics.declaration import kite_text, read_kite
from awescli.simulation.synthetic import with_effects
from awescli.stages import STAGES, controller_artifact
from awescli.stages.base import Inputs, Split
from awescli.stages.flight_parts import score_parts
from awescli.stages.identify import IdentifyConfig, flown, tell
from awescli.stages.plan import read_plan
from awescli.stages.runner import run_plan

PLAN = """
flight: a
kite: kite.yaml
out: out
split: {train: 0.5, validation: 0.25, test: 0.25}
stages:
  identify: {horizon: 2.0, curriculum: []}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A plan, and two noisy flights of the development kite: one with a wind record over height, one with a single station."""
    path = tmp_path_factory.mktemp("identify")
    for name, seed, air in (("a", 1, "table"), ("b", 2, "power")):
        found = flight(seed=seed, duration=50.0, noise=True, air=air)
        write_folder(path / name, found.log)
        (path / f"kite_{name}.yaml").write_text(kite_text(found.declared))
    (path / "kite.yaml").write_text((path / "kite_a.yaml").read_text())
    (path / "stages.yaml").write_text(PLAN)
    return path


def identify(folder, out, **overrides):
    settings = {"out": str(folder / out), **{f"identify.{k}": v for k, v in overrides.items()}}
    plan = read_plan(folder / "stages.yaml", STAGES, settings)
    run_plan(plan, STAGES, only=["identify"])
    return read_json(folder / out / "identify" / "params.json"), read_json(folder / out / "identify" / "metrics.json")


def test_a_second_flight_with_its_own_offset(folder):
    """Guards `also` and `per_flight` from the YAML to params.json: values of each flight, one shared kite, errors of both flights."""
    also = f"[{{flight: {folder}/b, kite: {folder}/kite_b.yaml}}]"
    alone, _ = identify(folder, "alone")
    both, metrics = identify(folder, "both", also=also, per_flight="[dl]")
    rows = both["parameters"]
    assert rows["dl"]["flight"] == "a" and rows["dl@b"]["flight"] == "b" and "flight" not in rows["CLa"]
    assert {n for n in rows if "@" in n} == {"dl@b"} and all("@b" in n or r["flight"] == "a" for n, r in both["wind_record_error"].items())
    truth = DEVELOPMENT.table()
    for name in ("dl", "dl@b", "CLa", "CD0", "CtD"):
        assert abs(rows[name]["value"] - truth[name.partition("@")[0]].value) < 4 * rows[name]["std"], name
    shrunk = [rows[n]["std"] / r["std"] for n, r in alone["parameters"].items() if r["excited"] and n != "dl"]
    assert max(shrunk) < 1.02 and sum(shrunk) / len(shrunk) < 0.85
    assert set(metrics["flights"]) == {"a", "b"} and metrics["nrmse"] == metrics["flights"]["a"]["nrmse"]
    for scored in metrics["flights"].values():
        assert scored["nrmse"]["test"]["mean"] < 0.5 * scored["initial"]["nrmse"]["test"]["mean"]


def test_a_fit_may_begin_in_gusts(folder):
    """Guards `air: gusts` from the YAML to params.json: in calm air nothing stays of what was open, and parameters are the truth."""
    params, metrics = identify(folder, "gusts", air="gusts")
    assert metrics["method"] == "filter error" and set(metrics["processes"]) <= {"wind record"}
    assert 0.9 < metrics["chi2"] < 1.1
    for name in ("CLa", "CD0", "CtD"):
        row = params["parameters"][name]
        assert abs(row["value"] - DEVELOPMENT.table()[name].value) < 4 * row["std"], name


def test_several_starts_reach_one_optimum(folder):
    """Guards `starts`: the draws of the prior are reported with the optimum they reach, the same again for the same seed."""
    _, metrics = identify(folder, "starts", starts="2", curriculum="[0.5, 1.0]")
    said = metrics["starts"]
    assert said["starts"] == 2 and len(said["cost_above_best"]) == 2 and min(said["cost_above_best"]) == 0
    assert said["same_optimum"] == 2 and said["largest_distance_within_optimum_std"] < 0.5


def test_a_start_counts_for_one_optimum_only():
    """Guards what is said of several starts: one that led to the best optimum (3 above it, which is within) is none of "others that are
    worse", and one that ended elsewhere for good is."""
    notes = []
    starts = {"starts": 4, "same_optimum": 2, "cost_above_best": [0.0, 3.0, 50.0, 80.0], "outcomes": [*["converged"] * 3, "no_progress"]}
    tell(SimpleNamespace(note=notes.append), {"parameters": {}, "constraints": [], "common_factors": []}, {"starts": starts})
    assert notes == ["2 of 4 starts led to the best optimum, 1 to others that are worse"]


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"per_flight": "[dl]"}, "only one flight"),
        ({"air": "gusts", "weights": "range"}, "gusts need errors that are weighed by their noise"),
        ({"per_flight": "[dx]", "also": "[{{flight: {0}/b, kite: {0}/kite_b.yaml}}]"}, "no free parameter is called 'dx'"),
        ({"also": "[{{flight: {0}/b, kite: {0}/other.yaml}}]"}, "its effects differ"),
        ({"also": "[{{fligth: {0}/b}}]"}, "unknown key"),
        ({"also": "[{{flight: {0}/nowhere}}]"}, "nowhere"),
    ],
)
def test_what_cannot_be_fitted_together_is_refused(folder, settings, words):
    """Guards the messages: what is wrong, and where."""
    declared = DEVELOPMENT.model_copy(update={"effects": (*DEVELOPMENT.effects[:-1], "sideslip_drag", "tether")})
    (folder / "other.yaml").write_text(kite_text(declared))
    with pytest.raises(BadInput, match=words):
        identify(folder, "refused", **{k: v.format(folder) if "{{" in v else v for k, v in settings.items()})
    assert not (folder / "refused" / "identify").exists()


class Late(PathFollowing):
    """The law that flew, as fit-controller would describe it: its set-points act 0.15 s late."""

    surfaces, rate_limits, delay_s = ("rudder",), {}, 0.15


@pytest.fixture
def late_flight(tmp_path, monkeypatch):
    """(what a stage knows, law -> the fitted controller is this one) of a flight whose rudder acts 0.15 s after its set-point."""
    found = flight(seed=1, duration=50.0, effects=(("actuator_delay:rudder", (("tau", 0.15),)),))
    write_folder(tmp_path / "late", found.log)
    law = Late(**{f.name: getattr(found.law, f.name) for f in fields(found.law)})
    (tmp_path / "kite.yaml").write_text(kite_text(DEVELOPMENT))
    inputs = Inputs(tmp_path / "late", tmp_path / "kite.yaml", Split(train=0.5, validation=0.25, test=0.25))
    context = SimpleNamespace(flight=tmp_path / "late", upstream=lambda _: tmp_path, made_by=lambda _: tmp_path, inputs=inputs)

    def fitted(law):
        monkeypatch.setattr(controller_artifact, "read_controller", lambda _: law)

    fitted(law)
    return context, law, fitted


def test_the_loop_is_closed_through_the_controllers_own_delay(late_flight):
    """With the true kite, closed-loop predictions of a flight whose rudder acts late are right where the fitted law says so, only there."""
    context, law, fitted = late_flight
    config, errors = IdentifyConfig(surfaces="controller", horizon=5.0), {}
    for kind in (Late, PathFollowing):
        fitted(kind(**{f.name: getattr(law, f.name) for f in fields(law)}))
        (only,) = flown(context, config, DEVELOPMENT)
        errors[kind] = score_parts(only.problem.simulator, only.problem.log, only.problem.split, 5.0)["nrmse"]["train"]["mean"]
    assert errors[Late] < 0.01 and errors[PathFollowing] > 3 * errors[Late], errors


def test_a_free_delay_behind_the_controllers_own_is_refused(late_flight):
    context, _, _ = late_flight
    own = with_effects(DEVELOPMENT, {"actuator_delay:rudder": {"tau": 0.03}})
    name = "actuator_delay:rudder.tau"
    free = own.model_copy(update={"parameters": own.parameters | {name: own.parameters[name].model_copy(update={"free": True})}})
    with pytest.raises(BadInput, match=f"'{name}' is free.*delayed or limited"):
        flown(context, IdentifyConfig(surfaces="controller"), free)
    assert flown(context, IdentifyConfig(surfaces="controller"), own)


def test_what_is_handed_on_is_the_kite_without_the_controllers_delay(folder, late_flight):
    """From the plan: identify and train-hybrid close the loop through the delay, and write the kite that was declared."""
    context, _, _ = late_flight
    settings = {
        "flight": str(context.flight), "out": str(folder / "late"), "fit-controller.kind": "linear", "fit-controller.folds": "3",
        "identify.surfaces": "controller", "train-hybrid.surfaces": "controller", "train-hybrid.hidden": "[3]",
        "train-hybrid.budget": "5.0", "train-hybrid.horizons": "[0.5]", "train-hybrid.rounds": "1", "train-hybrid.warmup": "0.5",
    }  # fmt: skip
    plan = read_plan(folder / "stages.yaml", STAGES, settings)
    run_plan(plan, STAGES, only=["fit-controller", "identify", "train-hybrid"])
    declared = read_kite(folder / "kite.yaml")
    for stage in ("identify", "train-hybrid"):
        written = read_kite(folder / "late" / stage / "kite.yaml")
        assert written.effects == declared.effects and set(written.parameters) == set(declared.parameters)
    metrics = read_json(folder / "late" / "identify" / "metrics.json")
    assert metrics["surfaces"] == "controller" and metrics["nrmse"]["test"]["mean"] < metrics["initial"]["nrmse"]["test"]["mean"]
