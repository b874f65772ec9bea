"""stages.yaml -> Plan: which flight, which kite, where to, and the settings of every stage, all checked.

Paths in the file are relative to the file's folder. Paths given by `--set` are relative to the current folder if they exist there,
else to the file's folder; `--set out=...` is always relative to the current folder (it need not exist yet).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, create_model

from awescli.notation.document import Document, open_document
from awescli.notation.errors import BadInput, BadInputs
from awescli.stages.base import Split, Stage, StageConfig

OMIT = ("stages",)
"""`identify.horizon` is short for `stages.identify.horizon`, in messages and in `--set`."""


class SharedSettings(BaseModel):
    """What all stages share: the top level of stages.yaml."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    flight: Path = Field(description="folder of the flight log")
    kite: Path = Field(description="kite file: the declared model of the kite")
    out: Path = Field(Path("out"), description="folder for the results")
    seed: int = Field(0, ge=0, lt=2**63, description="seed of everything random")
    split: Split = Field(default_factory=Split, description="how the flight's loops are divided: train, validation, test, order")


@dataclass(frozen=True)
class Plan:
    """A checked plan; every path is ready to open.

    file: the stages.yaml; settings: stage name -> its settings, for every stage there is; planned: the stages that `awes run`
    runs, in the order of the stages table; where: parts of a key -> its place, `stages.yaml:12: identify.horizon` or `--set ...`.
    """

    file: Path
    flight: Path
    kite: Path
    out: Path
    seed: int
    split: Split
    settings: Mapping[str, StageConfig]
    planned: tuple[str, ...]
    where: Callable[..., str] = lambda *key: ".".join(key[1:])


@cache
def plan_model(stages: tuple[Stage, ...]) -> type[SharedSettings]:
    """The pydantic model of stages.yaml with these stages."""
    nothing_means_defaults = BeforeValidator(lambda value: {} if value is None else value)
    fields: dict[str, Any] = {
        stage.name.replace("-", "_"): (
            # the default is never read: absent stages are told from present ones by `model_fields_set`
            Annotated[stage.Config, nothing_means_defaults],
            Field(default_factory=stage.Config, alias=stage.name, description=stage.help),
        )
        for stage in stages
    }
    table = create_model("Stages", __config__=ConfigDict(frozen=True, extra="forbid"), __doc__="Stage name -> its settings.", **fields)
    description = "stages that `awes run` runs, each with its settings ({} for defaults)"
    return create_model(
        "Plan",
        __base__=SharedSettings,
        __doc__="A plan of awes: stages.yaml.",
        stages=(Annotated[table, nothing_means_defaults], Field(default_factory=table, description=description)),
    )


def read_plan(path: Path, stages: Sequence[Stage], overrides: Mapping[str, str] | None = None) -> Plan:
    """The plan in `path` with `overrides` (dotted key -> YAML text); raises BadInput, or BadInputs for several mistakes."""
    return plan_of(open_document(path, omit=OMIT).with_overrides(overrides or {}, plan_model(tuple(stages))), path, stages)


def plan_of(document: Document, path: Path, stages: Sequence[Stage]) -> Plan:
    """The plan that a document holds, as if it stood in `path`; raises as `read_plan` does."""
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
        if isinstance(value, Path):
            return self.of(value, loc)
        if isinstance(value, BaseModel):
            fields = type(value).model_fields
            new = {name: self.inside(getattr(value, name), (*loc, field.alias or name)) for name, field in fields.items()}
            return value.model_copy(update={k: v for k, v in new.items() if v is not getattr(value, k)})
        if isinstance(value, dict):
            return {k: self.inside(v, (*loc, str(k))) for k, v in value.items()}
        if isinstance(value, (list, tuple)) and any(isinstance(v, (Path, BaseModel)) for v in value):
            return type(value)(self.inside(v, (*loc, i)) for i, v in enumerate(value))
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
