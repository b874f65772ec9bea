"""One stage, run for Python: a plan made of arguments, the results it takes from, and a folder for what it leaves.

Every call works in a folder of its own (the caller's, or a temporary one) into which it brings the results that it was given. So a result
is never changed by a later call. The plan is written beside the results: `awes run --stages FOLDER/stages.yaml` makes them again.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml

from awescli.api.inputs import Flight, Kite
from awescli.artifacts import copied_folder, put_beside
from awescli.notation.document import Document
from awescli.notation.errors import BadInput, NumericalFailure
from awescli.stages import STAGES
from awescli.stages.base import FAILURE, Context, Inputs, Progress, Silent, Split, Task
from awescli.stages.made import made_hash, read_provenance
from awescli.stages.plan import OMIT, Plan, plan_model, plan_of
from awescli.stages.runner import run_plan

PLAN, KITE = "stages.yaml", "kite.yaml"
TABLE = {stage.name: stage for stage in STAGES}


@dataclass(frozen=True)
class Made:
    """What one stage left. settings: as they were given; digest: of its files; keep: what the folder lives as long as."""

    stage: str
    folder: Path
    settings: Mapping[str, Any]
    digest: str
    keep: object = field(default=None, repr=False, compare=False)

    def intact(self) -> "Made":
        """Itself. Raises BadInput where the folder now holds something else."""
        if made_hash(self.folder) != self.digest:
            what = f"the result of {self.stage} is no longer what it was: it was made again, changed or removed"
            raise BadInput(what, str(self.folder), "Use the newer result, or give every call its own folder (out=...).")
        return self


@dataclass(frozen=True)
class Origin:
    """What a result comes from: flight, declared kite, seed, split, and the stages that led to it."""

    flight: Flight
    kite: Kite
    seed: int = 0
    split: Mapping[str, Any] = field(default_factory=dict)
    made: Mapping[str, Made] = field(default_factory=dict)

    def joined(self, *others: "Origin") -> "Origin":
        """With what others have made too. Raises BadInput where they are not of one flight, kite, seed and split, or differ in a stage."""
        made = dict(self.made)
        for other in others:
            for what in ("flight", "kite"):
                if getattr(self, what).path.resolve() != getattr(other, what).path.resolve():
                    a, b = getattr(self, what).path, getattr(other, what).path
                    raise BadInput(f"these results are of two {what}s: {a} and {b}", do="Give results of one.")
            if (self.seed, dict(self.split)) != (other.seed, dict(other.split)):
                raise BadInput("these results are of two seeds or two splits of the flight", do="Give results of one.")
            for name, theirs in other.made.items():
                if made.setdefault(name, theirs).digest != theirs.digest:
                    raise BadInput(f"these results stand on two different results of {name}", do="Give results that stand on one.")
        return replace(self, made={name: made[name] for name in TABLE if name in made})

    def context(self) -> Context:
        """What a stage would see of it: to read only."""
        upstreams = {name: made.intact().folder for name, made in self.made.items()}
        split = Split(**self.split)
        inputs = Inputs(self.flight.path, self.kite.path, split)
        nowhere = Path()
        return Context(self.flight.path, self.kite.path, nowhere, nowhere, nowhere, self.seed, split, upstreams, Silent(), inputs)


@dataclass(frozen=True)
class Done:
    """A stage that has run: origin, with what it made; its folder, summary and notes."""

    origin: Origin
    folder: Path
    summary: Mapping[str, Any]
    notes: tuple[str, ...]


def run(verb: str, name: str, origin: Origin, settings: Mapping[str, Any], out: str | Path | None, progress: Progress | None) -> Done:
    """Run the stage `name` for the function `verb`. Raises BadInput and NumericalFailure as the stage does, but for a failure that its
    artifacts tell of."""
    keep = TemporaryDirectory(prefix="awes-", ignore_cleanup_errors=True) if out is None else None
    folder = Path(keep.name) if keep else Path(out)  # type: ignore[arg-type]
    plan, text = _planned(verb, name, origin, settings, folder)
    for made in origin.made.values():
        _bring(made.intact(), folder)
    for need in TABLE[name].needs(plan.settings[name]):
        if need.stage not in origin.made and (folder / need.stage).is_dir():
            what = f"a result of {need.stage} is here that {verb}() was not given, and {name} would use it"
            raise BadInput(what, str(folder / need.stage), "Give it, or name another folder (out=...).")
    put_beside(folder, {PLAN: text.encode()})
    heard = Heard(progress or Silent())
    try:
        summary = run_plan(plan, STAGES, only=(name,), progress=heard)[0].summary
    except NumericalFailure:
        kept = read_provenance(folder / name)
        if kept is None or FAILURE not in kept["summary"]:
            raise
        summary = kept["summary"]
    made = Made(name, folder / name, settings, made_hash(folder / name), keep)
    return Done(replace(origin, made={**origin.made, name: made}), folder / name, summary, tuple(heard.notes))


def _planned(verb: str, name: str, origin: Origin, settings: Mapping[str, Any], folder: Path) -> tuple[Plan, str]:
    """(the plan, its text). A kite that has no lasting file of its own is copied beside the results."""
    kite = origin.kite.path if origin.kite.keep is None else folder / KITE
    stages = {made.stage: _plain(made.settings, verb) for made in origin.made.values()} | {name: _plain(settings, verb)}
    data = {
        "flight": str(origin.flight.path.resolve()), "kite": str(kite.resolve()), "out": str(folder.resolve()), "seed": origin.seed,
        "split": dict(origin.split), "stages": stages,
    }  # fmt: skip
    places = {("stages", name): f"{verb}()", ("split",): f"{verb}()", ("seed",): f"{verb}()"}
    document = Document(f"{verb}()", data, places, OMIT)
    document.check(plan_model(STAGES))
    if kite != origin.kite.path:
        put_beside(folder, {KITE: origin.kite.path.read_bytes()})
    head = f"# Written by awescli.{verb}(); to make these results again: awes run --stages {PLAN}\n"
    return plan_of(document, folder / PLAN, STAGES), head + yaml.safe_dump(data, sort_keys=False, allow_unicode=True)


def _plain(value: Any, verb: str) -> Any:
    """A setting as YAML has it: flights and kites by their files."""
    if isinstance(value, (Flight, Kite)):
        if value.keep is not None:
            do = "Write it first (Kite.write), or name a folder where it is made (out=...)."
            raise BadInput("this has no lasting file", f"{verb}()", do)
        return str(value.path.resolve())
    if isinstance(value, Path):
        return str(value.resolve())
    if isinstance(value, Mapping):
        return {str(k): _plain(v, verb) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v, verb) for v in value]
    return value.item() if hasattr(value, "item") else value


def _bring(made: Made, folder: Path) -> None:
    """What a stage made, in the folder of the new results."""
    there = folder / made.stage
    if made.folder.resolve() == there.resolve() or made_hash(there) == made.digest:
        return
    if there.is_dir():
        raise BadInput(f"another result of {made.stage} is here", str(there), "Name another folder (out=...).")
    copied_folder(made.folder, there)


class Heard:
    """A Progress that keeps the notes and hands all on."""

    def __init__(self, inner: Progress):
        self.inner, self.notes = inner, []

    def task(self, description: str, total: int | None = None) -> Task:
        return self.inner.task(description, total)

    def note(self, text: str) -> None:
        self.notes.append(text)
        self.inner.note(text)
