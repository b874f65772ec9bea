"""What a result was made from: hashes of contents, versions of packages, the machine."""

import hashlib
import os
import platform
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from awescli import __version__
from awescli.notation.errors import BadInput
from awescli.notation.regular_files import open_regular

PROVENANCE = "provenance.json"
"""Beside the artifacts of every stage; holds times, so it takes no part in their hashes."""

MOST_HASHED = 8_000_000_000
"""Bytes of one file: a log of a day at 50 Hz is a fifth of it, and a file that claims more is not read through."""
AT_ONCE = 1 << 20
"""Bytes read at a time."""

NUMBERS_DEPEND_ON = (
    "daqp", "jinja2", "llvmlite", "markupsafe", "matplotlib", "numpy", "plotly", "polars", "pydantic", "pyyaml", "safetensors", "scipy",
    "threadpoolctl", "torch", "torchdiffeq",
)  # fmt: skip
"""Packages whose version may change an artifact: solvers, compilers, readers, what draws. Only the terminal's (rich, typer) may not."""


def file_hash(path: Path) -> str:
    """sha256 of one file. Raises BadInput for what cannot be read, is no regular file, or is larger than MOST_HASHED."""
    try:
        with open_regular(path, MOST_HASHED) as file:
            digest = hashlib.sha256()
            while part := file.read(AT_ONCE):
                digest.update(part)
            return digest.hexdigest()
    except OSError as e:
        raise BadInput(f"cannot be read ({e.strerror or e})", str(path), "Check the path and its permissions.") from None


def artifact_hashes(folder: Path) -> dict[str, str]:
    """File name -> sha256 of everything in a stage's folder but hidden files and the provenance (which holds times)."""
    return {name: file_hash(file) for name, file in _shown_files(folder) if name != PROVENANCE}


def _shown_files(folder: Path) -> Iterator[tuple[str, Path]]:
    """(name in the folder, file) of what is neither hidden nor a cache, in the order of names."""
    for file in sorted(folder.rglob("*")):
        relative = file.relative_to(folder)
        if not any(part.startswith(".") or part == "__pycache__" for part in relative.parts) and file.is_file():
            yield relative.as_posix(), file


def table_hash(table: Mapping[str, str]) -> str:
    """One sha256 for a table of names and hashes (or other text)."""
    return hashlib.sha256("\n".join(f"{k}\0{v}" for k, v in sorted(table.items())).encode()).hexdigest()


def versions() -> dict[str, str]:
    """Versions of what the numbers depend on."""
    return {"awes": __version__, "python": platform.python_version(), **_installed()}


@cache
def _installed() -> dict[str, str]:
    """Of packages, from their metadata: importing torch for it would take seconds, and reading these for every stage takes one."""
    found = {}
    for package in NUMBERS_DEPEND_ON:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def machine() -> dict[str, Any]:
    """What the last bits of the numbers may depend on besides versions."""
    return {"system": platform.system(), "machine": platform.machine(), "libc": " ".join(platform.libc_ver()), "cores": os.cpu_count()}
