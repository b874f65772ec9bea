"""Data checks gate the fits: a log that is no such flight stops `run`, `check` and every stage with exit code 2, unless ignored."""

import json

import numpy as np
import polars as pl
import pytest
from small_run import make_small_run
from typer.testing import CliRunner

from awescli.cli import build_app
from awescli.stages import STAGES

APP = build_app(STAGES)


def awes(folder, *arguments):
    words = [arguments[0], "--stages", str(folder / "stages.yaml"), *arguments[1:]]
    result = CliRunner().invoke(APP, words, env={"COLUMNS": "80"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def changed(folder, **columns):
    """A small run whose log has other columns: name -> function of the old one."""
    make_small_run(folder)
    file = folder / "flight" / "kite.csv"
    frame = pl.read_csv(file)
    frame.with_columns(**{n: pl.Series(change(frame[n].to_numpy())) for n, change in columns.items()}).write_csv(file)
    return folder


def late(seconds):
    n = int(50 * seconds)
    return lambda x: np.concatenate([np.repeat(x[:1], n), x[:-n]])


@pytest.fixture(scope="module")
def flipped(tmp_path_factory):
    return changed(tmp_path_factory.mktemp("flipped"), rudder_sp=lambda x: -x)


@pytest.mark.parametrize("command", [("check",), ("run",), ("fit-controller",), ("identify",)], ids=" ".join)
def test_a_rudder_of_the_other_sign_stops(flipped, command):
    """Guards a flipped rudder: once a fit that converged at chi-square 52, now one error that names it, and nothing written."""
    result = awes(flipped, *command)
    assert result.exit_code == 2, result.stdout
    said = " ".join(result.stderr.split())
    assert "data check 'rudder response'" in said and "rudder of the other sign" in said and "`ignore: [rudder response]`" in said
    assert not any((flipped / "out").glob("*/metrics.json"))


def test_the_plan_may_ignore_a_check(flipped):
    """Guards the way past the gate: then it runs, and the stage's answer says what was ignored."""
    ignore = ("--set", "ignore=[rudder response]")
    assert awes(flipped, "check", *ignore).exit_code == 0
    result = awes(flipped, "fit-controller", *ignore)
    assert result.exit_code == 0 and "rudder response (ignored)" in " ".join(result.stdout.split()), result.stdout + result.stderr


def test_a_name_that_is_no_check_is_refused_with_the_nearest(flipped):
    result = awes(flipped, "check", "--set", "ignore=[rudder respons]")
    assert result.exit_code == 2 and "there is no data check 'rudder respons'" in result.stderr
    assert "Did you mean 'rudder response'?" in result.stderr and "--set ignore" in result.stderr


@pytest.mark.parametrize("stage", ["identify", "trace-residual"])
def test_a_further_flight_is_asked_too(tmp_path, flipped, stage):
    """Guards `also`: a good plan and a flight beside it that is no such flight."""
    make_small_run(tmp_path)
    result = awes(tmp_path, "check", "--set", f"{stage}.also=[{{flight: {flipped / 'flight'}}}]")
    assert result.exit_code == 2 and "data check 'rudder response'" in result.stderr and str(flipped / "flight") in result.stderr


def test_what_only_warns_stands_in_the_answer_and_in_json(tmp_path):
    """Guards AP2's kind of log: positions 0.2 s late stop nothing and are said where the stage ends."""
    folder = changed(tmp_path, **{f"r_eb_e{a}": late(0.2) for a in "NED"})
    result = awes(folder, "fit-controller")
    assert result.exit_code == 0, result.stderr
    said = " ".join(result.stdout.split())
    assert "data, not good:" in said and "position against velocity" in said and "position lag" in said
    assert max(map(len, (line for line in result.stdout.splitlines() if str(folder) not in line))) <= 80
    checks = json.loads(awes(folder, "check", "--json").stdout)["quality"]["checks"]
    lag = next(c for c in checks if c["name"] == "position lag")
    assert lag["value"] == pytest.approx(0.2, abs=0.02) and not lag["ok"] and not lag["stops"] and lag["stop"] > lag["threshold"]


@pytest.mark.parametrize(
    "table, column, change, check",
    [
        ("wind", "rho", lambda x: 0 * x + 1225.0, "air density"),
        ("wind", "rho", lambda x: 0 * x, "air density"),
        ("wind", "_time", lambda x: x + int(6840e9), "weather coverage"),
        ("kite", "LoadFiltered", lambda x: -x, "line that pushes"),
        ("kite", "LoadFiltered", lambda x: 9.80665e-3 * x, "load as declared"),
        ("kite", "theta", lambda x: -x, "axes of the rates"),
        ("kite", "V_a", lambda x: 1.944 * x, "airspeed scale"),
    ],
)
def test_logs_that_mean_something_else_stop(tmp_path, table, column, change, check):
    make_small_run(tmp_path)
    file = tmp_path / "flight" / f"{table}.csv"
    frame = pl.read_csv(file)
    frame.with_columns(**{column: pl.Series(change(frame[column].to_numpy()))}).write_csv(file)
    result = awes(tmp_path, "run")
    assert result.exit_code == 2 and f"data check '{check}'" in result.stderr, result.stderr


def test_a_log_pasted_twice_stops(tmp_path):
    make_small_run(tmp_path)
    file = tmp_path / "flight" / "kite.csv"
    frame = pl.read_csv(file)
    t = frame["epoch_ms"]
    pl.concat([frame, frame.with_columns(epoch_ms=t + (t[-1] - t[0]) + 20)]).write_csv(file)
    result = awes(tmp_path, "run")
    assert result.exit_code == 2 and "data check 'repeated blocks'" in result.stderr, result.stderr


def test_every_check_of_a_good_plan_is_good_and_has_a_name(tmp_path):
    from awescli.flightlog.check_names import NAMES

    make_small_run(tmp_path)
    checks = json.loads(awes(tmp_path, "check", "--json").stdout)["quality"]["checks"]
    assert {c["name"] for c in checks} <= set(NAMES) and [c["name"] for c in checks if not c["ok"]] == ["usable loops", "ranges"]
    assert not any(c["stops"] for c in checks)
