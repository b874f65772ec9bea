"""The rows of a CSV file before anybody reads their cells: how many cells each has, so that a row that lost one is not read as shifted."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from awescli.notation.errors import BadInput
from awescli.notation.regular_files import open_regular

BLOCK = 1 << 23
"""Bytes looked at in one go."""
MOST_RAGGED = 0.2
"""Share of rows with another number of cells than most, beyond which nobody knows which are right."""
LONGEST = 65536
"""Bytes of a row that are kept as text."""


@dataclass(frozen=True)
class Rows:
    """whole: (N,) bool, rows that have as many cells as most; cells: how many those have; first: index of the first of them; text: its
    text; quoted: whether cells stand in quotes; notes: what was odd."""

    whole: np.ndarray
    cells: int
    first: int
    text: bytes
    quoted: bool
    notes: tuple[str, ...]


def read_rows(path: Path, separator: str, width: int) -> Rows:
    """The rows below the header of `width` names. Raises BadInput where there are none, or where most do not fit the header."""
    text = _row(path, 0)
    # a stray quote in a file of bare numbers must not swallow the rows after it
    quoted = text.count(b'"') > 0 and text.count(b'"') % 2 == 0
    found = list(_counts(path, separator, quoted))
    cells = np.concatenate([counts for counts, _ in found]) if found else np.empty(0, int)
    blank = np.concatenate([empty for _, empty in found]) if found else np.empty(0, bool)
    if blank.all():
        raise BadInput("there is a header but no samples", str(path), "Is the file complete? Copy it again.")
    usual = int(np.bincount(cells[~blank]).argmax())
    whole = (cells == usual) & ~blank
    first = int(whole.argmax())
    # one separator more at the end of every row is what some programs write
    if usual != width and not (usual == width + 1 and _row(path, first).strip(b"\r\n ").endswith(separator.encode())):
        do = "Give every column a name, and every row as many cells as there are names."
        raise BadInput(f"most rows have {usual} cells, and the header names {width} columns", f"{path}:{first + 2}", do)
    ragged = ~whole & ~blank
    count = int(ragged.sum())
    if count > MOST_RAGGED * cells.size:
        what = f"{count} of {cells.size} rows do not have {usual} cells"
        raise BadInput(what, f"{path}:{int(ragged.argmax()) + 2}", "Export the file again, without quotes and comments.")
    notes = []
    if count:
        notes.append(f"{path.name}:{int(ragged.argmax()) + 2}: {count} rows do not have {usual} cells; they were left out.")
    # blank lines at the end are no samples
    inside = int(np.flatnonzero(~blank)[-1]) + 1
    if between := int(blank[:inside].sum()):
        notes.append(f"{path.name}:{int(blank.argmax()) + 2}: {between} blank lines were left out.")
    return Rows(whole, usual, first, _row(path, first), quoted, tuple(notes))


def _row(path: Path, index: int) -> bytes:
    """Row `index` below the header, as much of it as shows how the file writes its cells."""
    with open_regular(path) as file:
        for _ in range(index + 1):
            while (piece := file.readline(LONGEST)) and not piece.endswith(b"\n"):
                pass
        return file.readline(LONGEST)


def _counts(path: Path, separator: str, quoted: bool) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """(cells of each row, whether it is blank) below the header, block by block."""
    with open_regular(path) as file:
        while (piece := file.readline(LONGEST)) and not piece.endswith(b"\n"):
            pass
        rest = b""
        while block := file.read(BLOCK):
            text = np.frombuffer(rest + block, np.uint8)
            ends = _ends(text, quoted)
            last = int(ends[-1]) + 1 if ends.size else 0
            if last:
                yield _of_lines(text[:last], ends, separator, quoted)
            rest = text[last:].tobytes()
            if len(rest) > BLOCK:
                raise BadInput(f"a row of more than {BLOCK / 1e6:.0f} MB", str(path), "Is this a CSV file? Do its quotes close?")
        if rest:
            text = np.frombuffer(rest + b"\n", np.uint8)
            yield _of_lines(text, np.array([text.size - 1]), separator, quoted)


def _ends(text: np.ndarray, quoted: bool) -> np.ndarray:
    """Where rows end."""
    ends = text == ord("\n")
    return np.flatnonzero(ends & ~_in_quotes(text) if quoted else ends)


def _in_quotes(text: np.ndarray) -> np.ndarray:
    return np.cumsum(text == ord('"'), dtype=np.uint8) % 2 == 1


def _of_lines(text: np.ndarray, ends: np.ndarray, separator: str, quoted: bool) -> tuple[np.ndarray, np.ndarray]:
    """(cells, blank) of the rows that end at `ends`."""
    begins = np.concatenate([[0], ends[:-1] + 1])
    between = text == ord(separator)
    if quoted:
        between &= ~_in_quotes(text)
    length = ends - begins
    returned = (length == 1) & (text[begins] == ord("\r"))
    return np.add.reduceat(between, begins, dtype=np.int64) + 1, (length == 0) | returned
