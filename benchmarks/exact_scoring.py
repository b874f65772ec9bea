"""Is an answer right? Exactly: the one right effect on the right target, and nothing else. Pure functions, for every tracing campaign.

    outcome(Truth("library", ("actuator_lag:rudder",)), answer_of(effects_json)) == "right"

| truth | right | other outcomes |
|---|---|---|
| an effect of the library | `found` with exactly it | among rivals: `cannot_tell`, its class holds it; unexplained; silent; wrong |
| outside of library and bank | `unexplained`, nothing named | silent: no name; wrong: any name |
| clean | `none`; in gusty air `not_deterministic` too | false alarm: something is missing, no name; wrong: any name |

Any further or wrong name is wrong, also beside the right one.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any, Literal

RIGHT = ("right", "among rivals")
"""Outcomes of answers that hold the truth."""
OUTCOMES = ("right", "among rivals", "unexplained", "silent", "false alarm", "wrong", "failed")

Name = tuple[str, str]
"""(effect, what it acts on), as in effects.json."""


@dataclass(frozen=True)
class Truth:
    """group; answers: right ones, each an effect `name` or `name:target`, or several at once as `a + b`; gusty: the air is not calm."""

    group: Literal["library", "outside", "clean"]
    answers: tuple[str, ...] = ()
    gusty: bool = False


@dataclass(frozen=True)
class Answer:
    """verdict: of effects.json; named: for every effect that is named, it and then its rivals."""

    verdict: str
    named: tuple[tuple[Name, ...], ...] = ()

    @property
    def first(self) -> list[Name]:
        """What is named, rivals aside."""
        return [entry[0] for entry in self.named]


def answer_of(account: Mapping[str, Any]) -> Answer:
    """The answer that effects.json gives."""
    entries = ([e, *e.get("rivals", ())] for e in account.get("effects", ()))
    return Answer(account["verdict"], tuple(tuple((e["name"], e["acts_on"]) for e in entry) for entry in entries))


def outcome(truth: Truth, answer: Answer) -> str:
    """One of OUTCOMES."""
    if answer.verdict == "failed":
        return "failed"
    return {"library": _of_library, "outside": _of_outside, "clean": _of_clean}[truth.group](truth, answer)


def counted(outcomes: Iterable[str]) -> list[int]:
    """How often each of OUTCOMES, in their order."""
    counts = Counter(outcomes)
    return [counts[name] for name in OUTCOMES]


def _of_library(truth: Truth, answer: Answer) -> str:
    if answer.verdict == "found":
        return "right" if any(matches(keys, [(name,) for name in answer.first]) for keys in _sets(truth)) else "wrong"
    if answer.verdict == "cannot_tell":
        return "among rivals" if any(matches(keys, answer.named) for keys in _sets(truth)) else "wrong"
    if any(not any(_holds((name,), key) for keys in _sets(truth) for key in keys) for name in answer.first):
        return "wrong"
    return "unexplained" if answer.verdict == "unexplained" else "silent" if not answer.named else "wrong"


def _of_outside(truth: Truth, answer: Answer) -> str:
    if answer.named or answer.verdict == "found":
        return "wrong"
    return "right" if answer.verdict == "unexplained" else "silent"


def _of_clean(truth: Truth, answer: Answer) -> str:
    if answer.named or answer.verdict == "found":
        return "wrong"
    if answer.verdict == "none" or (truth.gusty and answer.verdict == "not_deterministic"):
        return "right"
    return "silent" if answer.verdict == "not_testable" else "false alarm"


def _sets(truth: Truth) -> list[list[str]]:
    """The right answers as lists of effects."""
    return [[key.strip() for key in answer.split("+")] for answer in truth.answers]


def matches(keys: Sequence[str], entries: Sequence[Sequence[Name]]) -> bool:
    """Are there as many entries as effects, and does each effect stand in an entry of its own?"""
    return len(keys) == len(entries) and any(all(map(_holds, order, keys)) for order in permutations(entries))


def _holds(entry: Sequence[Name], key: str) -> bool:
    """Is the effect `key` in the entry? Without a target in the key there is only one place to act."""
    name, _, target = key.partition(":")
    return any(of == name and target in ("", acts_on) for of, acts_on in entry)
