"""Values and tables as the terminal and --json show them: no line is wider than it may be."""

import re
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

GAP = "  "
INDENT = "  "
SENTENCE = 24
"""Characters from which a cell is a sentence: it may be broken, numbers and names may not."""
NARROW = 24
"""Characters below which a sentence is not squeezed into a column but stands below its row."""

NUMBER = re.compile(r"([-+]?[\d.]+(e[-+]?\d+)?( %)?|-|nan|[-+]?inf)?")
"""Cells that are aligned at the right."""

Rows = list[tuple[str, dict[str, str]]]
"""(name of the row, column -> cell), cells as text."""


def table_lines(content: Mapping[str, Any], width: int = 80) -> list[str]:
    """Rows of columns, or names and values, in lines of at most `width` characters.

    A table that is too wide is turned (its rows become columns) where that helps; else sentences are broken or put below their rows, and
    what is left is cut into blocks of columns.
    """
    columns = list(dict.fromkeys(text_of(key) for row in content.values() if isinstance(row, Mapping) for key in row)) or [""]
    rows = [(text_of(name), _cells(row, columns)) for name, row in content.items()]
    if _natural(rows, columns) > width:
        turned = [(c, {name: row[c] for name, row in rows}) for c in columns]
        names = [name for name, _ in rows]
        if not _sentences(rows, columns) and _natural(turned, names) <= width:
            rows, columns = turned, names
    if max(len(name) for name, _ in rows) > width // 2 and _natural(rows, columns) > width:
        return _stacked(rows, columns, width)
    return _fitted(rows, columns, width)


def _cells(row: Any, columns: Sequence[str]) -> dict[str, str]:
    """A row as text; a value that is no row stands in the first column."""
    if isinstance(row, Mapping):
        found = {text_of(key): text_of(value) for key, value in row.items()}
        return {c: found.get(c, "") for c in columns}
    return {c: text_of(row) if i == 0 else "" for i, c in enumerate(columns)}


def _sentences(rows: Rows, columns: Sequence[str]) -> list[str]:
    return [c for c in columns if max(len(row[c]) for _, row in rows) > SENTENCE]


def _widths(rows: Rows, columns: Sequence[str]) -> dict[str, int]:
    return {c: max(len(c), *(len(row[c]) for _, row in rows)) for c in columns}


def _natural(rows: Rows, columns: Sequence[str]) -> int:
    """Characters of the widest line, if nothing gives way."""
    return len(INDENT) + max(len(name) for name, _ in rows) + sum(len(GAP) + w for w in _widths(rows, columns).values())


def _fitted(rows: Rows, columns: Sequence[str], width: int) -> list[str]:
    """The lines of a table, whatever has to give way."""
    if _natural(rows, columns) <= width:
        return _plain(rows, columns)
    if sentences := _sentences(rows, columns):
        short = [c for c in columns if c not in sentences]
        left = width - _natural(rows, short) - len(GAP) * len(sentences)
        if left >= NARROW * len(sentences):
            return _plain(_broken(rows, sentences, left // len(sentences)), columns)
        return _below(rows, short, sentences, width)
    # blocks of as many columns as fit beside the names
    lines: list[str] = []
    block: list[str] = []
    for column in columns:
        if block and _natural(rows, [*block, column]) > width:
            lines += _plain(rows, block)
            block = []
        block.append(column)
    return lines + _plain(rows, block)


def _plain(rows: Rows, columns: Sequence[str]) -> list[str]:
    """One line a row; a line of column names above, where there are any."""
    names, widths = max(len(name) for name, _ in rows), _widths(rows, columns)
    words = {c: not all(NUMBER.fullmatch(row[c]) for _, row in rows) for c in columns}

    def line(name: str, row: Mapping[str, str]) -> str:
        shown = (f"{row[c]:<{widths[c]}}" if words[c] else f"{row[c]:>{widths[c]}}" for c in columns)
        return f"{INDENT}{name:<{names}}{''.join(GAP + cell for cell in shown)}".rstrip()

    head = [line("", {c: c for c in columns})] if any(columns) else []
    return [*head, *(line(name, row) for name, row in rows)]


def _broken(rows: Rows, sentences: Sequence[str], room: int) -> Rows:
    """The rows with their sentences broken into further rows without a name."""
    found: Rows = []
    for name, row in rows:
        parts = {c: (wrapped(text, room) or [""]) if c in sentences else [text] for c, text in row.items()}
        for i in range(max(map(len, parts.values()))):
            found.append((name if i == 0 else "", {c: p[i] if i < len(p) else "" for c, p in parts.items()}))
    return found


def _below(rows: Rows, short: Sequence[str], sentences: Sequence[str], width: int) -> list[str]:
    """Every row without its sentences, which follow in lines of their own."""
    table = _fitted(rows, short, width) if short else [f"{INDENT}{name}" for name, _ in rows]
    head = table[: len(table) - len(rows)]
    if len(head) > 1:  # cut into blocks: the sentences come after all of them
        return [*table, *(line for _, row in rows for c in sentences for line in _hung(row[c], width))]
    lines = list(head)
    for line, (_, row) in zip(table[len(head) :], rows, strict=True):
        lines += [line, *(text for c in sentences for text in _hung(row[c], width))]
    return lines


def _stacked(rows: Rows, columns: Sequence[str], width: int) -> list[str]:
    """Names in lines of their own, their cells below: names that leave no room beside them."""
    lines = []
    for name, row in rows:
        lines += wrapped(name, width, INDENT, 2 * INDENT)
        lines += _hung(GAP.join(f"{c} {row[c]}".strip() for c in columns if row[c]), width)
    return lines


def _hung(text: str, width: int) -> list[str]:
    return wrapped(text, width, 2 * INDENT, 2 * INDENT)


def wrapped(text: str, width: int, first: str = "", further: str = "") -> list[str]:
    """A sentence in lines of at most `width` characters, broken between words; first, further: what lines begin with."""
    return textwrap.wrap(text, width, initial_indent=first, subsequent_indent=further, break_on_hyphens=False)


def printable(text: str) -> str:
    """Text that a terminal only shows: what would move its cursor, colour it, ring or turn its writing round stands there as \\x1b.

    Names, cells and notes come from users' files. Line ends and tabs stay.
    """
    if text.isprintable():
        return text
    return "".join(c if c in "\n\t" or c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def text_of(value: Any) -> str:
    """A number with four figures, a truth value as a word, all else as it is, but printable."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if hasattr(value, "item") and getattr(value, "ndim", 1) == 0:
        value = value.item()
    return f"{value:.4g}" if isinstance(value, float) else printable(str(value))


def json_safe(value: Any) -> Any:
    """Plain JSON values; what is not finite becomes text."""
    if isinstance(value, Mapping):
        return {str(k): json_safe(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [json_safe(v) for v in value]
    if isinstance(value, float):
        return value if value == value and abs(value) != float("inf") else str(value)
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
