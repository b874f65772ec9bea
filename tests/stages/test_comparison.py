"""Two runs side by side: what differs is found, what does not is not, whatever it is."""

import json

import pytest
from stages.dummy_stages import DUMMIES, make_folder
from typer.testing import CliRunner

from awescli.artifacts import read_json, write_json
from awescli.cli import build_app
from awescli.notation.errors import BadInput
from awescli.stages.comparison import compare


@pytest.fixture
def runs(tmp_path, monkeypatch):
    """Two finished runs with different settings, called one and two."""
    make_folder(tmp_path)
    monkeypatch.chdir(tmp_path)
    for name, horizon in (("one", "5.0"), ("two", "4.0")):
        assert awes("run", "--set", f"out={name}", "--set", f"identify.horizon={horizon}").exit_code == 0
    return tmp_path / "one", tmp_path / "two"


def awes(*arguments):
    return CliRunner().invoke(build_app(DUMMIES), list(arguments))


def scores(mean: float, **more) -> dict:
    return {"horizon_s": 5.0, "identified": {"nrmse": {"test": {"mean": mean}}}, **more}


def test_a_run_equals_itself(runs):
    found = compare(runs[0], runs[0], DUMMIES)
    assert not found.differences and not found.made_from and found.same > 0
    assert "0 values differ" in awes("compare", "one", "one").stdout


def test_settings_and_numbers_that_differ_are_named(runs):
    found = compare(*runs, DUMMIES)
    assert found.made_from == {"identify": ["setting horizon changed 5.0 -> 4.0"]}
    assert [(d.where, d.a, d.b) for d in found.differences if "params" in d.where] == [("identify/params.json: horizon", 5.0, 4.0)]


def test_largest_changes_come_first_and_small_ones_may_count_as_equal(runs):
    write_json(runs[0] / "evaluate" / "metrics.json", scores(0.02, a=1.0, b=100.0, only_here=3, seconds=1.0, verdict="none"))
    write_json(runs[1] / "evaluate" / "metrics.json", scores(0.01, a=-1.0, b=100.1, seconds=9.0, verdict="found"))
    found = compare(*runs, DUMMIES)
    mine = [d.where.split(": ")[1] for d in found.differences if d.where.startswith("evaluate")]
    assert mine == ["a", "verdict", "identified.nrmse.test.mean", "b", "only_here"]
    assert found.errors == {"identified": (0.02, 0.01)}
    assert "b" not in [d.where.split(": ")[1] for d in compare(*runs, DUMMIES, tolerance=0.01).differences]
    shown = awes("compare", "one", "two", "--most", "2").stdout
    assert "identified" in shown and "0.5" in shown and "\x1b" not in shown and "only_here" not in shown


def test_entries_of_lists_are_known_by_their_names(runs):
    for run, order in zip(runs, (["lag", "delay"], ["delay", "lag"]), strict=True):
        ranking = [{"name": n, "acts_on": "rudder", "score": 1.0 if n == "lag" else 2.0} for n in order]
        write_json(
            run / "evaluate" / "metrics.json",
            {"ranking": ranking, "history": {"columns": ["cost", "seconds"], "rows": [[1.0, len(order[0])]]}},
        )
    assert not [d for d in compare(*runs, DUMMIES).differences if d.where.startswith("evaluate")]


def test_a_stage_that_one_run_lacks_is_said(runs):
    import shutil

    shutil.rmtree(runs[1] / "evaluate")
    found = compare(*runs, DUMMIES)
    assert found.only == {str(runs[0]): ["evaluate"], str(runs[1]): []} and "only in one: evaluate" in awes("compare", "one", "two").stdout


def test_json_holds_all_differences(runs):
    answer = json.loads(awes("compare", "one", "two", "--json").stdout)
    assert {d["where"] for d in answer["differences"]} == {d.where for d in compare(*runs, DUMMIES).differences}
    assert read_json(runs[0] / "identify" / "params.json", any_form=True)["horizon"] == 5.0  # nothing was written


def test_what_is_no_run_is_an_error(runs, tmp_path):
    for folder, told in ((tmp_path / "none", "no such folder"), (tmp_path, "no results of awes")):
        with pytest.raises(BadInput, match=told):
            compare(runs[0], folder, DUMMIES)
        result = awes("compare", str(runs[0]), str(folder))
        assert result.exit_code == 2 and told in result.stderr
    awes("run")
    with pytest.raises(BadInput, match="Did you mean its folder 'out'"):
        compare(tmp_path, runs[0], DUMMIES)


def traced(verdict: str, *effects: tuple[str, float]) -> dict:
    sized = [{"name": n, "acts_on": "rudder", "parameters": {"tau": {"value": v, "std": 0.01, "unit": "s"}}} for n, v in effects]
    ranking = [{"name": n, "acts_on": "rudder", "score": v, "plausible_size": v > 0.2} for n, v in effects]
    return {"verdict": verdict, "effects": sized, "ranking": ranking}


def test_verdicts_effects_and_errors_come_first_and_advice_never(runs):
    """What an engineer asks of two runs: which conclusion, how large, how good; then numbers; flags that follow from them stay out."""
    write_json(runs[0] / "trace-residual" / "effects.json", traced("found", ("actuator_lag", 0.201)))
    write_json(runs[1] / "trace-residual" / "effects.json", traced("cannot_tell", ("actuator_lag", 0.195), ("actuator_delay", 0.12)))
    for run, value, flag in ((runs[0], 1.0, True), (runs[1], 2.0, False)):
        row = {"value": value, "excited": flag, "at_bound": not flag, "partners": ["Cb"] if flag else ["Cc"], "advice": f"move it {value}"}
        write_json(run / "identify" / "params.json", {"parameters": {"Ca": row}})
        write_json(run / "evaluate" / "metrics.json", scores(0.01 * value, outcome="scored" if flag else "1 of 9 predictions diverged"))
    found = compare(*runs, DUMMIES)
    assert found.verdicts == {"trace-residual": ("found", "cannot_tell"), "evaluate": ("scored", "1 of 9 predictions diverged")}
    assert found.effects["actuator_lag on rudder, tau"] == ("0.201 s [0.181, 0.221]", "0.195 s [0.175, 0.215]")
    assert found.effects["actuator_delay on rudder, tau"][0] is None
    shown = awes("compare", "one", "two").stdout
    order = ("cannot_tell", "0.201 s [0.181, 0.221]", "mean error", "identify/params.json: parameters.Ca.value")
    places = [shown.index(text) for text in order]
    assert places == sorted(places)
    assert not [word for word in ("excited", "at_bound", "partners", "advice", "plausible_size", "move it") if word in shown]
    assert max(map(len, shown.splitlines())) <= 80
    answer = json.loads(awes("compare", "one", "two", "--json").stdout)
    assert any("excited" in d["where"] for d in answer["differences"])  # --json has all
