"""identify from a plan: two flights of one kite in one fit, and what is refused."""

import pytest
from flightlog.synthetic import write_folder
from kites import DEVELOPMENT, flight

from awescli.artifacts import read_json
from awescli.notation.errors import BadInput
from awescli.physics.declaration import kite_text
from awescli.stages import STAGES
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


def test_several_starts_reach_one_optimum(folder):
    """Guards `starts`: the draws of the prior are reported with the optimum they reach, the same again for the same seed."""
    _, metrics = identify(folder, "starts", starts="2", curriculum="[0.5, 1.0]")
    said = metrics["starts"]
    assert said["starts"] == 2 and len(said["cost_above_best"]) == 2 and min(said["cost_above_best"]) == 0
    assert said["same_optimum"] == 2 and said["largest_distance_within_optimum_std"] < 0.5


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"per_flight": "[dl]"}, "only one flight"),
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
