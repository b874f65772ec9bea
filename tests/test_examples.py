"""Every example runs and says what it promises."""

import ast
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import awescli

EXAMPLES = Path(__file__).parent.parent / "examples"


def test_the_left_out_effect_is_found():
    """The README's promise in one script: the effect that was left out is named, and the error falls to the noise."""
    traced = runpy.run_path(str(EXAMPLES / "find_a_left_out_effect.py"))["main"]()
    assert traced.verdict == "found" and [e.name for e in traced.effects] == ["airspeed_scale"]
    s, std, _ = traced.effects[0].parameters["s"]
    assert abs(s - 0.94) < 3 * std
    errors = traced.errors
    assert errors.after["mean"] < 1.15 * errors.noise["mean"]
    assert errors.after["V_a"] < 1.15 * errors.noise["V_a"] < errors.before["V_a"]


@pytest.mark.parametrize("script", sorted(EXAMPLES.glob("*.py")), ids=lambda p: p.stem)
def test_scripts_use_the_public_interface_only(script):
    """What a reader copies goes on working: names below `awescli` itself may move with any version."""
    for node in ast.walk(ast.parse(script.read_text())):
        modules = (
            [a.name for a in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
        assert not [m for m in modules if m.startswith("awescli.")], script
        if isinstance(node, ast.ImportFrom) and node.module == "awescli":
            assert {a.name for a in node.names} <= set(awescli.__all__)


def test_controllers_are_compared(tmp_path):
    """The nonlinear laws beat the linear one on unseen loops, and the picture is written. The law by linear programmes, which takes the
    longest, is fitted to the same flight by tests/acceptance/test_thesis.py."""
    main = runpy.run_path(str(EXAMPLES / "compare_controllers.py"))["main"]
    del main.__globals__["LAWS"]["convex"]
    errors = main(tmp_path / "picture.html")
    assert errors["gaussian"] < errors["linear"] and errors["network"] < errors["linear"]
    assert (tmp_path / "picture.html").stat().st_size > 1e5


def test_declare_refuses_what_is_no_nominal(tmp_path):
    """One line and exit code 2, no traceback, nothing written."""
    (tmp_path / "nominal.yaml").write_text("a: 1\n")
    command = [sys.executable, str(EXAMPLES / "dev_kite" / "declare.py"), str(tmp_path / "nominal.yaml"), str(tmp_path / "kite.yaml")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2 and "Traceback" not in done.stderr and not (tmp_path / "kite.yaml").exists()
