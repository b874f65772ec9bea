"""Numbers of a kite file that its user has still to fill in: `value: fill_in`, as the template of `awes init` writes them."""

from collections.abc import Mapping
from typing import Any

from awescli.notation.document import Document
from awescli.notation.errors import BadInput
from awescli.physics.parameter_words import MEANINGS

FILL_IN = "fill_in"


def unfilled(document: Document) -> tuple[Document, list[BadInput]]:
    """(the document with a stand-in for every number that is still to be filled in, one error for each of them).

    With the stand-ins everything else in the file can be checked in the same go.
    """
    declared = document.data.get("parameters") if isinstance(document.data, dict) else None
    rows = declared if isinstance(declared, dict) else {}
    open_rows = {n: row for n, row in rows.items() if _is_open(row)}
    if not open_rows:
        return document, []
    errors = []
    for name, row in open_rows.items():
        meaning, unit = MEANINGS.get(name, ("", "")), row.get("unit", "-")
        said = f": {meaning[1]}" if meaning[1] else ""
        errors.append(BadInput(f"to be filled in{said} [{unit}]", document.where("parameters", name)))
    parameters = {n: {**row, "value": _stand_in(row)} if n in open_rows else row for n, row in rows.items()}
    return Document(document.source, {**document.data, "parameters": parameters}, document.places, document.omit), errors


def _is_open(row: Any) -> bool:
    return isinstance(row, Mapping) and row.get("value") == FILL_IN


def _stand_in(row: Mapping[str, Any]) -> float:
    """A number inside the row's bounds."""
    lower, upper = (row.get(end) if isinstance(row.get(end), (int, float)) else None for end in ("lower", "upper"))
    if lower is not None and upper is not None:
        return (lower + upper) / 2
    return lower if lower is not None else upper if upper is not None else 1.0
