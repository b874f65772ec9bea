"""What the inputs of a plan are: the files that a stage opens, the hash of their contents, and where they must not lie."""

import os
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from awescli.artifacts import file_hash, table_hash
from awescli.notation.errors import BadInput
from awescli.stages.base import Stage
from awescli.stages.plan import Plan

FLIGHT = "flight"
"""The plan's key, and the name of every setting, whose path is a flight: a folder or a YAML file that stands for several files."""


def files_of(key: str, path: Path) -> dict[str, Path]:
    """What each file of the input is -> the file. key: `flight`, `kite`, or the name of a setting. Raises BadInput for a flight that
    cannot be found."""
    if key == FLIGHT:
        from awescli.flightlog.files import find_flight

        return find_flight(path).opened()
    return {key: path}


def input_hash(key: str, path: Path) -> str:
    """sha256 of what an input holds, whatever its files are called and wherever they lie. Raises BadInput for what cannot be read."""
    files = files_of(key, path)
    # a flight of an hour takes a second to hash: once, unless one of its files has changed
    return _hash(tuple((what, file, _state(file)) for what, file in files.items()))


def _state(file: Path) -> tuple[int, ...]:
    """What changes when somebody writes to a file, or puts another in its place; empty where there is none."""
    try:
        found = os.stat(file)
    except OSError:
        return ()
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns


@cache
def _hash(files: tuple[tuple[str, Path, tuple[int, ...]], ...]) -> str:
    return table_hash({what: file_hash(file) for what, file, _ in files})


def refuse_own_inputs(plan: Plan, stages: Sequence[Stage], names: Sequence[str]) -> None:
    """Raise BadInput where an input lies in the results of a stage that is to run: it would be replaced while it is used."""
    inputs = [("kite", plan.kite), ("flight", plan.flight)]
    for stage in stages:
        if stage.name in names:
            inputs += _paths(plan.settings[stage.name].model_dump(by_alias=True), stage.name)
    for key, path in inputs:
        for file in files_of(key.rpartition(".")[2], path).values():
            for name in names:
                if file.resolve().is_relative_to((plan.out / name).resolve()):
                    do = "Copy it elsewhere, or write to another folder: --set out=FOLDER."
                    raise BadInput(f"{file} lies in the results of {name}, which would replace it", f"{plan.file}: {key}", do)


def _paths(tree: Any, prefix: str) -> list[tuple[str, Path]]:
    """Dotted key and path of every path in the settings of a stage that exists."""
    if isinstance(tree, Path):
        return [(prefix, tree)] if tree.exists() else []
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, (list, tuple)) else ()
    return [found for key, value in items for found in _paths(value, f"{prefix}.{key}")]
