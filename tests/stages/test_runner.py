"""What runs, what does not, and why."""

import os
import shutil
from pathlib import Path

import pytest
from stages.dummy_stages import DUMMIES, Judge, make_folder

import awescli
from awescli.artifacts import read_json, write_json
from awescli.notation.errors import BadInput, NumericalFailure
from awescli.stages import STAGES, runner
from awescli.stages.base import Silent
from awescli.stages.plan import read_plan
from awescli.stages.runner import run_plan


class Notes(Silent):
    def __init__(self):
        self.notes = []

    def note(self, text):
        self.notes.append(text)


@pytest.fixture
def file(tmp_path):
    return make_folder(tmp_path)


def go(file, *only, **options):
    notes = Notes()
    overrides = options.pop("overrides", {})
    results = run_plan(read_plan(file, DUMMIES, overrides), DUMMIES, only or None, progress=notes, **options)
    return {r.stage: r.reason for r in results}, notes.notes


UNCHANGED = {"identify": "unchanged", "trace-residual": "unchanged", "evaluate": "unchanged"}


def test_first_run_then_unchanged(file):
    # "upstream ran" is said only of what had been there before
    assert go(file)[0] == {"identify": "first run", "trace-residual": "first run", "evaluate": "first run"}
    out = file.parent / "out"
    assert sorted(os.listdir(out)) == [".awes", "evaluate", "identify", "trace-residual"]
    before = {p: p.read_bytes() for p in out.rglob("*.*") if p.is_file()}
    assert go(file)[0] == UNCHANGED
    assert {p: p.read_bytes() for p in out.rglob("*.*") if p.is_file()} == before
    assert read_json(out / "evaluate" / "metrics.json", any_form=True) == {"kite": "from: trace-residual 3\n"}
    provenance = read_json(out / "identify" / "provenance.json")
    assert provenance["stamp"]["settings"]["horizon"] == 5.0 and provenance["timing"]["duration_s"] >= 0
    assert set(provenance["stamp"]["inputs"]) == {"flight", "kite"} and "numpy" in provenance["versions"]


@pytest.mark.parametrize(
    "change, expected",
    [
        ("setting", "setting horizon changed 5.0 -> 4.0"),
        ("seed", "seed changed 0 -> 7"),
        ("split", "split train changed 0.5 -> 0.4; split validation changed 0.2 -> 0.3"),
        ("kite", "input kite changed"),
        ("flight", "input flight changed"),
        ("missing", "artifact params.json missing"),
        ("edited", "artifact params.json changed since it was written"),
        ("provenance", "provenance.json missing or not readable"),
        ("code", "code changed"),
        ("gone", "first run"),
    ],
)
def test_why_it_runs(file, change, expected, monkeypatch):
    go(file)
    out, overrides = file.parent / "out", {}
    if change == "setting":
        overrides = {"identify.horizon": "4.0"}
    elif change == "seed":
        overrides = {"seed": "7"}
    elif change == "split":
        overrides = {"split.train": "0.4", "split.validation": "0.3"}
    elif change == "kite":
        (file.parent / "kite.yaml").write_text("other")
    elif change == "flight":
        (file.parent / "flight" / "kite.csv").write_text("3")
    elif change == "missing":
        (out / "identify" / "params.json").unlink()
    elif change == "edited":
        (out / "identify" / "params.json").write_text("{}")
    elif change == "provenance":
        (out / "identify" / "provenance.json").write_text("{")
    elif change == "code":
        monkeypatch.setattr(runner, "code_hash", lambda: "other")
    elif change == "gone":
        shutil.rmtree(out / "identify")
    dry, _ = go(file, dry_run=True, overrides=overrides)
    reasons, _ = go(file, overrides=overrides)
    assert dry == reasons
    assert reasons["identify"] == expected
    assert reasons["trace-residual"] == "upstream identify ran"
    assert reasons["evaluate"] == "upstream identify, trace-residual ran"
    assert go(file, overrides=overrides)[0] == UNCHANGED


@pytest.mark.parametrize("name", ["page.js", "page.css", "fmi3.c"])
def test_a_change_of_any_file_of_the_package_is_a_change_of_code(name, tmp_path, monkeypatch):
    """Guards a stale report: the script of the page, its style, the C that is exported count as well as Python does; what an editor leaves
    does not."""
    source = Path(awescli.__file__).parent
    package = tmp_path / "awescli"
    shutil.copytree(source, package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(awescli, "__file__", str(package / "__init__.py"))
    before = runner.code_hash.__wrapped__()
    (file,) = package.rglob(name)
    (package / "page.js~").write_text("an editor's copy")
    assert runner.code_hash.__wrapped__() == before
    file.write_text(file.read_text() + " ")
    assert runner.code_hash.__wrapped__() != before


def test_force_and_from(file):
    go(file)
    assert set(go(file, force=True)[0].values()) == {"--force"}
    reasons, _ = go(file, begin="trace-residual")
    begun = "--from trace-residual"
    assert reasons == {"identify": f"before {begun}", "trace-residual": begun, "evaluate": begun}
    with pytest.raises(BadInput, match="Did you mean 'identify'"):
        go(file, begin="identfy")


def test_dry_run_touches_nothing(file):
    assert set(go(file, dry_run=True)[0].values()) == {"first run"}
    assert not (file.parent / "out").exists()


def test_one_stage_after_the_other(file):
    with pytest.raises(BadInput, match=f"Make it first: awes identify --stages {file}"):
        go(file, "trace-residual")
    go(file, "evaluate")
    metrics = file.parent / "out" / "evaluate" / "metrics.json"
    assert read_json(metrics, any_form=True)["kite"] == "from: declared\n"
    go(file, "identify")
    assert go(file, "evaluate")[0] == {"evaluate": "upstream identify changed"}
    assert read_json(metrics, any_form=True)["kite"] == "from: identify 5.0\n"
    go(file, "trace-residual")
    go(file, "evaluate")
    assert read_json(metrics, any_form=True)["kite"] == "from: trace-residual 3\n"


def test_a_model_older_than_what_it_was_made_from_is_not_used_silently(file):
    go(file)
    go(file, "identify", overrides={"identify.horizon": "4.0"})
    reasons, notes = go(file, "evaluate", overrides={"identify.horizon": "4.0"})
    assert notes == [
        "evaluate does without trace-residual: identify has changed since trace-residual ran. "
        f"To use it: awes trace-residual --stages {file}"
    ]
    assert reasons["evaluate"] == "upstream identify changed; upstream trace-residual is no longer used"
    assert read_json(file.parent / "out" / "evaluate" / "metrics.json", any_form=True)["kite"] == "from: identify 4.0\n"


def test_a_model_made_with_other_settings_is_used_but_not_silently(file):
    go(file)
    _, notes = go(file, "trace-residual", overrides={"identify.horizon": "4.0"})
    assert len(notes) == 1 and notes[0].startswith("identify was made before setting horizon changed 5.0 -> 4.0.")


def test_a_damaged_model_is_not_used(file):
    go(file)
    (file.parent / "out" / "identify" / "kite.yaml").write_text("x")
    with pytest.raises(BadInput, match="kite.yaml changed since it was written"):
        go(file, "trace-residual")


@pytest.mark.parametrize("end, error", [("diverge", NumericalFailure), ("fault", ZeroDivisionError), ("interrupt", KeyboardInterrupt)])
def test_a_stage_that_does_not_end_well_leaves_the_old_artifacts(file, end, error):
    go(file)
    out = file.parent / "out"
    before = {p: p.read_bytes() for p in out.rglob("*.*") if p.is_file()}
    with pytest.raises(error):
        go(file, overrides={"identify.end": end})
    after = {p: p.read_bytes() for p in out.rglob("*.*") if p.is_file() and "scratch" not in p.parts}
    assert after == before
    assert (out / ".awes" / "scratch" / "identify").exists() == (end == "interrupt")
    assert go(file)[0] == UNCHANGED


def test_a_stage_without_an_answer_leaves_artifacts_that_say_so(file):
    """Guards the named failure: what the stage wrote stands, the command ends with exit code 3 both when it runs and when nothing has
    changed, and no later stage runs on it."""
    out, overrides = file.parent / "out", {"identify.end": "no answer"}
    for reason in ("first run", "unchanged"):
        events = []
        with pytest.raises(NumericalFailure, match="the fit stalled") as told:
            go(file, overrides=overrides, report=lambda stage, event: events.append((stage, event)))  # noqa: B023
        assert told.value.exit_code == 3 and told.value.outcome == "stalled"
        assert [(s, e.reason) for s, e in events if not isinstance(e, str)] == [("identify", reason)]
        assert read_json(out / "identify" / "params.json", any_form=True) == {"horizon": 5.0, "seed": 0}
        assert sorted(os.listdir(out)) == [".awes", "identify"]
    assert go(file)[0]["identify"] == "setting end changed no answer -> good"


def test_an_interrupted_stage_continues_from_its_checkpoint(file, monkeypatch):
    overrides = {"identify.end": "interrupt"}
    with pytest.raises(KeyboardInterrupt):
        go(file, overrides=overrides)
    assert go(file, overrides=overrides)[1] == ["from step 2"]
    with pytest.raises(KeyboardInterrupt):
        go(file, overrides=overrides, force=True)
    assert go(file)[1] == ["from step 0"]  # other settings: not its checkpoint
    assert not (file.parent / "out" / ".awes" / "scratch" / "identify").exists()


def test_a_file_named_in_the_settings_is_an_input(file):
    (file.parent / "w").write_text("1")
    overrides = {"identify.weights": "w"}
    go(file, overrides=overrides)
    assert go(file, overrides=overrides)[0] == UNCHANGED
    (file.parent / "w").write_text("2")
    assert go(file, overrides=overrides)[0]["identify"].startswith("setting weights changed")


def test_stages_of_one_call_read_a_flight_once_unless_it_changes(file, monkeypatch):
    """Guards both: seconds for every stage of a long log, and a stage that would go on with what is no longer there."""
    logs = []

    def read(stage, inputs, plan):
        logs.append(vars(inputs).setdefault("log", object()))
        vars(inputs)["quality"] = None
        return []

    def touch(stage, event):
        if stage == "trace-residual" and not isinstance(event, str):
            next((file.parent / "flight").iterdir()).write_text("another\n")

    monkeypatch.setattr(runner, "refused", read)
    go(file, report=touch)
    identify, trace, evaluate = logs
    assert identify is trace and evaluate is not trace


def test_a_plan_without_stages(file):
    file.write_text("flight: flight\nkite: kite.yaml\n")
    with pytest.raises(BadInput, match="names no stages"):
        go(file)
    assert go(file, "identify")[0] == {"identify": "first run"}


def test_a_stage_that_does_not_write_what_it_promises(file, monkeypatch):
    monkeypatch.setattr(type(DUMMIES[0]), "makes", ("other.json",))
    with pytest.raises(RuntimeError, match="identify did not write other.json"):
        go(file)


def test_a_forced_run_that_was_interrupted_goes_on_where_it_stood(file):
    """--force and --from: stages finished before the interruption stand, the stage that it was in begins at its checkpoint; then the same
    command is a new run again."""
    overrides = {"trace-residual.count": "4"}
    for how in ({"force": True}, {"begin": "identify"}):
        go(file)
        asked = "--force" if "force" in how else "--from identify"
        with pytest.raises(KeyboardInterrupt):
            go(file, overrides={"identify.end": "interrupt"}, **how)
        assert (file.parent / "out" / ".awes" / "forced.json").is_file()
        reasons, notes = go(file, overrides={"identify.end": "interrupt"}, **how)
        assert notes == ["from step 2"] and set(reasons.values()) == {asked}
        own = file.parent / "out" / ".awes"
        assert not (own / "forced.json").exists() and not (own / "scratch" / "identify").exists()
        reasons, notes = go(file, overrides=overrides, **how)
        assert notes == ["from step 0"] and set(reasons.values()) == {asked}


def test_stages_that_a_forced_run_had_finished_are_not_run_again(file, monkeypatch):
    go(file)
    count = {"identify": 0}
    fit, judge = DUMMIES[0], DUMMIES[2]
    run_fit, run_judge = type(fit).run, type(judge).run
    ends = [KeyboardInterrupt, None, None]

    def counted(self, context, config):
        count["identify"] += 1
        return run_fit(self, context, config)

    def stopped(self, context, config):
        if end := ends.pop(0):
            raise end
        return run_judge(self, context, config)

    monkeypatch.setattr(type(fit), "run", counted)
    monkeypatch.setattr(type(judge), "run", stopped)
    with pytest.raises(KeyboardInterrupt):
        go(file, force=True)
    assert go(file, force=True)[0] == {"identify": "unchanged", "trace-residual": "unchanged", "evaluate": "--force"}
    assert count["identify"] == 1
    assert set(go(file, force=True)[0].values()) == {"--force"} and count["identify"] == 2  # finished: the same command is a new one


@pytest.mark.parametrize("between", ["another command", "a failure", "other settings"])
def test_what_a_forced_run_had_done_does_not_outlive_it(file, between):
    go(file)
    with pytest.raises(KeyboardInterrupt):
        go(file, force=True, overrides={"identify.end": "interrupt"})
    settings = {"identify.end": "interrupt"}
    if between == "another command":
        go(file)
    elif between == "a failure":
        with pytest.raises(NumericalFailure):
            go(file, force=True, overrides={"identify.end": "diverge"})
    else:
        settings = {"identify.end": "interrupt", "identify.horizon": "3.0"}
    with pytest.raises(KeyboardInterrupt):
        go(file, force=True, overrides=settings)  # from its beginning, so that it is interrupted again


def test_an_interruption_says_where_the_same_command_goes_on(file):
    events = []
    with pytest.raises(KeyboardInterrupt):
        go(file, overrides={"identify.end": "interrupt"}, report=lambda stage, event: events.append((stage, event)))
    stage, last = events[-1]
    assert (stage, last.status, last.reason) == ("identify", "interrupted", "at its last checkpoint")


class Replay(Judge):
    """Needs both stages before it, and takes something from trace-residual only where identify's horizon is 4 s."""

    def unread(self, config, upstreams):
        if "identify" in upstreams and read_json(upstreams["identify"] / "params.json", any_form=True)["horizon"] == 4.0:
            return ()
        return ("trace-residual",)


def test_what_a_stage_leaves_alone_does_not_make_it_out_of_date(file):
    """A fit of the controller made `identify` of recorded surfaces, which never looks at it, run again."""
    stages = (*DUMMIES[:2], Replay())

    def reasons(overrides, *only, **options):
        return {r.stage: r.reason for r in run_plan(read_plan(file, stages, overrides), stages, only or None, **options)}

    reasons({})
    assert reasons({"trace-residual.count": "4"}) == UNCHANGED | {"trace-residual": "setting count changed 3 -> 4"}
    for dry in (True, False):
        again = reasons({"identify.horizon": "4.0"}, dry_run=dry)
        expected = "upstream identify ran" if dry else "upstream identify, trace-residual ran"
        assert again["evaluate"] == expected
    changed = {"identify.horizon": "4.0", "trace-residual.count": "5"}
    assert reasons(changed)["evaluate"] == "upstream trace-residual ran"


@pytest.mark.parametrize("surfaces, by_identify, read", [
    ("recorded", "controller", False), ("controller", "recorded", True), (None, "recorded", False), (None, "controller", True),
])  # fmt: skip
def test_the_controller_is_read_where_it_moves_the_surfaces(tmp_path, surfaces, by_identify, read):
    write_json(tmp_path / "identify" / "metrics.json", fit_metrics(by_identify))
    for stage in (s for s in STAGES if s.name in ("identify", "trace-residual", "train-hybrid")):
        if stage.name == "identify" and surfaces is None:
            continue
        config = stage.Config(surfaces=surfaces)
        unread = stage.unread(config, {"identify": tmp_path / "identify"})
        assert ("fit-controller" in {n.stage for n in stage.needs(config)} - set(unread)) == read, stage.name


def fit_metrics(surfaces: str) -> dict:
    errors = {part: {"p_n": 0.1, "mean": 0.1} for part in ("train", "validation", "test")}
    return {
        "outcome": "converged", "chi2": 1.0, "method": "filter error", "surfaces": surfaces, "horizon_s": 5.0, "nrmse": errors,
        "outputs": ["p_n"], "processes": {}, "noise_factors": {},
    }  # fmt: skip
