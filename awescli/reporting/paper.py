"""Every figure of the page as files for papers: PNG and SVG, and the data behind it as CSV.

matplotlib draws them (kaleido, plotly's own way to files, needs a Chrome on the machine). There is one description of a figure, the
`Figure` that the page holds; this room only hands it on.
"""

import csv
import io
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from awescli.reporting.evidence import Evidence
from awescli.reporting.html import own, story
from awescli.reporting.marks import blocks
from awescli.reporting.plots import Figure, Shared

INDEX = "figures.csv"
"""What is in each file: title, split, note."""


def figure_files(evidence: Evidence) -> Iterator[tuple[str, bytes]]:
    """(file name, content) of every figure of the page, and of their index."""
    from awescli.reporting.drawing import drawn  # matplotlib: only for who asks for files

    pieces = [piece for section in story(evidence) for piece in blocks(section.body)]
    shared = {piece.name: np.asarray(piece.values) for piece in pieces if isinstance(piece, Shared)}
    colours = light_colours()
    rows = [("figure", "title", "split", "note")]
    for figure in (piece for piece in pieces if isinstance(piece, Figure)):
        name = figure.id.removeprefix("fig-")
        for kind, content in drawn(figure, colours, shared).items():
            yield f"{name}.{kind}", content
        yield f"{name}.csv", table_of(figure, shared)
        rows.append((name, figure.title, figure.split, figure.note))
    yield INDEX, _csv(rows)


def light_colours() -> dict[str, str]:
    """Colour name -> #rrggbb: the page's light set."""
    first = own("page.css").split("}", 1)[0]
    return dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", first))


def table_of(figure: Figure, shared: Mapping[str, np.ndarray]) -> bytes:
    """series, coordinates with their units, and half-widths of intervals; an empty row where a line breaks."""
    ways, heads = coordinates(figure)
    wide = any("error_x" in t for t in figure.data)
    rows: list[Sequence] = [("series", *heads, *((f"± {heads[0]}",) if wide else ()))]
    for trace in figure.data:
        columns = [_looked_up(trace[way], shared) for way in ways]
        if not trace.get("name") or all(v is None for v in columns[0]):
            continue  # a line that only leads the eye; an entry of the legend
        columns += [list(trace["error_x"]["array"])] if "error_x" in trace else []
        rows += [(trace["name"], *map(_cell, point)) for point in zip(*columns, strict=True)]
    return _csv(rows)


def coordinates(figure: Figure) -> tuple[str, list[str]]:
    """("xy" or "xyz", what each coordinate is, with its unit)."""
    if "scene" in figure.layout:
        return "xyz", [figure.layout["scene"][f"{way}axis"]["title"]["text"] for way in "xyz"]
    titles = [figure.layout.get(f"{way}axis", {}).get("title", {}).get("text", "") for way in "xy"]
    # the axis of a panel names the unit only: its title is the quantity; an axis of words has no title
    heads = [f"{figure.title} {t}" if t.startswith("[") else t for t in titles]
    return "xy", [h or ("category" if way == "x" or titles[0] else figure.title) for way, h in zip("xy", heads, strict=True)]


def _looked_up(values: Any, shared: Mapping[str, np.ndarray]) -> list:
    if isinstance(values, str):
        values = shared[values[1:]]
    return values.tolist() if isinstance(values, np.ndarray) else list(values)


def _cell(value: float | str | None) -> float | str:
    if isinstance(value, str):
        return value
    return "" if value is None or not math.isfinite(value) else float(value)


def _csv(rows: Sequence[Sequence]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()
