"""A Figure drawn by matplotlib, for papers: what plotly.js draws on the page, from the same description.

Only what the page's figures are made of is known here; anything else raises KeyError or ValueError rather than being left out in silence.
"""

import io
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure as Sheet
from matplotlib.patches import Rectangle
from matplotlib.ticker import MultipleLocator, NullLocator
from matplotlib.transforms import blended_transform_factory
from matplotlib.typing import RcKeyType

from awescli.reporting.plots import Figure

WIDE, NARROW = 7.0, 3.5
"""Widths [in] of a figure over the text and of one in a column."""
INCH = 100.0
"""Pixels of the page that are an inch on paper."""
LEGEND_LINE = 0.15
"""Height [in] of a line of the legend."""
POINT = 0.62
"""Points on paper for a pixel of the page: lines and marks thin with the smaller figure."""

DASHES = {"dash": "--", "dot": ":", "solid": "-"}
SYMBOLS = {"circle": "o", "square": "s", "diamond": "D", "line-ns": "|", "line-ew": "_"}
STYLE: dict[RcKeyType, Any] = {
    "font.size": 8, "axes.titlesize": 8.5, "axes.grid": True, "grid.color": "#dde2e8", "grid.linewidth": 0.5, "axes.axisbelow": True,
    "axes.edgecolor": "#8b95a3", "axes.linewidth": 0.6, "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
    "text.parse_math": False, "axes.formatter.use_mathtext": False, "svg.fonttype": "none", "svg.hashsalt": "awes", "savefig.dpi": 200,
}  # fmt: skip
"""svg.fonttype none: texts stay texts, and take the paper's font; hashsalt: equal figures are equal files."""


def drawn(figure: Figure, colours: Mapping[str, str], shared: Mapping[str, np.ndarray]) -> dict[str, bytes]:
    """{"png": ..., "svg": ...}. colours: name -> #rrggbb for @names; shared: name -> array for $names."""
    with matplotlib.rc_context(STYLE):
        sheet = Sheet(figsize=(NARROW if figure.part else WIDE, figure.height / INCH), layout="constrained")
        axes = sheet.add_subplot(projection="3d" if "scene" in figure.layout else None)
        on_axes(axes, figure, colours, shared)
        axes.set_title(f"{figure.title}{chr(10) if figure.part else ' '}({figure.split})", loc="left")
        _legend(sheet, figure.part)
        return {kind: _saved(sheet, kind) for kind in ("png", "svg")}


def on_axes(axes: Any, figure: Figure, colours: Mapping[str, str], shared: Mapping[str, np.ndarray]) -> None:
    """What the figure shows, into axes that are there; for a figure in space they are of matplotlib's 3d kind."""
    looked_up = _Names(colours, shared)
    data, layout = looked_up.of(list(figure.data)), looked_up.of(dict(figure.layout))
    if "scene" in layout:
        _space(axes, data, layout["scene"])
    else:
        _plane(axes, data, layout)


def _legend(sheet: Sheet, narrow: bool) -> None:
    """All names below the axes, on paper that is longer by their lines."""
    handles, labels = sheet.axes[0].get_legend_handles_labels()
    if len(handles) > 1:
        columns = min(max(1, int((45 if narrow else 100) / (6 + max(map(len, labels))))), len(handles))
        sheet.set_figheight(sheet.get_figheight() + LEGEND_LINE * -(-len(handles) // columns))
        sheet.legend(handles, labels, loc="outside lower left", ncols=columns, fontsize=7)


def _saved(sheet: Sheet, kind: str) -> bytes:
    buffer = io.BytesIO()
    # no date in the file: equal figures are equal files
    sheet.savefig(buffer, format=kind, metadata={"Date": None} if kind == "svg" else {"Software": None})
    return buffer.getvalue()


class _Names:
    """@colour, @colour/opacity and $array looked up; lists of numbers become arrays."""

    def __init__(self, colours: Mapping[str, str], shared: Mapping[str, np.ndarray]):
        self.colours, self.shared = colours, shared

    def of(self, value: Any) -> Any:
        if isinstance(value, str):
            return self._text(value)
        if isinstance(value, Mapping):
            return {k: self.of(v) for k, v in value.items()}
        if isinstance(value, (list, tuple)):
            return [self.of(v) for v in value]
        return value

    def _text(self, text: str) -> Any:
        name, _, opacity = text[1:].partition("/")
        if text.startswith("@") and name in self.colours:
            return to_rgba(self.colours[name], float(opacity or 1))
        if text.startswith("$") and text[1:] in self.shared:
            return np.asarray(self.shared[text[1:]])
        return text


# --- in the plane ---------------------------------------------------------------------------------------------------------


def _plane(axes: Axes, data: list[dict], layout: dict) -> None:
    """Lines, marks, bars, shapes and notes of a figure with an x and a y axis."""
    x_axis, y_axis = layout.get("xaxis", {}), layout.get("yaxis", {})
    places = [_categories(data, layout, which) for which in "xy"]
    bars = [t for t in data if t["type"] == "bar"]
    before = None
    for trace in data:
        x, y = (_numbers(trace[which], place) for which, place in zip("xy", places, strict=True))
        if trace["type"] == "bar":
            _bars(axes, trace, x, y, bars.index(trace), len(bars))
        elif trace["type"] == "scatter":
            if trace.get("fill") == "tonexty" and before is not None:
                axes.fill_between(x, before, y, color=trace["fillcolor"], linewidth=0)
            _trace(axes, trace, x, y)
        else:
            raise ValueError(f"a figure in the plane has no {trace['type']}")
        before = y
    for which, place, axis in zip("xy", places, (x_axis, y_axis), strict=True):
        _axis(getattr(axes, f"{which}axis"), getattr(axes, f"set_{which}lim"), axis, place)
    if "category" in (x_axis.get("type"), y_axis.get("type")) or bars:
        axes.grid(False, axis="x" if bars else "both")
        axes.grid(True, axis="y" if bars else "both")
    for shape in layout.get("shapes", ()):
        _shape(axes, shape)
    for note in layout.get("annotations", ()):
        where = axes.get_yaxis_transform() if note.get("xref") == "paper" else axes.transData
        axes.text(note["x"], note["y"], note["text"], transform=where, ha=note.get("xanchor", "center"), va=note.get("yanchor", "center"))


def _categories(data: list[dict], layout: dict, which: str) -> dict[str, int] | None:
    """Category -> place on an axis of words; None on an axis of numbers."""
    axis = layout.get(f"{which}axis", {})
    words = dict.fromkeys(axis.get("categoryarray", ()))
    for trace in data:
        words |= dict.fromkeys(v for v in trace[which] if isinstance(v, str))
    return {word: i for i, word in enumerate(words)} if words else None


def _numbers(values: Sequence, place: dict[str, int] | None) -> np.ndarray:
    """(N,) floats; gaps are NaN."""
    if place is not None:
        values = [place[v] if isinstance(v, str) else v for v in values]
    return np.array([math.nan if v is None else v for v in values], dtype=float)


def _trace(axes: Axes, trace: dict, x: np.ndarray, y: np.ndarray) -> None:
    """A line, marks, or both."""
    look = _look(trace)
    if trace.get("visible", True) is not True:
        return
    if "error_x" in trace:
        error = trace["error_x"]
        axes.errorbar(x, y, xerr=np.asarray(error["array"], dtype=float), fmt="none", ecolor=error["color"], elinewidth=0.8)
    axes.plot(x, y, **look)


def _look(trace: dict) -> dict:
    """Colours, widths, marks and label of a line."""
    line, marker, mode = trace.get("line", {}), trace.get("marker", {}), trace["mode"]
    colour = line.get("color") or marker.get("color")
    edge = marker.get("line", {})
    look = {"color": colour, "linestyle": DASHES[line.get("dash", "solid")] if "lines" in mode else "none"}
    look |= {"linewidth": POINT * line.get("width", 2)} if "lines" in mode else {}
    if "markers" in mode:
        look |= {"marker": SYMBOLS[marker.get("symbol", "circle")], "markersize": POINT * marker.get("size", 6)}
        look |= {"markeredgecolor": edge["color"], "markeredgewidth": POINT * edge["width"]} if edge else {"markeredgewidth": 0}
    shown = trace.get("showlegend", True) and trace.get("name")
    return look | {"label": trace["name"] if shown else "_"}


def _bars(axes: Axes, trace: dict, x: np.ndarray, y: np.ndarray, which: int, count: int) -> None:
    """One of `count` groups of upright bars, with its numbers where the page writes them."""
    width = 0.75 / count
    drawn = axes.bar(x + (which - (count - 1) / 2) * width, y, width * 0.94, color=trace["marker"]["color"], label=trace["name"])
    if trace.get("textposition") == "outside":
        axes.bar_label(drawn, trace["text"], fontsize=7, padding=1)


def _axis(axis: XAxis | YAxis, set_limits: Callable, wanted: dict, place: dict[str, int] | None) -> None:
    """Title, scale, ticks and range of an axis."""
    axis.set_label_text(wanted.get("title", {}).get("text", ""))
    if place is not None:
        axis.set_ticks(list(place.values()), list(place), fontsize=7, rotation=-wanted.get("tickangle", 0))
        set_limits(-0.6, len(place) - 0.4)
    if wanted.get("type") == "log":
        _log(axis)
    if "tickvals" in wanted:
        axis.set_ticks(_within(axis, wanted))
        axis.set_major_formatter(lambda value, _: f"{value:g}")
        axis.set_minor_locator(NullLocator())
    if "dtick" in wanted and place is None:
        axis.set_major_locator(MultipleLocator(wanted["dtick"]))
    if "range" in wanted:
        set_limits(*wanted["range"])
    elif wanted.get("rangemode") == "tozero":
        set_limits(min(0.0, axis.get_view_interval()[0]), None)
    if wanted.get("autorange") == "reversed":
        axis.set_inverted(True)


def _log(axis: XAxis | YAxis) -> None:
    (axis.axes.set_xscale if axis.axis_name == "x" else axis.axes.set_yscale)("log")


def _within(axis: XAxis | YAxis, wanted: dict) -> list[float]:
    """The ticks that fall between the ends of what is drawn."""
    low, high = sorted(axis.get_view_interval())
    return [t for t in wanted["tickvals"] if low <= t <= high]


def _shape(axes: Axes, shape: dict) -> None:
    """A rectangle or a line, each way in data or in shares of the axes."""
    ways = [axes.transAxes if shape.get(f"{which}ref") == "paper" else axes.transData for which in "xy"]
    transform = blended_transform_factory(*ways)
    x0, x1, y0, y1 = (shape[k] for k in ("x0", "x1", "y0", "y1"))
    if shape["type"] == "line":
        line = shape["line"]
        look = {"color": line["color"], "linestyle": DASHES[line.get("dash", "solid")], "linewidth": POINT * line.get("width", 2)}
        axes.plot([x0, x1], [y0, y1], transform=transform, scalex=False, scaley=False, label="_", **look)
        return
    patch = Rectangle((x0, y0), x1 - x0, y1 - y0, transform=transform, color=shape["fillcolor"], linewidth=0, zorder=0.5)
    axes.add_artist(patch)


# --- in space -------------------------------------------------------------------------------------------------------------


def _space(axes: Any, data: list[dict], scene: dict) -> None:
    """Paths in space at one scale, seen as the page shows them first."""
    for trace in data:
        if trace["type"] != "scatter3d":
            raise ValueError(f"a figure in space has no {trace['type']}")
        if trace.get("visible", True) is True:
            look = _look(trace)
            look |= {"linewidth": 0.3 * trace["line"]["width"]} if "line" in trace else {}
            axes.plot(*(_numbers(trace[which], None) for which in "xyz"), **look)
    for which in "xyz":
        getattr(axes, f"set_{which}lim")(*scene[f"{which}axis"]["range"])
        getattr(axes, f"set_{which}label")(scene[f"{which}axis"]["title"]["text"])
    axes.locator_params(nbins=5)
    x, y, z = (scene["camera"]["eye"][way] for way in "xyz")
    axes.set_box_aspect([scene["aspectratio"][which] for which in "xyz"], zoom=0.95)
    axes.view_init(elev=math.degrees(math.atan2(z, math.hypot(x, y))), azim=math.degrees(math.atan2(y, x)))
