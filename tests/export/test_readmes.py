"""What the README of an exported folder tells its reader to type works as it stands there, in a folder that holds nothing else."""

import re
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from export.flying import put
from export.models import Flown, free, with_controller, with_states

from awescli.export import EXPORTERS, exported
from awescli.simulation.rollout import Simulator

CASES = [with_states, with_controller, free]
WRITTEN_IN = {"c": "c", "fmu": "python", "casadi": "python", "jsbsim": "python"}
"""Form -> language of its example."""


def written(flown: Flown, form: str, folder) -> str:
    """The folder as `awes export` leaves it; returns its README."""
    put(folder, exported(flown.model, form))
    return (folder / "README.md").read_text()


def standing_still(flown: Flown) -> np.ndarray:
    """(N+1, 24) outputs of the simulator where inputs and set-points stay as they are at the start."""
    s, model = flown.segments, flown.model
    still = replace(s, setpoints=np.repeat(s.setpoints[:, :1], s.steps + 1, axis=1), inputs=np.repeat(s.inputs[:, :1], s.steps + 1, axis=1))
    return Simulator(model.kite, wrt=(), law=model.law, step=model.longest).rollout(still).outputs[0]


def example(readme: str, language: str) -> str:
    (block,) = re.findall(rf"^```{language}\n(.*?)^```$", readme, re.M | re.S)
    return block


def run(command: list[str], folder) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("form", EXPORTERS)
def test_every_form_says_what_it_is(form, tmp_path):
    readme = written(with_states(), form, tmp_path) if form != "casadi" or _has("casadi") else None
    if readme is None:
        pytest.skip("casadi is not installed (extra `casadi`)")
    assert "set-points of the surfaces are inputs" in readme and "$" not in readme and (form in WRITTEN_IN) == ("```" in readme)


def _has(package: str) -> bool:
    return pytest.importorskip(package, reason=f"{package} is not installed (extra `test`)") is not None


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc on this machine")
@pytest.mark.parametrize("case", CASES, ids=lambda f: f.__name__)
def test_the_example_of_c_flies(case, tmp_path):
    """It prints where the kite is, every second."""
    readme = written(case(), "c", tmp_path)
    (tmp_path / "example.c").write_text(example(readme, "c"))
    (command,) = re.findall(r"`(gcc [^`]*)`", readme)
    run([*command.split(), "-Wall", "-Wextra", "-Werror", "-o", "example"], tmp_path)
    rows = [[float(number) for number in re.findall(r"-?\d+\.\d+", line)] for line in run(["./example"], tmp_path).splitlines()]
    assert [row[0] for row in rows] == list(range(10))
    assert np.array(rows)[:, 1:] == pytest.approx(standing_still(case())[:500:50, :3], abs=0.006)


@pytest.mark.parametrize("case", CASES, ids=lambda f: f.__name__)
@pytest.mark.parametrize("form", ["casadi", "jsbsim", "fmu"])
def test_the_example_in_python_flies(form, case, tmp_path):
    """A process of its own, which knows nothing of awes."""
    _has({"fmu": "fmpy"}.get(form, form))
    if form == "fmu" and not (shutil.which("gcc") and shutil.which("cmake")):
        pytest.skip("no C compiler or no cmake on this machine")
    code = example(written(case(), form, tmp_path), "python")
    last = {"casadi": "float(x[2])", "fmu": "float(found['state.p_d'][-1])", "jsbsim": "machine['awes/sensor/p_d']"}[form]
    k, close = {"casadi": (100, 1e-6), "fmu": (100, 1e-6), "jsbsim": (50, 1e-3)}[form]
    found = float(run([sys.executable, "-c", f"{code}print({last})"], tmp_path).splitlines()[-1])
    assert found == pytest.approx(standing_still(case())[k, 2], abs=close)
