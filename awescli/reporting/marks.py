"""What the page is made of, as plain data: words with marks in them, paragraphs, tables, groups. `templates/` says what it looks like."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Union
from urllib.parse import quote

from awescli.reporting.terms import TIPS

TIGHT = 12
"""Letters of a cell that is not broken over lines."""


# --- words ----------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Link:
    """A link within the page, to the id of what it shows."""

    target: str
    words: "Words"


@dataclass(frozen=True)
class File:
    """A link to a file beside the page or below it, by its path from there."""

    path: str
    words: "Words"

    @property
    def address(self) -> str:
        """The path as a relative address: no name of a folder is read as a scheme, a host or a query."""
        return f"./{quote(self.path)}"


@dataclass(frozen=True)
class Strong:
    """Words that are to be read first."""

    words: "Words"


@dataclass(frozen=True)
class Soft:
    """Words that are to be read last."""

    words: "Words"


@dataclass(frozen=True)
class Code:
    """A name, a command or an expression as somebody types it."""

    words: str


@dataclass(frozen=True)
class OnScreen:
    """What makes sense only where it can be clicked: left out on paper."""

    words: "Words"


@dataclass(frozen=True)
class Chip:
    """A small label."""

    words: str
    tone: str = ""


@dataclass(frozen=True)
class Bar:
    """A share in words with a bar of its length behind it."""

    share: float
    words: str

    @property
    def width(self) -> str:
        return f"{min(max(self.share, 0.0), 1.0) * 100:.1f}"


@dataclass(frozen=True)
class Tip:
    """A text, with its meaning where it has one."""

    words: str

    @property
    def meaning(self) -> str:
        return TIPS.get(self.words, "")


Mark = Link | File | Strong | Soft | Code | OnScreen | Chip | Bar | Tip
Words = Union[str, Mark, "tuple[Words, ...]"]
"""Text, marked text, and what is made of them. Text is text wherever it comes from: nothing in it is read as a mark."""


def plain(words: Words) -> str:
    """The words without their marks, as paper shows them."""
    if isinstance(words, tuple):
        return "".join(plain(piece) for piece in words)
    if isinstance(words, str):
        return words
    return "" if isinstance(words, OnScreen) else plain(words.words)


def in_a_row(pieces: Sequence[Words]) -> Words:
    """a, b and c."""
    last = len(pieces) - 1
    return tuple(("" if i == 0 else " and " if i == last else ", ", piece) for i, piece in enumerate(pieces))


def spaced(pieces: Sequence[Words]) -> Words:
    """The pieces with a space between any two."""
    return tuple(("" if i == 0 else " ", piece) for i, piece in enumerate(pieces))


# --- blocks ---------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Paragraph:
    words: Words
    kind: str = ""


@dataclass(frozen=True)
class Heading:
    """A heading within a chapter."""

    words: str


@dataclass(frozen=True)
class Bullets:
    items: tuple[Words, ...]


@dataclass(frozen=True)
class Cell:
    """A cell whose shown words are not what it is sorted by."""

    words: Words
    key: float | str | None = None
    tone: str = ""

    @property
    def kind(self) -> str:
        """How it is set: a number, a short text on one line, or a text."""
        if isinstance(self.key, (int, float)):
            return "num"
        text = self.words.words if isinstance(self.words, Tip) else self.words
        return "tight" if isinstance(text, str) and len(text) <= TIGHT else "txt"


@dataclass(frozen=True)
class Table:
    """A table that sorts by a click on its head and copies as tab-separated text."""

    head: tuple[Tip, ...]
    rows: tuple[tuple[Cell, ...], ...]
    sortable: bool = True


@dataclass(frozen=True)
class Keys:
    """A legend of many plots: (label, @colour, CSS line style). linked: a click shows or hides that line in all plots of that name."""

    entries: tuple[tuple[str, str, str], ...]
    linked: str = ""


@dataclass(frozen=True)
class Tiles:
    """Large numbers side by side, each leading to the same figure: (number, label, @colour)."""

    target: str
    entries: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True)
class Group:
    """Blocks that a link leads to together. An empty title has no heading."""

    id: str
    title: str
    body: "Body"


@dataclass(frozen=True)
class Folded:
    """What is not needed at first sight; print opens it."""

    title: str
    body: "Body"


@dataclass(frozen=True)
class Grid:
    """Small plots side by side where there is room."""

    body: "Body"


@dataclass(frozen=True)
class Section:
    """A chapter: id for links, title, what it says and shows."""

    id: str
    title: str
    body: "Body"


Body = Any
"""Blocks and tuples of them, nested as they were made, figures (`plots.py`) among them; an empty text or tuple for what is not there."""


def blocks(body: Body) -> Iterator[Any]:
    """A body's blocks in order, and those inside them."""
    if isinstance(body, tuple):
        for piece in body:
            yield from blocks(piece)
    else:
        yield body
        if isinstance(body, (Section, Group, Folded, Grid)):
            yield from blocks(body.body)


def table(head: Sequence[str], rows: Iterable[Sequence[Any]], *, sortable: bool = True) -> Table:
    """Rows of cells, or of values as they are: texts, which get their meaning, and numbers, which sort as numbers."""
    return Table(tuple(map(Tip, head)), tuple(tuple(map(_cell, row)) for row in rows), sortable)


def _cell(value: Any) -> Cell:
    return value if isinstance(value, Cell) else Cell(Tip(str(value)), value if isinstance(value, (int, float)) else None)


def bar(share: float, text: str) -> Cell:
    """A number with a bar behind it, for shares."""
    return Cell(Bar(share, text), share)


def bullets(items: Iterable[Words]) -> Body:
    """A list; nothing for no items."""
    kept = tuple(items)
    return Bullets(kept) if kept else ()


def absent(command: str, what: str) -> Paragraph:
    """The place of what did not run."""
    again = Code("awes evaluate --report")
    return Paragraph((f"Not here: {what}. ", Code(command), " makes it; then run ", again, " again."), "absent")
