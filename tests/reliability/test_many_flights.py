"""Many flights as one plan: what kills, interruptions and somebody else's scheduler leave; and real flights of different truth."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from flightlog.synthetic import write_folder
from kites import DEVELOPMENT
from stages.dummy_stages import make_folder
from stages.test_trace_residual import folder_of
from typer.testing import CliRunner

from awescli.artifacts import locked
from awescli.cli import build_app
from awescli.notation.errors import BadInput
from awescli.simulation.campaign_flights import dev_like
from awescli.stages import STAGES
from awescli.stages.flight_table import effects_said
from awescli.stages.many import _of_one_kind

TESTS = Path(__file__).parents[1]
RUN = "from stages.dummy_stages import DUMMIES; from awescli.cli import build_app; build_app(DUMMIES)()"
PATHS = {"PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent)])}


@pytest.fixture
def folder(tmp_path):
    """A plan of two flights whose first stage ends as soon as a file beside the flight says so: that of a does, that of b does not."""
    plan = make_folder(tmp_path)
    for name in "ab":
        (tmp_path / "logs" / name).mkdir(parents=True)
        (tmp_path / "logs" / name / "kite.csv").write_text(f"{name}\n")
    (tmp_path / "logs" / "a.go").touch()
    plan.write_text(plan.read_text().replace("flight: flight", "flights: ['logs/?']").replace("horizon: 5.0", "end: wait"))
    return tmp_path


def start(folder, *options):
    """`awes run` of the dummy stages, in a process group of its own, as a terminal starts it."""
    words = [sys.executable, "-c", RUN, "run", *options]
    env = {**os.environ, **PATHS}
    return subprocess.Popen(words, cwd=folder, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True)


def until(true, seconds=40.0):
    """Wait until something is so."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)


def halfway(folder):
    """a has ended, b is in its first stage, with a checkpoint."""
    b = folder / "out" / "b" / ".awes" / "scratch" / "identify" / "steps"
    return (folder / "out" / "a" / "evaluate").is_dir() and b.is_file() and b.read_text() == "3"


def begun(folder):
    """How often b's first stage has begun. Asked of the log: who asks for the lock holds it, and a run that begins then is refused."""
    log = folder / "out" / "b" / ".awes" / "awes.log"
    return log.read_text().count("from step") if log.is_file() else 0


def free(out):
    """Does no run hold the folder? For a run that has been told to end."""
    try:
        with locked(out):
            return True
    except BadInput:
        return False


def rows(folder):
    return {row["flight"]: row for row in json.loads((folder / "out" / "flights.json").read_text())["flights"]}


def goes_on(folder, *options):
    """The second start: a is not made again, b goes on at its checkpoint."""
    (folder / "logs" / "b.go").touch()
    second = start(folder, *options)
    said, _ = second.communicate(timeout=60)
    assert second.returncode == 0, said
    assert {name: row["stages"]["identify"] for name, row in rows(folder).items()} == {"a": "unchanged", "b": "ran"}
    assert "from step 3" in (folder / "out" / "b" / ".awes" / "awes.log").read_text()


def test_a_killed_parent_takes_its_workers_with_it_and_a_second_start_goes_on(folder):
    first = start(folder, "--workers", "2")
    until(lambda: halfway(folder))
    first.kill()
    first.communicate(timeout=20)  # ends where the workers have let go of its output
    until(lambda: free(folder / "out" / "b"), 10)
    assert not (folder / "out" / "flights.json").exists()
    goes_on(folder, "--workers", "2")


def test_ctrl_c_ends_all_processes(folder):
    """Guards against workers that a terminal's Ctrl-C ended and Dask started again: the command hung."""
    first = start(folder, "--workers", "2")
    until(lambda: halfway(folder))
    assert any("a: done" in line for line in iter(first.stdout.readline, ""))
    os.killpg(first.pid, signal.SIGINT)
    said, _ = first.communicate(timeout=20)
    assert first.returncode == 130 and "interrupted during b" in said and "Finished and kept: a." in said, said
    assert "Traceback" not in said and free(folder / "out" / "b")
    goes_on(folder, "--workers", "0")


def test_on_somebody_elses_scheduler(folder, monkeypatch):
    """`--scheduler`: a run that is interrupted, or killed, stops on the workers too, which outlive it; the next one goes on there."""
    from distributed import LocalCluster

    monkeypatch.setenv("PYTHONPATH", PATHS["PYTHONPATH"])
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        # the first stage waits in every run, also in one that goes on
        for runs, how, code in ((1, signal.SIGINT, 130), (2, signal.SIGKILL, -signal.SIGKILL)):
            first = start(folder, "--scheduler", cluster.scheduler_address)
            until(lambda runs=runs: halfway(folder) and begun(folder) == runs)
            first.send_signal(how)
            said, _ = first.communicate(timeout=30)
            assert first.returncode == code, said
            until(lambda: free(folder / "out" / "b"), 20)
        goes_on(folder, "--scheduler", cluster.scheduler_address)


def test_workers_with_another_awes_are_refused():
    """Guards against results that this awes would call out of date, or not understand."""

    class Cluster:
        def run(self, function):
            return {"tcp://one": function(), "tcp://two": "another"}

    with pytest.raises(BadInput, match="1 of 2 workers have another awes than this one: tcp://two"):
        _of_one_kind(Cluster(), "tcp://there")


@pytest.mark.campaign
def test_flights_of_different_truth(tmp_path, monkeypatch):
    """One lacks an effect, one lacks none, one is refused: the table says of each what its own run finds, and holds the truth."""
    folder_of(tmp_path, {"sideslip_drag": {"k": 2.5}})
    (tmp_path / "flight").rename(tmp_path / "missing")
    write_folder(tmp_path / "complete", dev_like(DEVELOPMENT, 51, {}, duration=50.0).log)
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "kite.csv").write_text("time,nothing\n0,1\n")
    plan = tmp_path / "stages.yaml"
    plan.write_text(plan.read_text().replace("flight: flight", "flights: [missing, complete, broken]"))
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(build_app(STAGES), ["run", "--workers", "2"])
    assert result.exit_code == 2 and "1 of 3 flights: refused" in result.stderr and "broken" in result.stderr, result.output
    found = rows(tmp_path)
    assert {name: (row["status"], row["verdict"]) for name, row in found.items()} == {
        "missing": ("done", "found"), "complete": ("done", "none"), "broken": ("refused", None),
    }  # fmt: skip
    (effect,) = found["missing"]["effects"]
    size = effect["parameters"]["k"]
    assert effect["name"] == "sideslip_drag" and size["low"] < 2.5 < size["high"] and size["high"] - size["low"] < 2.0
    error = found["missing"]["error"]
    assert error["before"] > 1.2 * error["after"] and error["after"] < 1.2 * error["noise"]
    assert found["complete"]["effects"] == [] and effects_said(found["missing"]) in " ".join(result.stdout.split())
    checked = CliRunner().invoke(build_app(STAGES), ["check"])
    assert checked.exit_code == 2 and "broken: cannot be read" in checked.stdout and "complete: " in checked.stdout
