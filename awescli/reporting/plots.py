"""Figures as plotly.js data: plain dicts, drawn by page.js, and by paper.py for papers; colours are @names, shared axes $names."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from awescli.reporting.marks import Body, chip, esc

MOST_POINTS = 2500
"""Samples of one line at most: more than a screen has pixels."""
PANEL_POINTS = 1500
"""The same for a panel of a grid where zooming in shows nothing new."""

LINE = 1.4

STEPS = ((1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7), (1, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.8, 2, 2.2, 2.5, 2.8, 3, 3.5, 4, 4.5, 5, 5.5, 6, 7, 8, 9))
"""Ticks within a decade of a logarithmic axis: the coarsest of which three fall on what is shown."""


@dataclass(frozen=True)
class Figure:
    """One plot: title, the split it shows, a note (HTML). linked: plots of one name zoom in time together; part: a panel of a grid."""

    id: str
    title: str
    data: Sequence[Mapping]
    layout: Mapping = field(default_factory=dict)
    split: str = ""
    note: str = ""
    height: int = 320
    linked: str = ""
    part: bool = False

    def html(self) -> str:
        document = to_json({"data": list(self.data), "layout": dict(self.layout)})
        words = f"<p>{self.note}</p>" if self.note else ""
        group = f' data-linked="{esc(self.linked)}"' if self.linked else ""
        three = ' data-three="yes"' if any(t.get("type") == "scatter3d" for t in self.data) else ""
        head = f"<strong>{esc(self.title)}</strong> {chip(self.split, 'split')}"
        return (
            f'<figure id="{esc(self.id)}"{" class=panel" if self.part else ""}><figcaption>{head}{words}</figcaption>'
            f'<div class="plot" role="img" aria-label="{esc(self.title)}" style="height:{self.height}px"{group}{three}></div>'
            f'<script type="application/json">{document}</script></figure>\n'
        )


@dataclass(frozen=True)
class Shared:
    """An array that many lines use, once: they name it $name."""

    name: str
    values: np.ndarray

    def html(self) -> str:
        return f'<script type="application/json" class="shared" data-name="{esc(self.name)}">{to_json(self.values, digits=8)}</script>\n'


def grid(figures: Sequence[Figure]) -> Body:
    """Small plots side by side where there is room."""
    return '<div class="grid">', *figures, "</div>\n"


def to_json(obj: Any, digits: int = 5) -> str:
    """JSON for inside a script element, where no '<' may end it: floats to 5 digits (a screen shows 4), what is not finite as a gap."""
    return json.dumps(_plain(obj, digits), ensure_ascii=False, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _plain(obj: Any, digits: int) -> Any:
    if isinstance(obj, np.ndarray):
        return [_plain(v, digits) for v in obj.tolist()]
    if isinstance(obj, Mapping):
        return {str(k): _plain(v, digits) for k, v in obj.items()}
    if isinstance(obj, (list, tuple)):
        return [_plain(v, digits) for v in obj]
    if isinstance(obj, np.generic):
        obj = obj.item()
    if isinstance(obj, float):
        return float(f"{obj:.{digits}g}") if math.isfinite(obj) else None
    return obj


def stride(count: int, most: int = MOST_POINTS) -> int:
    """Every how many samples a line of `count` keeps within `most`."""
    return max(1, -(-count // most))


def with_gaps(values: np.ndarray, step: int = 1) -> np.ndarray:
    """(K, N) segments as one line with a gap after each; every `step`-th sample."""
    thin = np.asarray(values, dtype=float)[:, ::step]
    return np.hstack([thin, np.full((len(thin), 1), np.nan)]).reshape(-1)


def line(x, y, name: str, colour: str, **more) -> dict:
    """A line."""
    style = {"color": colour, "width": more.pop("width", LINE)} | ({"dash": more.pop("dash")} if "dash" in more else {})
    return {"type": "scatter", "mode": "lines", "x": x, "y": y, "name": esc(name), "line": style, **more}


def dots(x, y, name: str, colour: str, *, size: float = 9, symbol: str = "circle", **more) -> dict:
    """Markers."""
    marker = {"color": colour, "size": size, "symbol": symbol} | more.pop("marker", {})
    return {"type": "scatter", "mode": "markers", "x": x, "y": y, "name": esc(name), "marker": marker, **more}


def bars(x, y, name: str, colour: str, **more) -> dict:
    """Upright bars."""
    return {"type": "bar", "x": x, "y": y, "name": esc(name), "marker": {"color": colour}, **more}


def axis(title: str, **more) -> dict:
    """An axis with its quantity and unit."""
    return {"title": {"text": esc(title)}, **more}


def strip(x0, x1, y0, y1, colour: str) -> dict:
    """A coloured bar across part of an axis, at heights 0..1 of the plot."""
    return {"type": "rect", "xref": "x", "yref": "paper", "x0": x0, "x1": x1, "y0": y0, "y1": y1, "fillcolor": colour, "line": {"width": 0}}


def swatch(name: str, colour: str, prefix: str = "") -> dict:
    """A legend entry for shapes, which have none of their own."""
    return {
        "type": "scatter", "mode": "markers", "x": [None], "y": [None], "name": f"{prefix}{name}",
        "marker": {"symbol": "square", "size": 10, "color": colour},
    }  # fmt: skip


def log_axis(title: str, *shown) -> dict:
    """A logarithmic axis for the values shown, with its numbers in full: plotly's own short ticks (2, 5) want explaining."""
    values = np.array([v for some in shown for v in some if v is not None and v > 0], dtype=float)
    low, high = (values.min(), values.max()) if len(values) else (1.0, 1.0)
    for steps in STEPS:
        ticks = [float(f"{m * 10.0**e:.3g}") for e in range(-6, 7) for m in steps]
        if sum(low <= t <= high for t in ticks) >= 3:
            break
    return axis(title, type="log", tickvals=ticks, ticktext=[f"{t:g}" for t in ticks])


def scene(east, north, up, *, winch: bool = False) -> dict:
    """East, north and up at one scale, in metres, seen from the side of the line from the winch to the middle of the path."""
    points = [np.append(v, 0.0) if winch else np.asarray(v) for v in (east, north, up)]
    low, high = (np.array([f(p) for p in points]) for f in (np.nanmin, np.nanmax))
    room = 0.04 * max(float((high - low).max()), 1e-6)
    ratio = (high - low + 2 * room) / float((high - low + 2 * room).max())
    away = max(1.27 * float(np.linalg.norm(ratio)), 1.4)  # a flat scene is seen from nearer
    axes = {
        f"{k}axis": {"title": {"text": f"{w} [m]"}, "range": [low[i] - room, high[i] + room], "nticks": 6}
        for i, (k, w) in enumerate(zip("xyz", ("east", "north", "up"), strict=True))
    }
    e, n = float(np.nanmean(east)), float(np.nanmean(north))
    length = max(math.hypot(e, n), 1e-9)
    # square to the line, and a little from its far end: a loop seen edge-on would be a stroke
    x, y = (-0.75 * n + 0.65 * e) / length, (0.75 * e + 0.65 * n) / length
    return {
        **axes, "aspectmode": "manual", "aspectratio": dict(zip("xyz", ratio.tolist(), strict=True)),
        "camera": {"eye": {"x": away * x, "y": away * y, "z": 0.24 * away}, "center": {"x": 0, "y": 0, "z": -0.14}},
    }  # fmt: skip
