"""The house keeps its floors: no import goes up or sideways, and each side effect has one home."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "awescli"

FLOORS = {
    "notation": 0,
    "flightlog": 1, "artifacts": 1, "engine": 1,
    "physics": 2, "control": 2,
    "simulation": 3, "controller_fit": 3,
    "estimation": 4,
    "learning": 5, "tracing": 5,
    "reporting": 6, "export": 6,
    "stages": 7,
    "cli": 8, "api": 8,
    "__main__": 9,
}  # fmt: skip

HEAVY = {"numpy", "scipy", "torch", "torchdiffeq", "polars", "llvmlite", "plotly", "matplotlib", "safetensors", "jinja2"}

LONGEST = 400
"""Lines of a file."""

FILES = sorted(p for p in PACKAGE.rglob("*.py") if p != PACKAGE / "__init__.py")


def room_of(file: Path) -> str:
    return file.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(tree: ast.AST):
    """(line, dotted name) of every import, deferred ones included."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "absolute imports only, so that floors can be read off"
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


def top_level_imports(tree: ast.Module):
    yield from imports(ast.Module([n for n in tree.body if isinstance(n, (ast.Import, ast.ImportFrom))], []))


@pytest.fixture(params=FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def file(request):
    return request.param


@pytest.fixture
def tree(file):
    return ast.parse(file.read_text())


def test_every_room_has_a_floor(file):
    assert room_of(file) in FLOORS


def test_a_file_can_be_read_in_one_go(file):
    """Guards the size of files: what goes on for longer answers more than one question."""
    assert len(file.read_text().splitlines()) <= LONGEST


@pytest.mark.parametrize("room", [r for r in FLOORS if (PACKAGE / r).is_dir()])
def test_a_room_says_its_floor(room):
    """Guards what a reader is told first: the number in a room's first words is its floor's."""
    words = ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text()))
    assert words.startswith(f"Floor {FLOORS[room]}: "), words[:40]


def test_no_import_goes_up_or_sideways(file, tree):
    own = room_of(file)
    for line, name in imports(tree):
        parts = name.split(".")
        if parts[0] != "awescli" or len(parts) == 1 or parts[1] == "__version__":
            continue  # the package itself holds only its version
        room = parts[1]
        assert room == own or FLOORS[room] < FLOORS[own], f"{file}:{line}: {own} (floor {FLOORS[own]}) imports {name}"


def test_stages_and_cli_start_light(file, tree):
    if room_of(file) in ("stages", "cli", "artifacts") or file.name in ("errors.py", "document.py", "yaml_text.py"):
        heavy = [(line, name) for line, name in top_level_imports(tree) if name.split(".")[0] in HEAVY]
        assert not heavy, f"{file}: import these inside the function that needs them"


def calls(tree: ast.AST):
    """(line, owner, name) of every call: owner "" for plain functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            if isinstance(node.func, ast.Name):
                yield node, "", node.func.id
            elif isinstance(node.func, ast.Attribute):
                owner = node.func.value.id if isinstance(node.func.value, ast.Name) else "?"
                yield node, owner, node.func.attr


def test_only_cli_prints_and_exits(file, tree):
    if room_of(file) == "cli":
        return
    for node, owner, name in calls(tree):
        assert (owner, name) not in {("", "print"), ("", "input"), ("", "exit"), ("", "quit"), ("sys", "exit"), ("os", "_exit")}, (
            f"{file}:{node.lineno} {name}"
        )
    assert not [name for _, name in imports(tree) if name.split(".")[0] == "typer"]
    if room_of(file) != "reporting":
        assert not [name for _, name in imports(tree) if name.split(".")[0] == "rich"]


WRITERS = {"write_bytes", "savez", "savez_compressed", "savetxt", "rmtree", "mkdir", "makedirs", "unlink", "tofile"}
TEXT_OR_FILE = {"write_csv", "to_csv"}
"""Without a file name these give back the text."""
OWN_CACHE = {"engine/object_cache.py": {"mkdir", "unlink", "rename"}}
"""Compiled code is kept in the user's cache folder, which is no artifact: losing it costs a second, nothing else."""


def test_only_artifacts_writes_files(file, tree):
    if room_of(file) == "artifacts":
        return
    for node, owner, name in calls(tree):
        place = f"{file}:{node.lineno}: {owner}.{name}"
        if name == "open" and owner in ("", "io", "?"):
            modes = [a for a in [*node.args[1:2], *(k.value for k in node.keywords if k.arg == "mode")]]
            assert all(isinstance(m, ast.Constant) and not set("wax+") & set(m.value) for m in modes), place
        if name == "write_text":
            assert owner in ("", "artifacts"), place
        if name in TEXT_OR_FILE:
            assert not node.args and not {k.arg for k in node.keywords} & {"file", "path_or_buf"}, place
        if name in OWN_CACHE.get(file.relative_to(PACKAGE).as_posix(), ()):
            continue
        assert name not in WRITERS and (owner, name) not in {("np", "save"), ("torch", "save"), ("os", "replace"), ("os", "rename")}, place


def test_nothing_is_unpickled_or_evaluated(file, tree):
    assert not {name.split(".")[0] for _, name in imports(tree)} & {"pickle", "cloudpickle", "joblib", "dill", "shelve", "marshal"}
    unsafe = {("yaml", "load"), ("yaml", "unsafe_load"), ("yaml", "full_load"), ("", "eval")}
    for node, owner, name in calls(tree):
        assert (owner, name) not in unsafe, f"{file}:{node.lineno}"
