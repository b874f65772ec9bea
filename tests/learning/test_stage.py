"""train-hybrid as a command: stopped and killed in the middle it goes on to the same weights; damaged files are told by name."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from kites import DEVELOPMENT
from learning.hybrid_cli import APP
from typer.testing import CliRunner

from awescli.artifacts import read_arrays, read_json, read_tensors, scratch_path, write_json, write_tensors
from awescli.flightlog.kitemill_csv import to_kitemill_csv
from awescli.flightlog.read import read_flight
from awescli.learning.correction import hybrid_from_artifact
from awescli.notation.errors import BadInput
from awescli.physics.declaration import kite_text, read_kite
from awescli.simulation.campaign_flights import dev_like
from awescli.stages.nested_models import network

PLAN = """flight: flight
kite: kite.yaml
stages:
  identify: {}
  train-hybrid: {hidden: [4], inputs: [u, w, p, r, alpha, beta, V_a], horizons: [0.5], rounds: 2, members: 2, budget: 1e6}
"""


def command(folder: Path, *arguments: str) -> subprocess.Popen:
    cli = Path(__file__).with_name("hybrid_cli.py")
    return subprocess.Popen([sys.executable, str(cli), *arguments], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finished(folder: Path, *arguments: str) -> tuple[int, str]:
    """(exit code, all that was printed)"""
    process = command(folder, *arguments)
    out, err = process.communicate()
    return process.returncode, out + err


def here(folder: Path, *arguments: str) -> None:
    """A command that ends well, in the tests' own process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        done = CliRunner().invoke(APP, arguments)
    assert done.exit_code == 0, done.output


def stopped(folder: Path, when: Path, sign: int) -> int:
    """Exit code of a training that gets a signal as soon as a checkpoint of a network stands on disk."""
    process = command(folder, "train-hybrid")
    while not when.is_file():
        assert process.poll() is None, process.communicate()
        time.sleep(0.005)
    process.send_signal(sign)
    process.communicate()
    return process.returncode


@pytest.fixture(scope="module")
def plan(tmp_path_factory) -> Path:
    """A folder with a flight that has an undeclared drag, its kite, and a plan; identify has run."""
    folder = tmp_path_factory.mktemp("hybrid")
    flight = dev_like(DEVELOPMENT, 77, {"parasitic_drag": {"k": 0.2}}, duration=30.0, spread=(0.0, 1e-9))
    (folder / "flight").mkdir()
    kite, wind = to_kitemill_csv(flight.log)
    (folder / "flight" / "kite.csv").write_text(kite)
    (folder / "flight" / "wind.csv").write_text(wind)
    (folder / "kite.yaml").write_text(kite_text(flight.declared))
    (folder / "stages.yaml").write_text(PLAN)
    here(folder, "identify")
    return folder


@pytest.fixture(scope="module")
def whole(plan) -> Path:
    """The folder of a training that nothing interrupted."""
    shutil.copytree(plan, there := plan.with_name("whole"))
    here(there, "train-hybrid")
    return there / "out" / "train-hybrid"


def test_interrupted_and_killed_training_ends_at_the_same_weights(plan, whole):
    scratch = scratch_path(plan / "out", "train-hybrid")
    assert stopped(plan, scratch / "training-0.npz", signal.SIGINT) == 130
    assert not (plan / "out" / "train-hybrid").exists()
    before = read_arrays(scratch / "training-0.npz")["history"]
    assert stopped(plan, scratch / "training-1.npz", signal.SIGKILL) == -signal.SIGKILL
    after = read_arrays(scratch / "training-0.npz")["history"]
    # the second run went on from the first one's rounds, seconds included: it did not begin anew
    assert len(after) >= len(before) > 0 and np.array_equal(after[: len(before)], before)
    here(plan, "train-hybrid")
    assert not scratch.exists()
    resumed, uninterrupted = (read_tensors(folder / "network.safetensors") for folder in (plan / "out" / "train-hybrid", whole))
    assert np.abs(uninterrupted["weights"]).max() > 0.1
    for name in uninterrupted:
        assert np.abs(resumed[name] - uninterrupted[name]).max() <= 1e-12
    assert read_json(whole / "metrics.json")["ensemble"]["members"] == 2


def test_a_damaged_checkpoint_is_named_and_then_gone(plan, whole):
    again = plan.with_name("again")
    shutil.copytree(whole.parents[1], again)
    shutil.rmtree(again / "out" / "train-hybrid")
    checkpoint = scratch_path(again / "out", "train-hybrid") / "training-0.npz"
    assert stopped(again, checkpoint, signal.SIGKILL) == -signal.SIGKILL
    checkpoint.write_bytes(checkpoint.read_bytes()[:-40])
    code, said = finished(again, "train-hybrid")
    assert code == 2 and "training-0.npz" in "".join(said.split()) and "not readable as npz" in " ".join(said.split())
    assert not checkpoint.exists()


def test_damaged_and_mismatched_networks_are_refused_by_name(plan, whole, tmp_path):
    log, declaration = read_flight(plan / "flight"), read_kite(whole / "kite.yaml")
    assert hybrid_from_artifact(*network(whole), declaration, log)
    tensors, description = read_tensors(whole / "network.safetensors"), read_json(whole / "network.json")

    def refused(said, weights=None, text=None, cut=0):
        folder = tmp_path / f"case{len(os.listdir(tmp_path))}"
        folder.mkdir()
        write_tensors(folder / "network.safetensors", weights or tensors)
        write_json(folder / "network.json", text or description)
        if cut:
            file = folder / "network.safetensors"
            file.write_bytes(file.read_bytes()[:-cut])
        with pytest.raises(BadInput, match=said) as e:
            hybrid_from_artifact(*network(folder), declaration, log)
        assert "network.safetensors" in str(e.value) and "awes" in str(e.value)

    refused("not readable as safetensors", cut=8)
    refused("do not belong together", {**tensors, "weights": tensors["weights"] + 1e-9})
    refused("do not belong together", text={**description, "width": description["width"] * 1.01})
    refused("is not .* finite numbers", text={**description, "hidden": [5]})
    refused("lacks", {"weights": tensors["weights"]})
