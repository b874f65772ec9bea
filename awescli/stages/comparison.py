"""Two runs side by side: what they were made from, and which of their numbers and verdicts differ."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeGuard

from awescli.artifacts import PROVENANCE, read_json
from awescli.notation.errors import BadInput
from awescli.stages.answers import named, sized
from awescli.stages.base import Stage
from awescli.stages.changes import changes

TIMES = ("seconds", "timing")
"""Keys of times: they differ between any two runs and say nothing about the result."""
ADVICE = ("advice", "excited", "at_bound", "partners", "plausible_size", "says")
"""Keys of flags and sentences for people: they follow from numbers that are compared, and flip at a threshold."""
VERDICTS = ("verdict", "outcome")
"""Keys, at the top of an artifact, of what a stage concludes."""
NAMES = ("name", "acts_on", "loop", "part")
"""What an entry of a list is known by, where it has one of these: its place may differ between runs."""

Value = float | str | bool | None


@dataclass(frozen=True)
class Difference:
    """One number or word that differs. where: `evaluate/metrics.json: hybrid.nrmse.test.mean`; None: nothing there in that run."""

    where: str
    a: Value
    b: Value

    @property
    def change(self) -> float:
        """|b - a| / max(|a|, |b|): from 0 to 2; 2 also for words."""
        a, b = self.a, self.b
        if not (_is_number(a) and _is_number(b)):
            return 2.0
        return abs(b - a) / max(abs(a), abs(b))

    @property
    def one_sided(self) -> bool:
        return self.a is None or self.b is None

    @property
    def advice(self) -> bool:
        """A flag or a sentence for people, not a result."""
        return any(key in ADVICE for key in re.split(r"[.\[]", self.where))

    @property
    def nameless(self) -> bool:
        """Has it only a place in a list or a matrix?"""
        return re.search(r"\[\d+\]", self.where) is not None

    @property
    def number(self) -> bool:
        return _is_number(self.a) and _is_number(self.b)


@dataclass(frozen=True)
class Comparison:
    """made_from: stage -> what differs in inputs, settings, seed, versions, one sentence each; only: run -> stages that the other lacks;
    verdicts: stage -> (what it concluded in a, in b); effects: effect and parameter -> (size with interval in a, in b), None where it was
    not found; errors: model -> (mean test NRMSE in a, in b); same: how many values are equal; differences: largest first, what only one
    of the runs has last."""

    made_from: Mapping[str, list[str]]
    only: Mapping[str, list[str]]
    verdicts: Mapping[str, tuple[str | None, str | None]]
    effects: Mapping[str, tuple[str | None, str | None]]
    errors: Mapping[str, tuple[float | None, float | None]]
    same: int
    differences: tuple[Difference, ...]


def compare(a: Path, b: Path, stages: Sequence[Stage], tolerance: float = 0.0) -> Comparison:
    """Compare every JSON artifact of two runs (`out` folders). tolerance: relative change that still counts as equal.
    Raises BadInput for a folder that is no run."""
    in_a, in_b = _stages_in(a, stages), _stages_in(b, stages)
    both = [name for name in in_a if name in in_b]
    made_from = {name: changes(*({**_stamp(run / name), "upstream": {}} for run in (a, b))) for name in both}
    values_a, values_b = ({k: v for name in both for k, v in _values(run / name)} for run in (a, b))
    pairs = [Difference(k, values_a.get(k), values_b.get(k)) for k in dict.fromkeys([*values_a, *values_b])]
    differing = [d for d in pairs if d.a != d.b and d.change > tolerance]
    return Comparison(
        {name: lines for name, lines in made_from.items() if lines},
        {str(a): [n for n in in_a if n not in in_b], str(b): [n for n in in_b if n not in in_a]},
        _side_by_side(*({n: v for n in names for v in _verdict(run / n)} for run, names in ((a, in_a), (b, in_b)))),
        _side_by_side(*(_effects(run) for run in (a, b))),
        _side_by_side(*(_errors(run) for run in (a, b))),
        len(pairs) - len(differing),
        tuple(sorted(differing, key=lambda d: (d.one_sided, -d.change))),
    )


def _stages_in(run: Path, stages: Sequence[Stage]) -> list[str]:
    """The stages that left results in a run."""
    found = [s.name for s in stages if (run / s.name / PROVENANCE).is_file()]
    if not found:
        if not run.is_dir():
            raise BadInput("there is no such folder", str(run), "Name the folder of a run (`out` in its plan).")
        inner = " Did you mean its folder 'out'?" if any((run / "out" / s.name / PROVENANCE).is_file() for s in stages) else ""
        raise BadInput("no results of awes are here", str(run), f"Name the folder of a run (`out` in its plan).{inner}")
    return found


def _stamp(folder: Path) -> Mapping[str, Any]:
    """What a stage was made from."""
    return read_json(folder / PROVENANCE)["stamp"]


def _side_by_side(a: Mapping[str, Any], b: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    return {name: (a.get(name), b.get(name)) for name in dict.fromkeys([*a, *b])}


def _verdict(folder: Path) -> Iterator[str]:
    """What a stage concluded, where it says so: at most one word."""
    for file in ("effects.json", "metrics.json"):
        document = read_json(folder / file, any_form=True) if (folder / file).is_file() else {}
        if word := next((document[k] for k in VERDICTS if isinstance(document, dict) and isinstance(document.get(k), str)), None):
            yield word
            return


def _effects(run: Path) -> dict[str, str]:
    """`actuator_lag on rudder, tau` -> its size with the 95 % interval, where trace-residual has run."""
    file = run / "trace-residual" / "effects.json"
    found = read_json(file, any_form=True) if file.is_file() else {}
    effects = found.get("effects") if isinstance(found, dict) else None
    return {
        f"{named(e)}, {name}": sized(size)
        for e in (effects if isinstance(effects, list) else ())
        if isinstance(e, dict) and isinstance(e.get("name"), str) and isinstance(e.get("parameters"), dict)
        for name, size in e["parameters"].items()
        if isinstance(size, dict) and all(_is_number(size.get(key)) for key in ("value", "std"))
    }


def _errors(run: Path) -> dict[str, float]:
    """Model -> mean NRMSE on the test loops, where evaluate has run."""
    file = run / "evaluate" / "metrics.json"
    scores = read_json(file, any_form=True) if file.is_file() else {}
    found = {}
    for model, block in scores.items() if isinstance(scores, dict) else ():
        mean: Any = block
        for key in ("nrmse", "test", "mean"):
            mean = mean.get(key) if isinstance(mean, dict) else None
        if _is_number(mean):
            found[model] = float(mean)
    return found


def _values(folder: Path) -> Iterator[tuple[str, Value]]:
    """(where, value) of everything in a stage's JSON artifacts."""
    for file in sorted(folder.glob("*.json")):
        if file.name != PROVENANCE:
            for key, value in _leaves(read_json(file, any_form=True)):
                yield f"{folder.name}/{file.name}: {key}", value


def _leaves(tree: Any, prefix: str = "") -> Iterator[tuple[str, Value]]:
    """Dotted keys and plain values. A table ({columns, rows}) goes column by column."""
    if isinstance(tree, dict) and set(tree) == {"columns", "rows"} and _is_table(tree["columns"], tree["rows"]):
        tree = {name: list(column) for name, column in zip(tree["columns"], zip(*tree["rows"], strict=True), strict=False)}
    if isinstance(tree, dict):
        for key, value in tree.items():
            if key not in TIMES:
                yield from _leaves(value, f"{prefix}.{key}" if prefix else key)
    elif isinstance(tree, list):
        for place, value in enumerate(tree):
            yield from _leaves(value, f"{prefix}[{_name(value, place)}]")
    else:
        yield prefix, tree


def _is_table(columns: Any, rows: Any) -> bool:
    """Names of columns, and rows of so many values."""
    named = isinstance(columns, list) and all(isinstance(name, str) for name in columns)
    return named and isinstance(rows, list) and all(isinstance(row, list) and len(row) == len(columns) for row in rows)


def _name(entry: Any, place: int) -> str:
    """What an entry of a list is called."""
    known = [str(entry[key]) for key in NAMES if entry.get(key) not in (None, "")] if isinstance(entry, dict) else []
    return " ".join(known) or str(place)


def _is_number(value: Value) -> TypeGuard[float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
