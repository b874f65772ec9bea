"""Figures as plotly.js data: plain dicts, drawn in the browser; colours are @names, long shared axes $names (page.js looks them up)."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from awescli.report.marks import chip, esc

MOST_POINTS = 3000
"""Samples of one line at most: more than a screen has pixels."""

LINE = 1.4


def figure(
    id: str, title: str, data: Sequence[Mapping], layout: Mapping | None = None, *, split: str, note: str = "", height: int = 320,
    linked: str = "", part: bool = False,
) -> str:  # fmt: skip
    """One plot with title, the split it shows and a note. linked: plots of one name zoom in time together; part: a panel of a grid."""
    document = to_json({"data": list(data), "layout": dict(layout or {})})
    words = f"<p>{note}</p>" if note else ""
    group = f' data-linked="{esc(linked)}"' if linked else ""
    three = ' data-three="yes"' if any(t.get("type") == "scatter3d" for t in data) else ""
    head = f"<strong>{esc(title)}</strong> {chip(split, 'split') if split else ''}"
    return (
        f'<figure id="{esc(id)}"{" class=panel" if part else ""}><figcaption>{head}{words}</figcaption>'
        f'<div class="plot" role="img" aria-label="{esc(title)}" style="height:{height}px"{group}{three}></div>'
        f'<script type="application/json">{document}</script></figure>\n'
    )


def grid(figures: Sequence[str]) -> str:
    """Small plots side by side where there is room."""
    return f'<div class="grid">{"".join(figures)}</div>\n'


def shared(name: str, values) -> str:
    """An array that many lines use, once."""
    return f'<script type="application/json" class="shared" data-name="{esc(name)}">{to_json(values, digits=8)}</script>\n'


def to_json(obj: Any, digits: int = 6) -> str:
    """JSON for inside a script element: floats to 6 digits (a pixel is 1 in 2000), what is not finite as null (a gap), no '<' that could end the element."""
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


def scene(title_unit: str = "m") -> dict:
    """East, north and up at one scale."""
    axes = {f"{k}axis": {"title": {"text": f"{w} [{title_unit}]"}} for k, w in zip("xyz", ("east", "north", "up"), strict=True)}
    return {**axes, "aspectmode": "data", "camera": {"eye": {"x": 1.3, "y": -1.3, "z": 0.7}}}
