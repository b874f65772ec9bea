"""What the inputs of a plan are: the files that a stage opens, and the hash of their contents."""

import os
from functools import cache
from pathlib import Path

from awescli.artifacts import file_hash, table_hash

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
