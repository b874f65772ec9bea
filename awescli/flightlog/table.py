"""A CSV file -> float columns by name. Says what is wrong with the text; knows nothing of flights or units."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from awescli.notation.errors import BadInput

HEADER_LIMIT = 65536
"""Bytes: a longer first line is not a header."""

MISSING = ("", "nan", "na", "n/a", "null", "none", "-", "inf", "-inf", "+inf", "infinity")
"""What loggers write where they have no value (compared in lower case)."""

ABSURD = 1e20
"""No sensor and no clock reports more (unix time in ns is 2e18): such a number is a broken cell, and its square would overflow."""

GARBAGE_SHARE = 0.05
"""A column with more unreadable cells than this is not a column of numbers; with fewer, those cells are dropouts."""


@dataclass(frozen=True)
class Table:
    """Columns of one CSV file.

    path: where it came from; columns: name -> (N,) float64, NaN where the cell is empty or unreadable; others: names in
    the file that were not asked for; notes: what was odd, one sentence each.
    """

    path: Path
    columns: Mapping[str, np.ndarray]
    others: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))


def read_header(path: Path) -> tuple[str, tuple[str, ...]]:
    """(separator, column names) of a CSV file; raises BadInput where the file is not a CSV with a header."""
    try:
        with open(path, "rb") as file:
            first = file.readline(HEADER_LIMIT + 1)
    except (OSError, ValueError) as e:
        raise BadInput(f"cannot be read ({getattr(e, 'strerror', None) or e})", str(path), "Check the path and its permissions.") from None
    if not first.strip():
        raise BadInput(
            "the file is empty" if not first else "the first line is empty", f"{path}:1", "The first line must name the columns."
        )
    if len(first) > HEADER_LIMIT or b"\0" in first:
        raise BadInput("this is not a CSV file", str(path), "Expected text: a line of column names, then one row a sample.")
    text = first.decode("utf-8-sig", errors="replace").strip("\r\n")
    separator = max((",", ";", "\t"), key=text.count)
    names = tuple(name.strip().strip('"') for name in text.split(separator))
    if all(_is_number(name) for name in names):
        raise BadInput("the first line holds numbers, not column names", f"{path}:1", "Put a line with the column names on top.")
    return separator, names


def read_table(path: Path, wanted: Iterable[str]) -> Table:
    """Those of the `wanted` columns that the file has, as float64.

    Raises BadInput for an unreadable, empty or truncated file and for a column that does not hold numbers.
    """
    separator, names = read_header(path)
    wanted = [name for name in dict.fromkeys(wanted) if name in names]
    for name in wanted:
        if names.count(name) > 1:
            raise BadInput(f"{names.count(name)} columns are called '{name}'", f"{path}:1", "Rename or remove all but one.")
    _refuse_truncated(path, separator, len(names))
    frame = _read_columns(path, separator, names, wanted, pl.Float64)
    if frame.height == 0:
        raise BadInput("there is a header but no samples", str(path), "Is the file complete? Copy it again.")
    notes: list[str] = []
    columns = {}
    series = dict(zip(wanted, frame.get_columns(), strict=True))
    incomplete = [name for name in wanted if series[name].null_count()]
    texts = {}
    if incomplete:
        texts = dict(zip(incomplete, _read_columns(path, separator, names, incomplete, pl.String).get_columns(), strict=True))
    for name, column in series.items():
        if name in texts:
            notes += _explain_missing(path, name, column, texts[name])
        values = column.to_numpy().astype(float, copy=True)
        values[~(np.abs(values) < ABSURD)] = np.nan
        columns[name] = values
    return Table(path, columns, tuple(n for n in names if n not in wanted), tuple(notes))


def read_text(path: Path, name: str) -> list[str]:
    """The cells of one column as they stand in the file, empty ones as "". Raises BadInput as `read_table` does."""
    separator, names = read_header(path)
    if names.count(name) != 1:
        raise BadInput(f"{names.count(name) or 'no'} columns are called '{name}'", f"{path}:1", "One is needed.")
    return _read_columns(path, separator, names, [name], pl.String).get_columns()[0].fill_null("").to_list()


def _read_columns(path: Path, separator: str, names: tuple[str, ...], wanted: list[str], dtype) -> pl.DataFrame:
    """The wanted columns, in that order, under the names column_i; cells that are not of `dtype` become null."""
    # the file's own names may repeat; a schema by position cannot clash, and keeps a short first row from hiding columns
    schema = {f"column_{i}": pl.String for i in range(len(names))}
    picked = [f"column_{names.index(name)}" for name in wanted]
    schema.update(dict.fromkeys(picked, dtype))
    first = _first_row(path)
    try:
        frame = pl.read_csv(
            path,
            has_header=False,
            skip_lines=1,
            schema=schema,
            columns=picked,
            separator=separator,
            ignore_errors=True,
            truncate_ragged_lines=True,
            encoding="utf8-lossy",
            decimal_comma=separator == ";" and dtype == pl.Float64 and b"," in first,
            # a stray quote in a file of bare numbers must not swallow the rows after it
            quote_char='"' if first.count(b'"') and first.count(b'"') % 2 == 0 else None,
        )
    except (pl.exceptions.PolarsError, OSError, ValueError, OverflowError) as e:
        raise BadInput(
            f"not a readable CSV file ({str(e).splitlines()[0][:120]})", str(path), "Open it in an editor; export it again."
        ) from None
    return frame.select(picked)


def _first_row(path: Path) -> bytes:
    """The line after the header: it shows how the file writes its cells."""
    with open(path, "rb") as file:
        file.readline(HEADER_LIMIT)
        return file.readline(HEADER_LIMIT)


def _refuse_truncated(path: Path, separator: str, width: int) -> None:
    """A last line without line end and with too few cells is what an interrupted copy leaves behind."""
    with open(path, "rb") as file:
        file.seek(0, 2)
        size = file.tell()
        file.seek(max(0, size - HEADER_LIMIT))
        tail = file.read()
    last = tail.rsplit(b"\n", 1)[-1]
    if last.strip() and b"\n" in tail and last.count(separator.encode()) + 1 < width:
        with open(path, "rb") as file:
            line = sum(block.count(b"\n") for block in iter(lambda: file.read(1 << 20), b"")) + 1
        cells = last.count(separator.encode()) + 1
        raise BadInput(
            f"the file is cut off: its last line has {cells} of {width} columns",
            f"{path}:{line}",
            "Copy the file again; or delete that line, if the flight up to there is enough.",
        )


def _explain_missing(path: Path, name: str, column: pl.Series, text: pl.Series) -> list[str]:
    """Notes about the null cells of a column, by its text: empty ones, and unreadable ones with the line of the first."""
    if len(text) != len(column):
        raise BadInput("the rows cannot be told apart (quotes that do not close)", f"{path}: column {name}", "Export it without quotes.")
    missing = column.is_null()
    cells = text.filter(missing).fill_null("").str.strip_chars()
    unreadable = ~cells.str.to_lowercase().is_in(list(MISSING))
    bad = int(unreadable.sum())
    if not bad:
        return [f"{path.name}: column {name} has {int(missing.sum())} empty cells."]
    at = int(np.flatnonzero(missing.to_numpy())[int(unreadable.arg_max() or 0)])
    example = str(cells.filter(unreadable)[0])[:30]
    if bad > GARBAGE_SHARE * len(column):
        raise BadInput(
            f"'{example}' is not a number ({bad} of {len(column)} cells of column {name} are not)",
            f"{path}:{at + 2}: column {name}",
            "Is this the right column? Decimal points, one number a cell, nothing else.",
        )
    return [f"{path.name}:{at + 2}: column {name} holds '{example}'; {bad} unreadable cells were taken as missing."]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
