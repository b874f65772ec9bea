"""The page in one sheet of paper: verdict, claims, error of every model, the effect in action, parameters of the answer. PDF, A4."""

import io
import textwrap
from typing import Any

import matplotlib
from matplotlib.figure import Figure as Sheet

from awescli.reporting.drawing import STYLE, on_axes
from awescli.reporting.evidence import Evidence
from awescli.reporting.headline import by_channel, claims, lead, poor_data, title
from awescli.reporting.in_action import gaining, made_of_it
from awescli.reporting.marks import plain
from awescli.reporting.paper import light_colours
from awescli.reporting.plots import Figure
from awescli.reporting.words import effect_words, percent, with_std

A4 = 8.27, 11.69
"""[in] width and height."""
LEFT, RIGHT, TOP, BOTTOM = 0.09, 0.95, 0.955, 0.045
"""Of the sheet."""
LETTERS = 108
"""Of small text in a line."""
MOST_CLAIMS, MOST_ROWS = 7, 10


def one_page(evidence: Evidence) -> bytes:
    """The sheet as PDF; equal evidence gives equal bytes."""
    with matplotlib.rc_context({**STYLE, "pdf.fonttype": 42}):
        sheet = Sheet(figsize=A4)
        y = _words(sheet, evidence)
        pictures = _pictures(evidence)
        height = (y - BOTTOM - 0.12) / (1 + bool(pictures))
        _draw(sheet, by_channel(evidence), (LEFT + 0.06, y - height + 0.03, RIGHT - LEFT - 0.06, height - 0.05))
        width = (RIGHT - LEFT) / max(len(pictures), 1)
        for i, picture in enumerate(pictures):
            place = (LEFT + i * width + 0.03, y - 2 * height + 0.05, width - 0.07, height - 0.075)
            _draw(sheet, picture, place)
        _table(sheet, evidence, y - 2 * height + 0.01 if pictures else y - height)
        foot = f"awes {evidence.versions.get('awes', '')} · flight {evidence.log.name}"
        sheet.text(LEFT, BOTTOM - 0.02, foot, fontsize=6.5, color="#5c6675")
        buffer = io.BytesIO()
        # no date in the file: equal sheets are equal files
        sheet.savefig(buffer, format="pdf", metadata={"CreationDate": None})
        return buffer.getvalue()


def _words(sheet: Sheet, evidence: Evidence) -> float:
    """Title, what of the data is not good, verdict, claims; returns how far down they reach."""
    y = TOP
    sheet.text(LEFT, y, f"Flight {evidence.log.name} · model against measurement", fontsize=7.5, color="#5c6675")
    y = _lines(sheet, y - 0.022, title(evidence), 14, 62, weight="bold")
    bad = plain(poor_data(evidence))
    y = _lines(sheet, y, bad, 8, LETTERS, color="#b9293f") if bad else y
    y = _lines(sheet, y, plain(lead(evidence)), 9, 96) if evidence.effects else y
    for claim in claims(evidence)[:MOST_CLAIMS]:
        y = _lines(sheet, y, f"• {plain(claim)}", 7.8, LETTERS, indent="   ")
    return y


def _lines(sheet: Sheet, y: float, text: str, size: float, letters: int, indent: str = "", **look: Any) -> float:
    """A text broken over lines from y down; returns where the next begins."""
    for row in textwrap.wrap(text, letters, subsequent_indent=indent):
        sheet.text(LEFT, y, row, fontsize=size, va="top", **look)
        y -= size * 1.35 / 72 / A4[1]
    return y - 0.004


def _pictures(evidence: Evidence) -> list[Figure]:
    """The first effect in action and the channel that gains most, where something was added."""
    if not evidence.tracing_added:
        return []
    return [*(made_of_it(action) for action in evidence.actions[:1]), *gaining(evidence)]


def _draw(sheet: Sheet, figure: Figure, place: tuple[float, float, float, float]) -> None:
    axes = sheet.add_axes(place)
    on_axes(axes, figure, light_colours(), {})
    axes.set_title(f"{figure.title} ({figure.split})", loc="left", fontsize=7.5)
    axes.tick_params(labelsize=6)
    axes.xaxis.label.set_fontsize(7)
    axes.yaxis.label.set_fontsize(7)
    axes.legend(fontsize=5.8, loc="best", frameon=False)


def _table(sheet: Sheet, evidence: Evidence, y: float) -> None:
    """Error of every model, then the sizes of what was found, in two columns."""
    models = [(evidence.label(m), percent(evidence.nrmse(m)["mean"])) for m in evidence.models]
    models.append(("noise alone", percent(evidence.floor["mean"])))
    found = [
        (f"{effect_words(e['name'], e.get('acts_on', ''))}, {name}", with_std(p["value"], p["std"], p["unit"]))
        for e in (evidence.named if evidence.effects else [])
        for name, p in e["parameters"].items()
    ]
    half = (LEFT + RIGHT) / 2
    heads = (LEFT, f"mean error {evidence.horizon:g} s ahead, test", models), (half, "by tracing, ± 2 std", found)
    for x, head, rows in heads:
        if rows:
            sheet.text(x, y, head, fontsize=7.5, weight="bold", va="top")
        for i, (name, value) in enumerate(rows[:MOST_ROWS], 1):
            sheet.text(x, y - 0.0125 * i, name, fontsize=7, va="top")
            sheet.text(x + 0.4, y - 0.0125 * i, value, fontsize=7, va="top", ha="right")
