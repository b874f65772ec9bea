"""Safe YAML: text -> plain data, plus the place (`file:line`) of every key and item.

A subset on purpose: mappings, lists and scalars of YAML 1.2's core schema, anchors and aliases within limits. No tags (so
nothing can be constructed), no merge keys, no duplicate keys. `1e-3` is a number, `no` is a word, `12:30` is a word; PyYAML's
YAML 1.1 reads all three otherwise, which is why scalars are resolved here.
"""

import math
import re
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass

import yaml
from yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

from awescli.notation.errors import BadInput

MAX_CHARACTERS = 256 * 1024
"""Longest text read; the largest kite file is a tenth of this, and the parser needs about a second for it."""
MAX_DEPTH = 24
"""Deepest nesting of mappings and lists."""
MAX_NODES = 50_000
"""Most values after aliases are written out (the guard against "billion laughs")."""

Loc = tuple[str | int, ...]
"""The way to a value: keys (always text) and list indices."""

_INT = re.compile(r"[-+]?(0|[1-9][0-9]*|0x[0-9a-fA-F]+)\Z")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?\Z")
_WORDS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".inf", "+.inf", ".Inf", ".INF"), math.inf),
    **dict.fromkeys(("-.inf", "-.Inf", "-.INF"), -math.inf),
}
_UNPRINTABLE = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\ud800-\udfff]")


def _place(source: str, line: int) -> str:
    """`stages.yaml:12`; text from the command line (`--set KEY`) has no lines."""
    return source if source.startswith("--") else f"{source}:{line}"


@dataclass(frozen=True)
class Placed:
    """Plain data and where each part of it stands: loc -> `stages.yaml:12`."""

    data: object
    places: dict[Loc, str]


def parse_yaml(text: str, source: str) -> Placed:
    """The one document in `text`; `source` names it in errors."""
    if len(text) > MAX_CHARACTERS:
        raise BadInput(
            f"{len(text)} characters are too many for a settings file (limit {MAX_CHARACTERS})", source, "Is this the file you meant?"
        )
    return _Builder(text.removeprefix("\ufeff"), source).document()


class _Builder:
    """One pass over the parser's events; the limits are checked while reading, before anything large exists."""

    def __init__(self, text: str, source: str):
        self.text, self.source = text, source
        self.places: dict[Loc, str] = {}
        self.anchors: dict[str, tuple[object, int]] = {}
        self.nodes = 0
        self.events = self._guarded_events()

    def document(self) -> Placed:
        data, found = None, False
        for event in self.events:
            if isinstance(event, DocumentStartEvent):
                if found:
                    raise self.error(event, "a second document begins here (---)", "Keep one document per file.")
                found = True
                data = self.value(next(self.events), (), 0)
        return Placed(data, self.places)

    def _guarded_events(self) -> Iterator[Event]:
        """PyYAML's events, its errors turned into ours. ValueError: PyYAML lets `chr` and `int` fail on wild escapes."""
        try:
            yield from yaml.parse(self.text, Loader=yaml.SafeLoader)
        except yaml.reader.ReaderError as e:
            line = self.text.count("\n", 0, e.position) + 1
            what = f"character {e.character!r} is not allowed in YAML"
            raise BadInput(what, _place(self.source, line), "Remove it; save the file as UTF-8 text.") from None
        except yaml.MarkedYAMLError as e:
            mark = e.problem_mark or e.context_mark
            raise BadInput(
                f"not readable as YAML: {e.problem or e.context}", _place(self.source, mark.line + 1 if mark else 1), self._cure(e)
            ) from None
        except (yaml.YAMLError, ValueError, OverflowError) as e:
            raise BadInput(f"not readable as YAML: {e}", self.source, "Check escapes such as \\U in quoted text.") from None

    @staticmethod
    def _cure(e: yaml.MarkedYAMLError) -> str:
        if "'\\t'" in (e.problem or ""):
            return "Indent with spaces; YAML does not allow tabs."
        if e.context and e.context_mark:
            return f"It happened {e.context} that begins in line {e.context_mark.line + 1}; check indentation, colons and quotes."
        return "Check indentation, colons and quotes."

    def error(self, event: Event, what: str, do: str) -> BadInput:
        return BadInput(what, _place(self.source, event.start_mark.line + 1), do)

    def value(self, event: Event, loc: Loc, depth: int) -> object:
        """The value that begins with `event`."""
        self.places.setdefault(loc, _place(self.source, event.start_mark.line + 1))
        if depth > MAX_DEPTH:
            raise self.error(event, f"nested deeper than {MAX_DEPTH} levels", "Flatten it.")
        before = self._count(event, 1)
        if (tag := getattr(event, "tag", None)) is not None:
            raise self.error(event, f"tag '{tag}' is not allowed", "Write plain values; put text in quotes.")
        if isinstance(event, AliasEvent):
            return self._alias(event)
        if isinstance(event, ScalarEvent):
            data = self._scalar(event)
        elif isinstance(event, SequenceStartEvent):
            data = self._sequence(loc, depth)
        else:
            assert isinstance(event, MappingStartEvent), event
            data = self._mapping(loc, depth)
        if event.anchor is not None:
            # stored only when complete: an alias inside its own anchor is an unknown alias, so nothing is ever circular
            self.anchors[event.anchor] = (data, self.nodes - before)
        return data

    def _count(self, event: Event, more: int) -> int:
        before = self.nodes
        self.nodes += more
        if self.nodes > MAX_NODES:
            raise self.error(event, f"more than {MAX_NODES} values once aliases are written out", "Use fewer aliases (*name).")
        return before

    def _alias(self, event: AliasEvent) -> object:
        if event.anchor not in self.anchors:
            cure = f"Define it before with '&{event.anchor}', or put the text in quotes."
            raise self.error(event, f"unknown alias '*{event.anchor}'", cure)
        data, size = self.anchors[event.anchor]
        self._count(event, size)
        return deepcopy(data)

    def _sequence(self, loc: Loc, depth: int) -> list:
        items: list = []
        while not isinstance(event := next(self.events), SequenceEndEvent):
            items.append(self.value(event, (*loc, len(items)), depth + 1))
        return items

    def _mapping(self, loc: Loc, depth: int) -> dict:
        data: dict[str, object] = {}
        while not isinstance(event := next(self.events), MappingEndEvent):
            if not isinstance(event, ScalarEvent) or event.tag is not None:
                raise self.error(event, "a key must be plain text", "Put a word before the colon.")
            self._scalar(event)
            key = event.value
            if key == "<<" and event.implicit[0]:
                raise self.error(event, "merge keys (<<) are not supported", "Write the keys out, or alias a whole value (key: *name).")
            if key in data:
                first = self.places[(*loc, key)]
                raise self.error(event, f"key '{key}' appears twice (first at {first})", "Remove one of the two.")
            self.places[(*loc, key)] = _place(self.source, event.start_mark.line + 1)
            data[key] = self.value(next(self.events), (*loc, key), depth + 1)
        return data

    def _scalar(self, event: ScalarEvent) -> object:
        text = event.value
        if bad := _UNPRINTABLE.search(text):
            raise self.error(event, f"text contains the unprintable character {bad[0]!r}", "Remove it.")
        if not event.implicit[0]:  # quoted or block text stays text
            return text
        if text in _WORDS:
            return _WORDS[text]
        if _INT.match(text):
            if len(text) > 19:
                raise self.error(event, f"number {text[:19]}... has too many digits", "Write it as 1.0e20, or in quotes if it is text.")
            return int(text, 0)
        if _FLOAT.match(text):
            number = float(text) if len(text) < 400 else math.inf
            if math.isinf(number):
                raise self.error(event, f"number {text[:19]} is too large", "Write .inf where infinity is meant.")
            return number
        if text.lower() == ".nan":
            raise self.error(event, "'.nan' is not a number", "Leave the key out, or give a number.")
        return text
