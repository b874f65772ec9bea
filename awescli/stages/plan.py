"""stages.yaml -> Plan: which flight, which kite, where to, and the settings of every stage, all checked.

Paths in the file are relative to the file's folder. Paths given by `--set` are relative to the current folder if they exist there,
else to the file's folder; `--set out=...` is always relative to the current folder (it need not exist yet).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, create_model, field_validator

from awescli.flightlog.check_names import NAMES
from awescli.notation.document import Document, open_document
from awescli.notation.errors import BadInput, BadInputs, did_you_mean
from awescli.stages.base import Split, Stage, StageConfig
from awescli.stages.flights import FLIGHT, FLIGHTS, alone

OMIT = ("stages",)
"""`identify.horizon` is short for `stages.identify.horizon`, in messages and in `--set`."""


class SharedSettings(BaseModel):
    """What all stages share: the top level of stages.yaml."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    flight: Path = Field(description="folder of the flight log")
    flights: list[Path] = Field(
        [], min_length=1, max_length=10_000,
        description="instead of `flight`: folders of many flights, or patterns (logs/2024*); each is run by itself, into out/ITS_NAME",
    )  # fmt: skip
    kite: Path = Field(description="kite file: the declared model of the kite")
    out: Path = Field(Path("out"), description="folder for the results")
    seed: int = Field(0, ge=0, lt=2**63, description="seed of everything random")
    split: Split = Field(default_factory=Split, description="how the flight's loops are divided: train, validation, test, order")
    ignore: tuple[str, ...] = Field((), max_length=100, description="data checks that may not stop a run, by their names in `awes check`")

    @field_validator("ignore")
    @classmethod
    def _known_checks(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in NAMES:
                raise ValueError(BadInput(f"there is no data check '{name}'", do=did_you_mean(name, NAMES)))
        return names


@dataclass(frozen=True)
class Plan:
    """A checked plan; every path is ready to open.

    file: the stages.yaml; settings: stage name -> its settings, for every stage there is; planned: the stages that `awes run`
    runs, in the order of the stages table; ignore: data checks that may not stop it; where: parts of a key -> its place,
    `stages.yaml:12: identify.horizon` or `--set ...`; name: which one of the plan's `flights` this is, empty where it names one `flight`.
    """

    file: Path
    flight: Path
    kite: Path
    out: Path
    seed: int
    split: Split
    settings: Mapping[str, StageConfig]
    planned: tuple[str, ...]
    ignore: tuple[str, ...] = ()
    where: Callable[..., str] = lambda *key: ".".join(key[1:])
    name: str = ""

    def anchored(self) -> "Plan":
        """The same plan with paths that mean the same from every folder: for processes that stand elsewhere."""
        settings = {name: _each_path(config, lambda path, loc: path.absolute(), ()) for name, config in self.settings.items()}
        ends = {key: getattr(self, key).absolute() for key in ("file", "flight", "kite", "out")}
        return replace(self, settings=settings, **ends)


@dataclass(frozen=True)
class Plans:
    """What a stages.yaml asks for: one plan, or one for each of its `flights`.

    file: the stages.yaml; out: folder of all results; by_flight: name of the flight -> its plan; "" where the file names one `flight`.
    """

    file: Path
    out: Path
    by_flight: Mapping[str, Plan]

    @property
    def many(self) -> bool:
        """Does the file name `flights`, be it one?"""
        return "" not in self.by_flight

    def one(self, name: str = "") -> Plan:
        """The plan of the flight called `name`. Raises BadInput where it is not said which, or not known."""
        if name in self.by_flight:
            return self.by_flight[name]
        if not self.many:
            do = f"Leave it out; for another flight: --set {FLIGHT}=DIR."
            raise BadInput("the plan names one flight, and no `flights`", f"--flight {name}", do)
        if name:
            raise BadInput(f"the plan has no flight '{name}'", "--flight", did_you_mean(name, self.by_flight))
        names = list(self.by_flight)
        known = f"{', '.join(names[:8])}{', ...' if len(names) > 8 else ''}"
        what = f"the plan names {len(names)} flights, and this is asked of one"
        raise BadInput(what, str(self.file), f"Choose one: --flight {names[0]} (there are {known}).")


@cache
def plan_model(stages: tuple[Stage, ...]) -> type[SharedSettings]:
    """The pydantic model of stages.yaml with these stages."""
    nothing_means_defaults = BeforeValidator(lambda value: {} if value is None else value)
    fields: dict[str, Any] = {
        stage.name.replace("-", "_"): (
            # the default is never read: absent stages are distinguished from present ones by `model_fields_set`
            Annotated[stage.Config, nothing_means_defaults],
            Field(default_factory=stage.Config, alias=stage.name, description=stage.help),
        )
        for stage in stages
    }
    table = create_model("Stages", __config__=ConfigDict(frozen=True, extra="forbid"), __doc__="Stage name -> its settings.", **fields)
    description = "stages that `awes run` runs, each with its settings ({} for defaults)"
    known: dict[str, Any] = {"stages": (Annotated[table, nothing_means_defaults], Field(default_factory=table, description=description))}
    return create_model("Plan", __base__=SharedSettings, __doc__="A plan of awes: stages.yaml.", **known)


def read_plan(path: Path, stages: Sequence[Stage], overrides: Mapping[str, str] | None = None) -> Plan:
    """The plan in `path`, of one flight, with `overrides` (dotted key -> YAML text); raises BadInput, or BadInputs for several mistakes."""
    return read_plans(path, stages, overrides).one()


def read_plans(path: Path, stages: Sequence[Stage], overrides: Mapping[str, str] | None = None) -> Plans:
    """What `path` asks for, of one flight or of many; raises as `read_plan` does, for a folder of `flights` that is no flight too."""
    document = open_document(path, omit=OMIT).with_overrides(overrides or {}, plan_model(tuple(stages)))
    if not isinstance(document.data, dict) or FLIGHTS not in document.data:
        plan = plan_of(document, path, stages)
        return Plans(path, plan.out, {"": plan})
    if FLIGHT in document.data:
        do = f"Keep one of them; to run one of several: --{FLIGHT} NAME."
        raise BadInput(f"the plan names a `{FLIGHT}` and `{FLIGHTS}` too", document.where(FLIGHTS), do)
    checked: Any = replace(document, data={**document.data, FLIGHT: "."}).check(plan_model(tuple(stages)))
    out = _Paths(document, path.parent).of(checked.out, ("out",), exists=False)
    of_each = alone(document, path.parent, checked.flights, checked.out, [s.name for s in stages])
    found, errors = {}, []
    for name, own in of_each.items():
        try:
            found[name] = replace(plan_of(own, path, stages), name=name)
        except BadInput as e:
            errors += e.errors if isinstance(e, BadInputs) else [e]
    once = list({str(e): e for e in errors}.values())
    if once:
        raise once[0] if len(once) == 1 else BadInputs(once)
    return Plans(path, out, found)


def plan_of(document: Document, path: Path, stages: Sequence[Stage]) -> Plan:
    """The plan of one flight that a document holds, as if it stood in `path`; raises as `read_plan` does."""
    checked: Any = document.check(plan_model(tuple(stages)))
    place = _Paths(document, path.parent)
    settings = {s.name: place.inside(getattr(checked.stages, s.name.replace("-", "_")), ("stages", s.name)) for s in stages}
    present = checked.stages.model_fields_set
    plan = Plan(
        file=path,
        flight=place.of(checked.flight, ("flight",)),
        kite=place.of(checked.kite, ("kite",)),
        out=place.of(checked.out, ("out",), exists=False),
        seed=checked.seed,
        split=checked.split,
        settings=settings,
        planned=tuple(s.name for s in stages if s.name.replace("-", "_") in present),
        ignore=checked.ignore,
        where=document.where,
    )
    _check_paths(plan, document)
    return plan


@dataclass(frozen=True)
class _Paths:
    """Where the paths of a plan lead."""

    document: Document
    folder: Path

    def of(self, path: Path, loc: tuple[str | int, ...], exists: bool = True) -> Path:
        """`path`, written at `loc`, ready to open."""
        from_command_line = self.document.where(*loc).startswith("--set")
        if from_command_line and (not exists or path.exists()):
            return path
        return self.folder / path

    def inside(self, value: Any, loc: tuple[str | int, ...]) -> Any:
        """The same value with every Path in it made ready to open."""
        return _each_path(value, self.of, loc)


def _each_path(value: Any, new: Callable[[Path, tuple[str | int, ...]], Path], loc: tuple[str | int, ...]) -> Any:
    """The same value with every Path in it, at whatever depth, replaced by new(path, where it stands)."""
    if isinstance(value, Path):
        return new(value, loc)
    if isinstance(value, BaseModel):
        fields = type(value).model_fields
        found = {name: _each_path(getattr(value, name), new, (*loc, field.alias or name)) for name, field in fields.items()}
        return value.model_copy(update={k: v for k, v in found.items() if v is not getattr(value, k)})
    if isinstance(value, dict):
        return {k: _each_path(v, new, (*loc, str(k))) for k, v in value.items()}
    if isinstance(value, (list, tuple)) and any(isinstance(v, (Path, BaseModel)) for v in value):
        return type(value)(_each_path(v, new, (*loc, i)) for i, v in enumerate(value))
    return value


def _check_paths(plan: Plan, document: Document) -> None:
    """The inputs exist and the results do not land on them."""
    errors = []
    if not plan.flight.exists():
        errors.append(BadInput(f"there is no flight folder {plan.flight}", document.where("flight"), "Name the folder of the flight log."))
    if plan.kite.is_dir() or not plan.kite.exists():
        what = f"{plan.kite} is a folder, a kite file is needed" if plan.kite.is_dir() else f"there is no kite file {plan.kite}"
        errors.append(BadInput(what, document.where("kite"), "Name the kite's YAML file."))
    if plan.out.exists() and not plan.out.is_dir():
        errors.append(BadInput(f"{plan.out} is a file, a folder is needed", document.where("out"), "Choose another name."))
    elif plan.flight.is_dir() and plan.out.resolve() == plan.flight.resolve():
        errors.append(BadInput("results would be written into the flight's own folder", document.where("out"), "Choose another folder."))
    if errors:
        raise errors[0] if len(errors) == 1 else BadInputs(errors)
