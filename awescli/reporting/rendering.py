"""Plain data -> HTML, by the templates beside this file. Every value that a template is given is escaped; this is the one place where
a text becomes a part of a page: what a template made, and what `trusted` is given."""

import json
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from awescli.reporting import marks, plots

MACROS = {
    marks.Link: ("words.html", "link"), marks.File: ("words.html", "file"), marks.Strong: ("words.html", "strong"),
    marks.Soft: ("words.html", "soft"), marks.Code: ("words.html", "code"), marks.OnScreen: ("words.html", "on_screen"),
    marks.Chip: ("words.html", "chip"), marks.Bar: ("words.html", "bar"), marks.Tip: ("words.html", "tip"),
    marks.Section: ("blocks.html", "section"), marks.Paragraph: ("blocks.html", "paragraph"), marks.Heading: ("blocks.html", "heading"),
    marks.Bullets: ("blocks.html", "bullets"), marks.Group: ("blocks.html", "group"), marks.Folded: ("blocks.html", "folded"),
    marks.Grid: ("blocks.html", "grid"), marks.Table: ("blocks.html", "table"), marks.Keys: ("blocks.html", "keys"),
    marks.Tiles: ("blocks.html", "tiles"), plots.Figure: ("blocks.html", "figure"), plots.Shared: ("blocks.html", "shared"),
}  # fmt: skip
"""What the page is made of -> (template, the macro in it that shows it)."""


@cache
def environment() -> Environment:
    """The templates of this room. A name that a template is not given is an error, not an empty place."""
    made = Environment(
        loader=PackageLoader("awescli.reporting"), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    made.filters["show"] = show
    # JSON inside a script element: the filter writes <, >, & and ' as \u003c and so on, so that none can end it
    made.policies["json.dumps_function"] = json.dumps
    made.policies["json.dumps_kwargs"] = {"ensure_ascii": False, "allow_nan": False, "separators": (",", ":")}
    return made


def show(piece: Any) -> Markup:
    """Words, a block, or a tuple of them as HTML. Raises KeyError for what no template shows."""
    if isinstance(piece, tuple):
        return Markup().join(map(show, piece))
    if isinstance(piece, str):
        return escape(piece)
    template, macro = MACROS[type(piece)]
    return getattr(_macros(template), macro)(piece)


@cache
def _macros(template: str) -> Any:
    return environment().get_template(template).module


def trusted(markup: str) -> Markup:
    """What is put into a page as it is: our own scripts and style, a drawing of matplotlib, a table of polars; never a text with a user's
    words in it that did not go through one of these."""
    return Markup(markup)


def rendered(template: str, **values: Any) -> str:
    """A whole template, filled with values."""
    return environment().get_template(template).render(values)
