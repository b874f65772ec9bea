"""What a stage would refuse, `awes check` refuses: with the same words, the place of the setting, and exit code 2."""

import polars as pl
import pytest
from small_run import make_small_run
from typer.testing import CliRunner

from awescli.cli import build_app
from awescli.stages import STAGES

APP = build_app(STAGES)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("checked")
    make_small_run(path)
    plan = path / "stages.yaml"
    plan.write_text(plan.read_text().replace("folds: 2,", "folds: 2, few_loops: refuse,"))
    return path


def awes(folder, *arguments):
    words = [arguments[0], "--stages", str(folder / "stages.yaml"), *arguments[1:]]
    result = CliRunner().invoke(APP, words, env={"COLUMNS": "80"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def test_a_good_plan_is_good(folder):
    result = awes(folder, "check")
    assert result.exit_code == 0 and "verdict: " in result.stdout, result.stderr
    assert max(map(len, (line for line in result.stdout.splitlines() if str(folder) not in line))) <= 80


WRONG = [
    ("trace-residual.candidates=[actuator_lagg]", "unknown effect 'actuator_lagg'", "Did you mean 'actuator_lag'?"),
    ("trace-residual.candidates=[actuator_lag, airspeed_scale]", "cannot act on ''", "actuator_lag:"),
    ("trace-residual.outputs=[p_n, roll]", "no measured channel 'roll'", "Did you mean 'phi'?"),
    ("trace-residual.horizon=30.0", "no 30 s in a row fit into the", "shorter"),
    ("identify.outputs=[airspeed]", "no measured channel 'airspeed'", "Did you mean 'V_a'?"),
    ("identify.per_flight=[dl]", "there is only one flight", "also"),
    ("identify.per_flight=[zz*]", "no free parameter is called 'zz*'", ""),
    ("identify.horizon=40", "no 40 s in a row", "shorter"),
    ("identify.also=[{flight: nowhere}]", "no such flight folder", ""),
    ("trace-residual.also=[{flight: nowhere}]", "no such flight folder", ""),
    ("fit-controller.features=invariannt", "unknown feature set 'invariannt'", "Did you mean 'invariant'?"),
    ("fit-controller.features=[v_d, elevatio]", "unknown feature 'elevatio'", "Did you mean"),
    ("fit-controller.surfaces=[elevator]", "'elevator' never moves", "Drop it"),
    ("fit-controller.folds=19", "fewer than 19 folds", "Set folds"),
    ("train-hybrid.inputs=[alfa]", "unknown network input 'alfa'", "Did you mean 'alpha'?"),
    ("simulate.effects={actuator_lag:ruder: {tau: 0.2}}", "cannot act on 'ruder'", "Did you mean 'actuator_lag:rudder'?"),
    ("simulate.effects={actuator_lag:rudder: {tauu: 0.2}}", "unknown parameter 'actuator_lag:rudder.tauu'", "Did you mean"),
    ("simulate.start=500", "only 44.0 s long", "Start before"),
    ("evaluate.horizon=50", "no 50 s in a row", "shorter"),
]


LATER = {"trace-residual.candidates=[actuator_lag, airspeed_scale]": 1, "fit-controller.features=[v_d, elevatio]": 1,
         "simulate.effects={actuator_lag:rudder: {tauu: 0.2}}": 1, "identify.per_flight=[dl]": 1, "identify.per_flight=[zz*]": 2,
         "fit-controller.folds=19": 2}  # fmt: skip
"""Settings that come into a second or a third command: one key is set once, and where no surface is left, or further flights are given,
nothing is said of folds or of `per_flight`."""


@pytest.fixture(scope="module")
def told(folder):
    """(command, n) -> what it says, a text for each mistake, of the n-th mistakes of WRONG together, or of those of its own keys."""
    made = {}

    def of(command, n):
        if (command, n) not in made:
            own = [s for s, *_ in WRONG if LATER.get(s, 0) == n and command in ("check", s.partition(".")[0])]
            result = awes(folder, command, *(word for setting in own for word in ("--set", setting)))
            assert result.exit_code == 2 and result.stderr.startswith("error: --set "), result.stderr
            assert command == "check" or "runs (first run)" in result.stdout and not (folder / "out" / command).exists()
            made[command, n] = result.stderr.strip().removeprefix("error: --set ").split("\n--set ")
        return made[command, n]

    return of


@pytest.mark.parametrize("setting, what, do", WRONG, ids=[w[0] for w in WRONG])
def test_what_a_stage_would_refuse_check_refuses(told, setting, what, do):
    """The same message from `check` and from the stage, which stops before it computes anything; mistakes of other keys beside it hide
    none."""
    key, n = setting.partition("=")[0], LATER.get(setting, 0)
    (said, *_) = [text for text in told("check", n) if text.startswith(f"{key}: ")]
    assert what in said and do in said
    stage = key.partition(".")[0]
    if stage in ("fit-controller", "identify"):  # the others need these first
        assert said.splitlines()[0] in [text.splitlines()[0] for text in told(stage, n)]


def test_several_mistakes_are_told_together(folder):
    settings = [word for setting, _, _ in (WRONG[0], WRONG[2], WRONG[4]) for word in ("--set", setting)]
    result = awes(folder, "check", *settings)
    assert result.exit_code == 2 and all(WRONG[i][1] in result.stderr for i in (0, 2, 4))


def test_a_log_that_lacks_essentials_exits_2(tmp_path):
    make_small_run(tmp_path)
    kite = tmp_path / "flight" / "kite.csv"
    (tmp_path / "flight" / "wind.csv").unlink()
    result = awes(tmp_path, "check")
    assert result.exit_code == 2 and result.stderr.count("lacks what a model needs: wind") == 1 and "missing for a model" in result.stdout
    frame = pl.read_csv(kite)
    few = tmp_path / "few"
    make_small_run(few)
    frame.head(500).write_csv(few / "flight" / "kite.csv")
    result = awes(few, "check")
    assert result.exit_code == 2 and "cannot be split into train, validation and test" in result.stderr


def test_every_stage_can_be_asked(folder):
    """The contract: `check` of every stage looks at flight and kite, and has nothing against a good plan."""
    from awescli.stages.base import Inputs
    from awescli.stages.checking import refused
    from awescli.stages.plan import read_plan

    plan = read_plan(folder / "stages.yaml", STAGES)
    inputs = Inputs(plan.flight, plan.kite, plan.split)
    broken = Inputs(folder / "nowhere", plan.kite, plan.split)
    for stage in STAGES:
        assert refused(stage, inputs, plan) == [], stage.name
        assert refused(stage, broken, plan), stage.name
