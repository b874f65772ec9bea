"""Every example runs and says what it promises."""

import runpy
import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).parent.parent / "examples"


def test_the_left_out_effect_is_found():
    """The README's promise in one script: the effect that was left out is named, and the error falls to the noise."""
    answer = runpy.run_path(str(EXAMPLES / "find_a_left_out_effect.py"))["main"]()
    assert answer["verdict"] == "found" and answer["effects"][0]["name"] == "airspeed_scale"
    s = answer["effects"][0]["parameters"]["s"]
    assert abs(s["value"] - 0.94) < 3 * s["std"]
    assert answer["error"]["after"]["mean"] < 1.15 * answer["error"]["noise_floor"]["mean"]


def test_controllers_are_compared(tmp_path):
    """The nonlinear laws beat the linear one on unseen loops, and the picture is written."""
    errors = runpy.run_path(str(EXAMPLES / "compare_controllers.py"))["main"](tmp_path / "picture.html")
    assert errors["gaussian"] < errors["linear"] and errors["network"] < errors["linear"]
    assert (tmp_path / "picture.html").stat().st_size > 1e5


def test_declare_refuses_what_is_no_nominal(tmp_path):
    """One line and exit code 2, no traceback, nothing written."""
    (tmp_path / "nominal.yaml").write_text("a: 1\n")
    command = [sys.executable, str(EXAMPLES / "dev_kite" / "declare.py"), str(tmp_path / "nominal.yaml"), str(tmp_path / "kite.yaml")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2 and "Traceback" not in done.stderr and not (tmp_path / "kite.yaml").exists()
