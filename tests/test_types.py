"""Types are said, and they are true: annotations where a room is annotated whole, and pyright over all of the package."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = sorted(p.parent.name for p in (ROOT / "awescli").glob("*/__init__.py"))


def functions(node: ast.AST) -> Iterator[ast.FunctionDef]:
    """Functions and methods, not those inside a function, whose types their surroundings say."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef):
            yield child
        else:
            yield from functions(child)


def bare(function: ast.FunctionDef) -> list[str]:
    """Arguments without a type, and `result` where that has none."""
    a = function.args
    every = [*a.posonlyargs, *a.args, *a.kwonlyargs, *(x for x in (a.vararg, a.kwarg) if x is not None)]
    names = [x.arg for x in every if x.annotation is None and x.arg not in ("self", "cls")]
    return names + (["result"] if function.returns is None and function.name != "__init__" else [])


def test_bare_arguments_and_results_are_seen():
    """Guards the test below."""
    (method, function) = functions(ast.parse("class A:\n def f(self, x: int, *y) -> int:\n  def g(z): ...\ndef h(): ..."))
    assert (bare(method), bare(function)) == (["y"], ["result"])


@pytest.mark.parametrize("room", ROOMS)
def test_every_argument_and_result_has_a_type(room):
    files = sorted((ROOT / "awescli" / room).rglob("*.py"))
    lacking = [f"{file.name}:{f.lineno}: {f.name}: {n}" for file in files for f in functions(ast.parse(file.read_text())) for n in bare(f)]
    assert files and lacking == []


@pytest.mark.slow
@pytest.mark.skipif(find_spec("pyright") is None, reason="pyright is not installed: pip install awes[test]")
def test_types_agree():
    done = subprocess.run(
        [sys.executable, "-m", "pyright", "--pythonpath", sys.executable], cwd=ROOT, capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, done.stdout + done.stderr
