"""The thesis' recipe as a plan (examples/thesis): it runs to its end on flights of any length, and one model has one score."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from flightlog.synthetic import write_folder
from kites import ROOT, flight
from typer.testing import CliRunner

from awescli.artifacts import read_json
from awescli.cli import build_app
from awescli.flightlog.split import Split
from awescli.notation.errors import BadInput, NumericalFailure
from awescli.physics.declaration import kite_text
from awescli.stages import STAGES
from awescli.stages.ahead import AheadConfig, horizon_within, longest_ahead
from awescli.stages.base import Silent
from awescli.stages.flight_parts import unknown_channels

PLAN = ROOT / "examples" / "thesis" / "stages.yaml"
QUICK = (
    "fit-controller.features=curvature", "train-hybrid.rounds=1", "train-hybrid.budget=3.0",
    "train-hybrid.compare=false", "identify.curriculum=[1.0]",
)  # fmt: skip
"""Little of each step: tests/acceptance/test_thesis.py lets the law choose its features."""


def thesis(folder, seconds: float, *settings: str):
    """(exit code and output, folder of results) of the plan on `seconds` of a flight of the development kite."""
    found = flight(seed=1, duration=seconds, noise=True)
    write_folder(folder / "flight", found.log)
    (folder / "kite.yaml").write_text(kite_text(found.declared))
    own = (f"flight={folder / 'flight'}", f"kite={folder / 'kite.yaml'}", f"out={folder / 'out'}")
    words = ["run", "--stages", str(PLAN), *(w for s in (*own, *QUICK, *settings) for w in ("--set", s))]
    return CliRunner().invoke(build_app(STAGES), words), folder / "out"


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Half a minute: fewer loops than folds, no 18 s in any part."""
    return thesis(tmp_path_factory.mktemp("thesis"), 30.0)


def test_the_recipe_runs_on_a_flight_of_half_a_minute(short):
    """Guards the contract: exit code 0, every outcome named, and what had to be shortened is said."""
    done, out = short
    assert done.exit_code == 0, done.output
    assert "horizon shortened from 18 s" in " ".join(done.output.split())
    law, identified, trained, scored = (
        read_json(out / stage / "metrics.json") for stage in ("fit-controller", "identify", "train-hybrid", "evaluate")
    )
    assert law["method"] == "convex" and law["chosen_by"]["basis"] == "convex" and law["folds_of"] == "blocks"
    assert identified["outcome"] in ("converged", "iteration_limit", "no_progress", "quadratic_program")
    assert identified["horizon_asked_s"] == 18.0 and 1.0 < identified["horizon_s"] < 18.0
    assert identified["outputs"] == ["p_n", "p_e", "p_d", "phi", "theta", "psi", "tension", "rudder"]
    assert trained["outcome"] in ("trained", "budget_reached", "no_gain", "diverged") and trained["gate"] is False
    ended = {"fit-controller": law, "identify": identified, "train-hybrid": trained}
    assert scored["outcomes"] == {stage: metrics["outcome"] for stage, metrics in ended.items()}
    for said in (identified, trained, scored):
        assert (said["surfaces"], said["initial_states"]) == ("controller", "measured")


def test_one_model_has_one_score(short):
    """Guards one meaning of a closed loop: identify, train-hybrid and evaluate give the same model the same errors, to the last digit."""
    _, out = short
    identified, trained, scored = (read_json(out / stage / "metrics.json") for stage in ("identify", "train-hybrid", "evaluate"))
    of_law = {"rudder"}
    for ours, theirs in (
        (identified["initial"], scored["initial"]), (identified, scored["identified"]), (trained["before"], scored["identified"]),
        (trained, scored["hybrid"]),
    ):  # fmt: skip
        assert ours["horizon_s"] == theirs["horizon_s"]
        for part, errors in theirs["nrmse"].items():
            assert ours["nrmse"][part] == {n: e for n, e in errors.items() if n not in of_law}


def test_the_replay_is_another_score(short, tmp_path):
    """Guards `evaluate.surfaces`: asked for, the recorded set-points are replayed, whatever identify did."""
    _, out = short
    words = ["evaluate", "--stages", str(PLAN), "--set", f"out={out}", "--set", f"flight={out.parent / 'flight'}", "--set",
             f"kite={out.parent / 'kite.yaml'}", *(w for s in QUICK for w in ("--set", s))]  # fmt: skip
    before = read_json(out / "evaluate" / "metrics.json")
    done = CliRunner().invoke(build_app(STAGES), [*words, "--set", "evaluate.surfaces=recorded"])
    assert done.exit_code == 0, done.output
    after = read_json(out / "evaluate" / "metrics.json")
    assert after["surfaces"] == "recorded" and after["initial"]["nrmse"]["test"]["psi"] != before["initial"]["nrmse"]["test"]["psi"]


def log_of(runs, n=1000, dt=0.02):
    valid = np.zeros(n, bool)
    for a, b in runs:
        valid[a:b] = True
    return SimpleNamespace(dt=dt, valid=valid, name="made")


PARTS = Split(((0, 500),), ((500, 700),), ((700, 1000),), (1, 1, 1), "loops")


def test_the_longest_prediction_fits_and_no_longer_one_does():
    """Guards the count: after a warm-up of 1 s, which may lie in the part before, the prediction and both its ends are valid."""
    assert longest_ahead(log_of([(0, 1000)]), PARTS, 1.0) == pytest.approx((200 - 1) * 0.02)
    assert longest_ahead(log_of([(0, 600), (620, 1000)]), PARTS, 1.0) == pytest.approx((150 - 1 - 50) * 0.02)
    assert longest_ahead(log_of([(0, 1000)]), replace(PARTS, validation=((0, 200),)), 1.0) == pytest.approx((200 - 1 - 50) * 0.02)


def test_a_horizon_is_shortened_only_where_the_plan_says_so():
    context = SimpleNamespace(progress=Silent())
    flights = [(log_of([(0, 1000)]), PARTS)]
    refuse, shorten = AheadConfig(), AheadConfig(too_long="shorten")
    assert horizon_within(context, refuse, 18.0, flights) == 18.0
    assert horizon_within(context, shorten, 2.0, flights) == 2.0
    assert horizon_within(context, shorten, 18.0, flights) == pytest.approx(3.9)
    with pytest.raises(NumericalFailure) as failure:
        horizon_within(context, shorten, 18.0, [(log_of([(0, 600)]), PARTS)])
    assert failure.value.outcome == "too_short"


def test_a_set_point_is_an_output_of_a_closed_loop_only():
    log = flight(duration=20.0).log
    ((key, mistake),) = unknown_channels(log, ("psi", "rudder"))
    assert key == "outputs" and isinstance(mistake, BadInput) and "replayed" in str(mistake)
    assert not list(unknown_channels(log, ("psi", "rudder"), closed=True))
