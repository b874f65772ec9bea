"""Figures as plotly.js data: plain dicts, drawn by page.js, and by paper.py for papers; colours are @names, shared axes $names."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from awescli.reporting.marks import Grid

Position = float | np.ndarray
Values = np.ndarray | Sequence | str
"""Numbers or words along an axis; a text beginning with $ names an array that figures share."""

MOST_POINTS = 2500
"""Samples of one line at most: more than a screen has pixels."""
PANEL_POINTS = 1500
"""The same for a panel of a grid where zooming in shows nothing new."""

LINE = 1.4

STEPS = ((1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7), (1, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.8, 2, 2.2, 2.5, 2.8, 3, 3.5, 4, 4.5, 5, 5.5, 6, 7, 8, 9))
"""Ticks within a decade of a logarithmic axis: the coarsest of which three fall on what is shown."""


AS_THEY_ARE = ("hovertemplate", "meta")
"""Texts of a figure that `_plain` leaves alone: marks that `hover` made, and names that page.js compares and does not show."""


@dataclass(frozen=True)
class Figure:
    """One plot: title, the split it shows, a note. linked: plots of one name zoom in time together; part: a panel of a grid."""

    id: str
    title: str
    data: Sequence[Mapping]
    layout: Mapping = field(default_factory=dict)
    split: str = ""
    note: str = ""
    height: int = 320
    linked: str = ""
    part: bool = False

    @property
    def document(self) -> Mapping:
        """What plotly.js reads. It takes marks out of texts, so that those of users are escaped: floats to 5 digits (a screen shows 4)."""
        return _plain({"data": list(self.data), "layout": dict(self.layout)}, digits=5)

    @property
    def in_space(self) -> bool:
        return any(t.get("type") == "scatter3d" for t in self.data)


@dataclass(frozen=True)
class Shared:
    """An array that many lines use, once: they name it $name."""

    name: str
    values: np.ndarray

    @property
    def document(self) -> list:
        return _plain(self.values, digits=8)


def grid(figures: Sequence[Figure]) -> Grid:
    """Small plots side by side where there is room."""
    return Grid(tuple(figures))


def hover(*lines: str, aside: str = "") -> str:
    """What the pointer shows, in plotly.js' words (%{x}), which knows these two marks; aside: text in the colour of the line."""
    return f"{'<br>'.join(lines)}<extra>{escape(aside)}</extra>"


def _plain(obj: Any, digits: int) -> Any:
    """For JSON: texts escaped, floats rounded, what is not finite as a gap."""
    if isinstance(obj, str):
        return escape(obj)
    if isinstance(obj, np.ndarray):
        return [_plain(v, digits) for v in obj.tolist()]
    if isinstance(obj, Mapping):
        return {str(k): v if k in AS_THEY_ARE else _plain(v, digits) for k, v in obj.items()}
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


def line(x: Values, y: Values, name: str, colour: str, **more: Any) -> dict:
    """A line."""
    style = {"color": colour, "width": more.pop("width", LINE)} | ({"dash": more.pop("dash")} if "dash" in more else {})
    return {"type": "scatter", "mode": "lines", "x": x, "y": y, "name": name, "line": style, **more}


def dots(x: Values, y: Values, name: str, colour: str, *, size: float = 9, symbol: str = "circle", **more: Any) -> dict:
    """Markers."""
    marker = {"color": colour, "size": size, "symbol": symbol} | more.pop("marker", {})
    return {"type": "scatter", "mode": "markers", "x": x, "y": y, "name": name, "marker": marker, **more}


def bars(x: Values, y: Values, name: str, colour: str, **more: Any) -> dict:
    """Upright bars."""
    return {"type": "bar", "x": x, "y": y, "name": name, "marker": {"color": colour}, **more}


def axis(title: str, **more: Any) -> dict:
    """An axis with its quantity and unit."""
    return {"title": {"text": title}, **more}


def strip(x0: Position, x1: Position, y0: Position, y1: Position, colour: str) -> dict:
    """A coloured bar across part of an axis, at heights 0..1 of the plot."""
    return {"type": "rect", "xref": "x", "yref": "paper", "x0": x0, "x1": x1, "y0": y0, "y1": y1, "fillcolor": colour, "line": {"width": 0}}


def swatch(name: str, colour: str, prefix: str = "") -> dict:
    """A legend entry for shapes, which have none of their own."""
    return {
        "type": "scatter", "mode": "markers", "x": [None], "y": [None], "name": f"{prefix}{name}",
        "marker": {"symbol": "square", "size": 10, "color": colour},
    }  # fmt: skip


def log_axis(title: str, *shown: Iterable[float | None]) -> dict:
    """A logarithmic axis for the values shown, with its numbers in full: plotly's own short ticks (2, 5) want explaining."""
    values = np.array([v for some in shown for v in some if v is not None and v > 0], dtype=float)
    low, high = (values.min(), values.max()) if len(values) else (1.0, 1.0)
    for steps in STEPS:
        ticks = [float(f"{m * 10.0**e:.3g}") for e in range(-6, 7) for m in steps]
        if sum(low <= t <= high for t in ticks) >= 3:
            break
    return axis(title, type="log", tickvals=ticks, ticktext=[f"{t:g}" for t in ticks])


def scene(east: np.ndarray, north: np.ndarray, up: np.ndarray, *, winch: bool = False) -> dict:
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
