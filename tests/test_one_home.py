"""What is written once stays written once, and what nobody calls is gone."""

import ast
import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parent.parent
FILES = sorted((ROOT / "awescli").rglob("*.py"))
CALLED_BY_LIBRARIES = {"_repr_png_", "init_arrays_fast", "_step_func", "dask_setup"}
"""Names that a notebook, pymavlink, torchdiffeq and Dask look for."""


def files_with(pattern: str) -> set[str]:
    return {p.relative_to(ROOT / "awescli").as_posix() for p in FILES if re.search(pattern, p.read_text())}


def test_nothing_is_left_that_nobody_calls():
    """Guards against dead code: every function and class of awes is named a second time in the package, its benchmarks or its examples.
    What a decorator registers (commands, validators, properties) is called by whoever it is registered with."""
    texts = [p.read_text() for d in ("awescli", "benchmarks", "examples") for p in (ROOT / d).rglob("*.py")]
    words = Counter(word for text in texts for word in re.findall(r"\w+", text))
    for file in FILES:
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.decorator_list and not node.name.startswith("__"):
                assert words[node.name] > 1 or node.name in CALLED_BY_LIBRARIES, f"{file}:{node.lineno}: {node.name}"


def test_a_dataclass_tells_of_fields_that_it_has():
    """Guards against words that outlived what they were about: what a dataclass's docstring explains (`name: ...`) is one of its own."""
    explained = re.compile(r"(?:^|[;.]\s+|\n\n)([a-z_]+(?:, [a-z_]+)*): ")
    for file in FILES:
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ClassDef) and any("dataclass" in ast.unparse(d) for d in node.decorator_list):
                own = {n.target.id for n in node.body if isinstance(n, ast.AnnAssign)} | {n.name for n in node.body if hasattr(n, "name")}
                told = {name for words in explained.findall(ast.get_docstring(node) or "") for name in words.split(", ")}
                assert told <= own, f"{file}:{node.lineno}: {node.name} has no {', '.join(sorted(told - own))}"


def test_local_quadratics_have_one_home():
    """Guards the window of a local quadratic, which stood in four files. (A law's samples are smoothed by cubics.)"""
    assert files_with(r"savgol_filter\(.*, 2\b") == {"flightlog/smoothing.py"}
    assert files_with(r"import .*savgol_filter") == {"flightlog/smoothing.py", "controller_fit/samples.py"}


def test_angles_are_wrapped_in_one_place():
    """Guards (-pi, pi]: how an angle is wrapped stood in three files."""
    assert files_with(r"np\.pi\)? % \(2 \* np\.pi\)|np\.pi - \(np\.pi|np\.mod\(np\.pi [+-] ") == {"notation/angles.py"}


def test_what_a_lost_sample_costs_is_said_once():
    """Guards the price of divergence, which stood as a number in three files: whoever charges it takes it from one place."""
    assert files_with(r"DIVERGED_COST = ") == {"estimation/misfit.py"}
    assert not files_with(r"\b25\.0 \*")


def test_what_counts_as_detectable_is_said_once():
    """Guards a threshold of the tracing that stood as a number in two files: its criteria name it."""
    assert files_with(r"detectable: float = 3\.5") == {"tracing/criteria.py"} and not files_with(r"\b3\.5 \*")


def test_the_height_of_a_lone_station_is_said_once():
    """Guards a default that stood in four files."""
    assert files_with(r"\(10\.0,\)") == {"physics/kite.py"}


def test_a_frames_coefficients_are_said_once():
    """Guards the table of coefficients per frame, which stood in two files."""
    assert files_with(r'"CX", "CY", "CZ", "Cl"') == {"physics/effects/aerodynamics.py"}
