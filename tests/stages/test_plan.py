"""stages.yaml -> Plan."""

from pathlib import Path

import pytest
from stages.dummy_stages import DUMMIES, PLAN, make_folder

from awescli.notation.document import read_document
from awescli.notation.errors import BadInput, BadInputs
from awescli.stages.plan import plan_model, read_plan
from awescli.stages.starter import plan_schema, starter_text


def test_a_plan_with_defaults(tmp_path):
    file = make_folder(tmp_path)
    plan = read_plan(file, DUMMIES)
    assert (plan.flight, plan.kite, plan.out, plan.seed) == (tmp_path / "flight", tmp_path / "kite.yaml", tmp_path / "out", 0)
    assert (plan.split.train, plan.split.validation, plan.split.test, plan.split.order) == (0.5, 0.2, 0.3, "balanced")
    assert plan.planned == ("identify", "trace-residual", "evaluate")
    assert plan.settings["trace-residual"].count == 3


def test_stages_that_are_absent_are_not_planned_but_have_settings(tmp_path):
    file = make_folder(tmp_path)
    file.write_text("flight: flight\nkite: kite.yaml\nstages: {evaluate: {}, identify: }\n")
    plan = read_plan(file, DUMMIES, {"trace-residual.count": "5"})
    assert plan.planned == ("identify", "trace-residual", "evaluate")  # set on the command line: wanted
    plan = read_plan(file, DUMMIES)
    assert plan.planned == ("identify", "evaluate") and plan.settings["trace-residual"].count == 3
    file.write_text("flight: flight\nkite: kite.yaml\n")
    assert read_plan(file, DUMMIES).planned == ()


def test_errors_have_places(tmp_path):
    file = make_folder(tmp_path)
    file.write_text(PLAN.replace("horizon", "horizonn") + "split: {train: 0.9}\nsede: 1\n")
    with pytest.raises(BadInputs) as caught:
        read_plan(file, DUMMIES, {"identify.law": "exat"})
    assert {(e.where, e.do) for e in caught.value.errors} == {
        (f"{file}:4: identify.horizonn", "Did you mean 'horizon'?"),
        ("--set identify.law", "Did you mean 'exact'?"),
        (f"{file}:7: split", "Expected: split: how the flight's loops are divided: train, validation, test, order"),
        (f"{file}:8: sede", "Did you mean 'seed'?"),
    }


def test_inputs_must_exist(tmp_path):
    file = make_folder(tmp_path)
    with pytest.raises(BadInputs) as caught:
        read_plan(file, DUMMIES, {"flight": "nowhere", "kite": "flight"})
    assert [e.where for e in caught.value.errors] == ["--set flight", "--set kite"]
    for out, what in (("kite.yaml", "is a file"), ("flight", "own folder")):
        with pytest.raises(BadInput, match=what):
            read_plan(file, DUMMIES, {"out": str(tmp_path / out)})


def test_where_paths_lead(tmp_path, monkeypatch):
    file = make_folder(tmp_path / "project")
    (tmp_path / "here.yaml").write_text("x")
    (tmp_path / "project" / "there.yaml").write_text("x")
    monkeypatch.chdir(tmp_path)
    set_both = {"kite": "here.yaml", "identify.weights": "there.yaml", "out": "results"}
    plan = read_plan(Path("project/stages.yaml"), DUMMIES, set_both)
    assert (plan.kite, plan.out) == (Path("here.yaml"), Path("results"))  # from the current folder
    assert plan.settings["identify"].weights == Path("project/there.yaml")  # not here: from the plan's folder
    file.write_text(PLAN.replace("{horizon: 5.0}", "{weights: there.yaml}") + f"out: {tmp_path / 'o'}\n")
    plan = read_plan(file, DUMMIES)
    assert (plan.out, plan.settings["identify"].weights) == (tmp_path / "o", tmp_path / "project" / "there.yaml")


def test_the_starter_plan_is_good_with_and_without_its_comments():
    text = starter_text(DUMMIES, "a flight", "kite.yaml")
    plan = read_document(Path("s"), plan_model(DUMMIES), text)
    assert str(plan.flight) == "a flight" and len(plan.stages.model_fields_set) == 3
    setting = [line.replace("# ", "", 1) if line.lstrip().startswith("# ") and ":" in line else line for line in text.splitlines()[1:]]
    everything = "\n".join(line for line in setting if not line.startswith("Stages that") and line != "split:")
    assert read_document(Path("s"), plan_model(DUMMIES), everything) == plan


def test_schema_is_draft_7():
    import json

    schema = plan_schema(DUMMIES)
    text = json.dumps(schema)
    assert schema["$schema"].endswith("draft-07/schema#") and "$defs" not in text and "prefixItems" not in text
    assert set(schema["definitions"]["Stages"]["properties"]) == {s.name for s in DUMMIES}
    assert schema["required"] == ["kite"] and schema["oneOf"] == [{"required": ["flight"]}, {"required": ["flights"]}]
