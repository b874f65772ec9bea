"""A CSV file -> float columns by name. Says what is wrong with the text; knows nothing of flights or units."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from awescli.flightlog.rows import Rows, read_rows
from awescli.notation.errors import BadInput
from awescli.notation.regular_files import open_regular

HEADER_LIMIT = 65536
"""Bytes: a longer first line is not a header."""

MISSING = ("", "nan", "na", "n/a", "null", "none", "-", "inf", "-inf", "+inf", "infinity")
"""What loggers write where they have no value (compared in lower case)."""

ABSURD = 1e20
"""No sensor and no clock reports more (unix time in ns is 2e18): such a number is a broken cell, and its square would overflow."""

GARBAGE_SHARE = 0.05
"""A column with more unreadable cells than this is not a column of numbers; with fewer, those cells are dropouts."""

LOOKED_AT = 20
"""Lines after the header in which a table has a number."""


@dataclass(frozen=True)
class Table:
    """Columns of one CSV file.

    path: where it came from; columns: name -> (N,) float64, NaN where the cell is empty or unreadable, and in whole rows that have
    another number of cells than the others; others: names in the file that were not asked for; notes: what was odd, one sentence each.
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
        with open_regular(path) as file:
            first = file.readline(HEADER_LIMIT + 1)
            after = [file.readline(HEADER_LIMIT) for _ in range(LOOKED_AT)]
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
    # what no log looks like is not quoted in messages: it may be any file of the machine
    cells = (cell for row in after for cell in row.decode("utf-8", errors="replace").split(separator))
    if len(names) < 2 or not any(_is_number(cell.strip().strip('"').replace(",", ".")) for cell in cells):
        what = "there is a header but no samples" if not any(row.strip() for row in after) else "this is no table of numbers"
        raise BadInput(what, str(path), "Expected text: a line of column names, then one row a sample. Is it the right file, and complete?")
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
    rows = read_rows(path, separator, len(names))
    frame = _read_columns(path, separator, names, wanted, pl.Float64, rows)
    notes = list(rows.notes)
    columns = {}
    series = dict(zip(wanted, frame.get_columns(), strict=True))
    whole = rows.whole[rows.first :]
    incomplete = [name for name in wanted if (series[name].is_null().to_numpy() & whole).any()]
    texts = {}
    if incomplete:
        texts = dict(zip(incomplete, _read_columns(path, separator, names, incomplete, pl.String, rows).get_columns(), strict=True))
    for name, column in series.items():
        if name in texts:
            notes += _explain_missing(path, name, column, texts[name], rows)
        values = np.full(rows.whole.size, np.nan)
        values[rows.first :] = column.to_numpy()
        values[~(np.abs(values) < ABSURD) | ~rows.whole] = np.nan
        columns[name] = values
    return Table(path, columns, tuple(n for n in names if n not in wanted), tuple(notes))


def read_text(path: Path, name: str) -> list[str]:
    """The cells of one column as they stand in the file, in the rows of `read_table`: "" where the cell is empty, or where the row has
    another number of cells than the others. Raises BadInput as `read_table` does."""
    separator, names = read_header(path)
    if names.count(name) != 1:
        raise BadInput(f"{names.count(name) or 'no'} columns are called '{name}'", f"{path}:1", "One is needed.")
    _refuse_truncated(path, separator, len(names))
    rows = read_rows(path, separator, len(names))
    cells = _read_columns(path, separator, names, [name], pl.String, rows).get_columns()[0].fill_null("").to_list()
    return [cell if whole else "" for cell, whole in zip([""] * rows.first + cells, rows.whole, strict=True)]


def _read_columns(
    path: Path, separator: str, names: tuple[str, ...], wanted: list[str], dtype: type[pl.DataType], rows: Rows
) -> pl.DataFrame:
    """The wanted columns from the first whole row on, in that order, under the names column_i; what is not of `dtype` becomes null."""
    # the file's own names may repeat; a schema by position cannot clash, and keeps a short first row from hiding columns
    schema: dict[str, type[pl.DataType]] = {f"column_{i}": pl.String for i in range(rows.cells)}
    picked = [f"column_{names.index(name)}" for name in wanted]
    schema |= {name: dtype for name in picked}
    first = rows.text
    try:
        frame = pl.read_csv(
            path,
            has_header=False,
            skip_lines=1 + rows.first,
            schema=schema,
            columns=picked,
            separator=separator,
            ignore_errors=True,
            truncate_ragged_lines=True,
            encoding="utf8-lossy",
            decimal_comma=separator == ";" and dtype == pl.Float64 and b"," in first,
            quote_char='"' if rows.quoted else None,
        )
    except (pl.exceptions.PolarsError, OSError, ValueError, OverflowError) as e:
        raise BadInput(
            f"not a readable CSV file ({str(e).splitlines()[0][:120]})", str(path), "Open it in an editor; export it again."
        ) from None
    if frame.height != rows.whole.size - rows.first:
        raise BadInput("the rows cannot be distinguished (quotes that do not close)", str(path), "Export it without quotes.")
    return frame.select(picked)


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


def _explain_missing(path: Path, name: str, column: pl.Series, text: pl.Series, rows: Rows) -> list[str]:
    """Notes about the null cells of a column in whole rows, by its text: empty ones, and unreadable ones with the line of the first."""
    missing = column.is_null() & pl.Series(rows.whole[rows.first :])
    cells = text.filter(missing).fill_null("").str.strip_chars()
    unreadable = ~cells.str.to_lowercase().is_in(list(MISSING))
    bad = int(unreadable.sum())
    if not bad:
        return [f"{path.name}: column {name} has {int(missing.sum())} empty cells."]
    at = rows.first + int(np.flatnonzero(missing.to_numpy())[int(unreadable.arg_max() or 0)])
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
