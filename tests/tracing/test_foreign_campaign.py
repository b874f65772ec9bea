"""The foreign campaign beside its flights: cases, what counts as right, the table, resuming."""

import json

import pytest
from campaign import commit, result_file
from foreign_campaign import cases, main, scored, table, truth_of
from foreign_kinds import Kind, read_kinds
from pydantic import ValidationError

from awescli.physics.effects import EFFECTS


def result(kind: str, verdict: str, *effects, size="full", air="calm", family=0):
    keys = [f"{n}:{a}" if a in ("rudder", "rates") else n for n, a in effects]
    entries = [{"name": n, "acts_on": a, "rivals": []} for n, a in effects]
    return {
        "case": f"{family}/{kind}", "kind": kind, "size": size, "air": air, "family": family, "commit": "abc1234", "verdict": verdict,
        "effects": entries, "probability": {**dict.fromkeys(keys, 0.9), "none": 0.02, "something_else": 0.08},
        "chi2": {"train_before": 2.0, "train_after": 1.0}, "unexplained": None, "wall_s": 8.0,
    }  # fmt: skip


def test_every_kind_is_flown_once_and_clean_ones_at_one_size(tmp_path):
    kinds = read_kinds()
    every = cases((0, 1), kinds, ("full", "half"), "calm", 1, tmp_path, "abc1234")
    clean = sum(kind.group == "clean" for kind in kinds.values())
    assert len(every) == 2 * (clean + 2 * (len(kinds) - clean))
    assert sum(not name.startswith("1/") for name in every) >= 60  # of one family, and it has more than 20 kinds


def test_what_is_right_follows_the_registry_and_the_library_of_the_code():
    """An effect whose name the code does not know is outside of its library; once it has the file, the name is asked for."""
    assert truth_of(result("actuator_lag", "")).answers == ("actuator_lag:rudder",)
    assert truth_of(result("tail_ice", "")).group == "outside" and truth_of(result("clean_field", "")).gusty
    assert truth_of(result("airspeed_scale", "", air="gusts")).gusty
    for name, kind in read_kinds().items():
        if kind.group == "library":
            known = all(a.partition(":")[0] in EFFECTS for a in kind.answers)
            assert truth_of(result(name, "")).group == ("library" if known else "outside")


def test_outcomes_of_made_up_answers():
    assert scored(result("actuator_lag", "found", ("actuator_lag", "rudder"))) == "right"
    assert scored(result("actuator_lag", "found", ("actuator_lag", "rudder"), ("mass_offset", "body"))) == "wrong"
    assert scored(result("tail_ice", "unexplained")) == "right" and scored(result("clean_calm", "unexplained")) == "false alarm"
    assert scored(result("clean_gusts", "not_deterministic")) == "right" and scored(result("clean_calm", "failed")) == "failed"


def test_the_table_counts_exactly_and_names_the_commit():
    results = [
        result("actuator_lag", "found", ("actuator_lag", "rudder")), result("heading_bias", "found", ("imu_bias", "rates")),
        result("tail_ice", "unexplained", family=2), result("clean_calm", "none"),
    ]  # fmt: skip
    text = table(results, "Agreement first.")
    assert "traced by commit abc1234" in text and "families 0 (development), 2 of seeds" in text and "Agreement first." in text
    assert "| library, full, calm | 2 | 1 |  |  |  |  | 1 |  |" in text
    assert "expected calibration error" in text and "Brier score" in text
    assert "| library: heading_bias, full, calm | 1 |  |  |  |  |  | 1 |  |" in text
    assert "| 0/heading_bias | a compass that is mounted beside the axis | wrong | found | imu_bias:rates | 0.90 | 2.000 -> 1.000 |" in text


def test_kept_answers_make_the_table_without_flying(tmp_path, monkeypatch, capsys):
    """A campaign whose flights are all answered flies nothing, and its answers are lines of JSON."""
    import foreign_campaign

    monkeypatch.setattr(foreign_campaign, "RESULTS", tmp_path / "foreign")
    monkeypatch.setattr(foreign_campaign, "agreement_line", lambda: "Agreement first.")
    folder = tmp_path / "foreign" / commit()
    folder.mkdir(parents=True)
    kept = result("clean_calm", "none") | {"case": "7/clean_calm-full-calm-0", "family": 7}
    result_file(folder, kept["case"]).write_text(json.dumps(kept))
    assert main([str(tmp_path / "cache"), "--families", "7", "--kinds", "clean_calm", "--jobs", "0"]) == 0
    assert "1 cases, 1 done before" in capsys.readouterr().out and not (tmp_path / "cache").exists()
    assert "| clean | 1 | 1 |" in (tmp_path / "foreign.md").read_text()
    assert all("\n" not in file.read_text() for file in folder.iterdir())


def test_a_kind_that_does_not_say_what_is_right_is_refused():
    with pytest.raises(ValidationError, match="names its right answers"):
        Kind(group="library", lacks="a lag", strengths={"tau": 0.1})
    with pytest.raises(ValidationError, match="has strengths"):
        Kind(group="outside", lacks="something")
    with pytest.raises(ValidationError, match="Extra inputs"):
        Kind(group="clean", lacks="nothing", wrld={})


def test_the_commit_is_that_of_the_repository():
    assert commit() == "unknown" or len(commit().rstrip("+")) >= 7
