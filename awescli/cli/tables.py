"""Values as the terminal and --json show them."""

from collections.abc import Mapping
from typing import Any


def printable(text: str) -> str:
    """Text that a terminal only shows: what would move its cursor, colour it, ring or turn its writing round stands there as \\x1b.

    Names, cells and notes come from users' files. Line ends and tabs stay.
    """
    if text.isprintable():
        return text
    return "".join(c if c in "\n\t" or c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def rich_table(content: Mapping[str, Any]) -> Any:
    """A rich table: rows of columns, or names and values."""
    from rich.table import Table
    from rich.text import Text

    rows = [row for row in content.values() if isinstance(row, Mapping)]
    columns = list(dict.fromkeys(key for row in rows for key in row)) or [""]
    table = Table(box=None, show_header=bool(rows), padding=(0, 2, 0, 0))
    table.add_column("")
    cells = [[row.get(c, "") for c in columns] if isinstance(row, Mapping) else [row] for row in content.values()]
    for i, column in enumerate(columns):
        sentences = any(len(text_of(row[i])) > 24 for row in cells if i < len(row))
        table.add_column(Text(printable(str(column))), justify="left" if sentences else "right")
    for name, row in zip(content, cells, strict=True):
        table.add_row(Text(printable(f"  {name}")), *(Text(text_of(cell)) for cell in row))
    return table


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
