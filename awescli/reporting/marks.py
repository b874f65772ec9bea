"""Building blocks of the page as HTML strings: escaping, sections, tables, links to figures."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any, Protocol, Union

from awescli.reporting.terms import tip, title_of


def esc(text: Any) -> str:
    """Text as text. Names come from the files of users; this stands at every one of them."""
    return escape(str(text), quote=True)


TIGHT = 12
"""Letters of a cell that is not broken over lines."""


@dataclass(frozen=True)
class Cell:
    """A cell whose shown text is not what it is sorted by. html: already escaped."""

    html: str
    key: float | str | None = None
    tone: str = ""


class Block(Protocol):
    """What is more than its HTML: a figure, which is also drawn for papers."""

    def html(self) -> str:
        """Its place on the page."""


Body = Union[str, Block, "tuple[Body, ...]"]
"""HTML, blocks, and what is made of them."""


def blocks(body: Body) -> Iterator[str | Block]:
    """A body's pieces in order."""
    if isinstance(body, tuple):
        for piece in body:
            yield from blocks(piece)
    else:
        yield body


@dataclass(frozen=True)
class Section:
    """A chapter: id for links, title, what it says and shows."""

    id: str
    title: str
    body: Body

    def inside(self) -> str:
        return "".join(piece if isinstance(piece, str) else piece.html() for piece in blocks(self.body))

    def html(self) -> str:
        return f'<section id="{esc(self.id)}"><h2>{esc(self.title)}</h2>\n{self.inside()}</section>\n'


def table(head: Sequence[str], rows: Iterable[Sequence[Any]], caption: str = "", *, sortable: bool = True) -> str:
    """A table that sorts by a click on its head and copies as tab-separated text. Plain cells are escaped."""
    lines = []
    for row in rows:
        cells = [_cell(value, first=i == 0) for i, value in enumerate(row)]
        lines.append(f"<tr>{''.join(cells)}</tr>")
    heads = "".join(_head(h, sortable) for h in head)
    title = f"<caption>{esc(caption)}</caption>" if caption else ""
    kind = ' class="sortable"' if sortable else ""
    return (
        f'<div class="table"><button type="button" class="copy">copy</button><div class="wide"><table{kind}>{title}'
        f"<thead><tr>{heads}</tr></thead><tbody>{''.join(lines)}</tbody></table></div></div>\n"
    )


def _head(text: str, sortable: bool) -> str:
    if not sortable:
        return f'<th scope="col">{tip(text)}</th>'
    return f'<th scope="col" aria-sort="none"><button type="button"{title_of(text)}>{esc(text)}</button></th>'


def _cell(value: Any, first: bool) -> str:
    cell = value if isinstance(value, Cell) else Cell(tip(str(value)), value if isinstance(value, (int, float)) else None)
    key = "" if cell.key is None else f' data-v="{esc(cell.key)}"'
    tone = f" {cell.tone}" if cell.tone else ""
    kind = "num" if isinstance(cell.key, (int, float)) else "tight" if len(cell.html) <= TIGHT or len(str(value)) <= TIGHT else "txt"
    if first:
        return f'<th scope="row" class="{kind}{tone}"{key}>{cell.html}</th>'
    return f'<td class="{kind}{tone}"{key}>{cell.html}</td>'


def bar(share: float, text: str) -> Cell:
    """A number with a bar behind it, for shares."""
    width = min(max(share, 0.0), 1.0) * 100
    return Cell(f'<span class="bar" style="--w:{width:.1f}%">{esc(text)}</span>', share)


def chip(text: str, tone: str = "") -> str:
    """A small label."""
    return f'<span class="chip {esc(tone)}">{esc(text)}</span>'


def keys(entries: Sequence[tuple[str, str, str]], linked: str = "") -> str:
    """A legend of many plots: (label, @colour, CSS line style). linked: a click shows or hides that line in all plots of that name."""
    pieces = []
    for label, colour, style in entries:
        swatch = f'<i style="--tone:var(--{esc(colour[1:])});--line:{esc(style)}"></i>{esc(label)}'
        button = f'<button type="button" aria-pressed="true" data-line="{esc(label)}">{swatch}</button>'
        pieces.append(button if linked else f"<span>{swatch}</span>")
    return f'<div class="keys"{f" data-for={chr(34)}{esc(linked)}{chr(34)}" if linked else ""}>{"".join(pieces)}</div>\n'


def link(target: str, html: str) -> str:
    """A link within the page."""
    return f'<a href="#{esc(target)}">{html}</a>'


def on_screen(html: str) -> str:
    """What makes sense only where it can be clicked: left out on paper."""
    return f'<span class="screen">{html}</span>'


def paragraph(html: str, kind: str = "") -> str:
    return f"<p{f' class={chr(34)}{kind}{chr(34)}' if kind else ''}>{html}</p>\n"


def bullets(items: Iterable[str]) -> str:
    """A list of HTML items; empty text for none."""
    lines = "".join(f"<li>{item}</li>" for item in items)
    return f"<ul>{lines}</ul>\n" if lines else ""


def folded(title: str, html: str) -> str:
    """What is not needed at first sight; print opens it."""
    return f"<details><summary>{esc(title)}</summary>\n{html}</details>\n"


def absent(command: str, what: str) -> str:
    """The place of what did not run."""
    return paragraph(
        f"Not here: {esc(what)}. <code>{esc(command)}</code> makes it; then run <code>awes evaluate --report</code> again.", "absent"
    )
