"""How results look: sentences as text, tables as frames, both as HTML in a notebook."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import polars

MOST_ROWS = 60
"""Rows of a table in a notebook; `to_frame()` has all."""


def frame(rows: Iterable[Mapping[str, Any]] | Mapping[str, Any]) -> "polars.DataFrame":
    """Rows, or name -> column, as a polars DataFrame."""
    import polars

    if isinstance(rows, Mapping):
        return polars.DataFrame(dict(rows))
    return polars.DataFrame(list(rows), infer_schema_length=None)


def as_html(title: str, sentences: Sequence[str], table: "polars.DataFrame | None" = None) -> str:
    """A title, sentences, and a table: plain HTML, all text escaped."""
    import polars

    from awescli.reporting.rendering import rendered, trusted

    shown = ""
    if table is not None:
        with polars.Config(
            tbl_rows=MOST_ROWS, tbl_cols=20, float_precision=4, tbl_hide_dataframe_shape=True, tbl_hide_column_data_types=True
        ):
            shown = table._repr_html_()
    return rendered("result.html", title=title, sentences=sentences, table=trusted(shown))


def as_text(title: str, sentences: Sequence[str]) -> str:
    """The same without the table."""
    return "\n  ".join([f"{title}: {sentences[0]}" if sentences else title, *sentences[1:]])
