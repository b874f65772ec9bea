"""Benchmarks and examples run for minutes before they reach an import inside a function: a name that has moved must show up here."""

import ast
import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SCRIPTS = sorted(p for folder in ("benchmarks", "examples", "data") for p in (ROOT / folder).rglob("*.py"))


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_every_name_that_a_script_imports_is_there(script):
    """Guards scripts against moved functions, wherever in the file they are imported."""
    for node in ast.walk(ast.parse(script.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("awescli"):
            module = importlib.import_module(node.module)
            missing = [a.name for a in node.names if not hasattr(module, a.name) and not _is_module(f"{node.module}.{a.name}")]
            assert not missing, (node.module, missing)


def _is_module(name: str) -> bool:
    return importlib.util.find_spec(name) is not None
