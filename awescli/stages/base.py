"""The contract of a stage: one question asked of a flight, config -> log -> model -> artifacts.

A stage is a file in this folder and a line in `STAGES`:

    class Config(StageConfig):
        horizon: float = Field(5.0, gt=0, description="seconds between re-initialisations")

    class Identify(Stage):
        name = "identify"
        help = "Estimate the free parameters of the kite from the flight."
        Config = Config
        makes = ("params.json", "kite.yaml", "metrics.json")

        def needs(self, config):
            return (Need("fit-controller", required=False),)

        def check(self, inputs, config):
            if config.horizon > inputs.log.time[-1]:
                yield "horizon", BadInput("longer than the flight", do="Use a shorter one.")

        def run(self, context, config):
            from awescli.flightlog.read import read_flight     # heavy imports are the first lines of run, so that
            from awescli.artifacts import write_json           # `awes --help` does not wait for torch

            log = read_flight(context.flight)
            ...
            write_json(context.folder / "params.json", params)
            return {"test error": 0.036}

The runner decides whether a stage runs; a stage never looks at the clock, the command line or another stage's folder but through
`context`. What a setting asks of this flight and this kite that they do not have, `check` says before anything is computed: for `awes
check`, and for the runner before it calls `run`. `run` raises BadInput for what the user can mend and NumericalFailure for a computation
without a usable answer; in both cases, and when it is interrupted, the artifacts of the run before stay as they were.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Protocol, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from awescli.notation.errors import BadInput
from awescli.notation.present import present

KITE_FILE = "kite.yaml"
"""The artifact by which a stage hands on a model: the kite's declaration with new values or effects."""
FAILURE = "failure"
"""Key of a stage's summary that holds a numerical failure, `outcome`, `what` and `do`: its artifacts stand and say so, and the command
ends with exit code 3."""


def _once(names: tuple[str, ...]) -> tuple[str, ...]:
    """Names that each stand there once."""
    if twice := [name for i, name in enumerate(names) if name in names[:i]]:
        raise ValueError(f"'{twice[0]}' is there twice")
    return names


Names = Annotated[tuple[str, ...], AfterValidator(_once), Field(min_length=1, max_length=1000)]
"""Names of channels, features, candidates: at least one, none twice."""
Seconds = Annotated[float, Field(ge=0.05, le=600)]
"""A time ahead [s]: longer than some samples, shorter than a flight."""


class StageConfig(BaseModel):
    """Base of every stage's settings. Every field has a default and a description (they become `awes init` and `--help`);
    what cannot be allowed is said by gt/ge/lt/le/Literal, or by a validator that raises ValueError. A field of type Path is
    relative to the plan's folder, and its content counts as an input: of a field called `flight` that of all files that are read as
    this flight."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Split(BaseModel):
    """How the flight's whole loops, or cycles, are divided. Stages are fitted to `train`, chosen on `validation`, judged on `test`."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    train: float = Field(default=0.5, gt=0, lt=1, description="share of loops that models are fitted to")
    validation: float = Field(default=0.2, gt=0, lt=1, description="share of loops that choices are made on")
    test: float = Field(default=0.3, gt=0, lt=1, description="share of loops that nothing is fitted to or chosen on")
    order: Literal["balanced", "chronological", "interleaved"] = Field(
        default="balanced",
        description="balanced: few stretches with alike ranges; chronological: train first, test last; interleaved: spread over the flight",
    )
    turn: int = Field(
        default=0, ge=0, le=1000, description="loops by which the parts move on: a few runs that differ in it see each loop unseen once"
    )
    of: Literal["loops", "cycles"] = Field(
        default="loops", description="what is dealt whole: loops of the traction, or pumping cycles with all their phases"
    )

    @model_validator(mode="after")
    def _shares_fill_the_flight(self) -> Self:
        if abs(total := self.train + self.validation + self.test - 1) > 1e-6:
            raise ValueError(f"train, validation and test must add up to 1, they add up to {total + 1:g}")
        return self


@dataclass(frozen=True)
class Need:
    """An upstream stage. required: without it there is nothing to do; otherwise the stage does without, and its result is
    made again once the upstream stage has run."""

    stage: str
    required: bool = True


class Task(Protocol):
    """One piece of work under way."""

    def advance(self, n: int = 1) -> None:
        """`n` more steps are done."""

    def update(self, text: str) -> None:
        """What is happening now, a few words (`cost 0.0312`)."""


class Progress(Protocol):
    """How a stage tells the person who waits; the command line shows it."""

    def task(self, description: str, total: int | None = None) -> Task:
        """Begin a piece of work of `total` steps (None: not known). The one before counts as ended."""
        ...

    def note(self, text: str) -> None:
        """One sentence the person should know: a choice made, something left out and why."""


class Silent:
    """A Progress, and its tasks, that show nothing: for tests and for use as a library."""

    def task(self, description: str, total: int | None = None) -> "Silent":
        return self

    def advance(self, n: int = 1) -> None:
        pass

    def update(self, text: str) -> None:
        pass

    def note(self, text: str) -> None:
        pass


@dataclass(frozen=True)
class Inputs:
    """What the stages of a plan are made from, read once: flight, kite: the plan's; split: its shares.

    log, parts, declared raise BadInput where the flight or the kite file cannot be used.
    """

    flight: Path
    kite: Path
    split: Split

    @cached_property
    def log(self) -> Any:
        """The FlightLog of the plan's flight."""
        from awescli.flightlog.read import read_flight

        return read_flight(self.flight)

    @cached_property
    def parts(self) -> Any:
        """Its whole loops, dealt to train, validation and test (`flightlog.split.Split`). BadInput too where a model would lack signals."""
        return self.parts_of(self.log, self.flight)

    def parts_of(self, log: Any, folder: Path) -> Any:
        """`parts` of another flight, dealt by the same shares."""
        from awescli.flightlog.cycles import pieces
        from awescli.flightlog.read import missing_for_model
        from awescli.flightlog.split import split
        from awescli.physics.kite import needed_by

        if missing := missing_for_model(log, needed_by(self.declared)):
            what = f"flight '{log.name}' lacks what a model needs: {'; '.join(missing)}"
            raise BadInput(what, str(folder), "See `awes check` for what it has.")
        return split(pieces(log, self.split.of), **self.split.model_dump(exclude={"of"}), log=log)

    @cached_property
    def quality(self) -> Any:
        """The DataQuality of the plan's flight, checks against the declared kite included, where log and kite file can be read so far."""
        from awescli.stages.data_checks import quality_of

        return quality_of(self, self.log, self.flight)

    @cached_property
    def declared(self) -> Any:
        """The KiteDeclaration of the plan's kite file."""
        from awescli.physics.declaration import read_kite

        return read_kite(self.kite)


@dataclass(frozen=True)
class Context:
    """What a stage may see and touch while it runs.

    flight: the flight's folder; kite: the declared kite file; out: the folder of all results (to read only);
    folder: where this stage writes, empty at first; it becomes `out/<stage>` as a whole when `run` returns;
    scratch: for checkpoints: survives an interruption, comes back only to a run with the same inputs, settings and code, and is
    removed when the stage has ended; seed, split: shared by all stages; progress: where to tell how it goes;
    upstreams: folders of the upstream stages in `needs` that have run and are up to date, in the order of the stages table;
    stamp: what this run of the stage is made from, as its provenance.json will say: inputs, seed, split, settings, code, versions;
    inputs: flight and kite, as they were read for `check`.
    """

    flight: Path
    kite: Path
    out: Path
    folder: Path
    scratch: Path
    seed: int
    split: Split
    upstreams: Mapping[str, Path]
    progress: Progress
    inputs: Inputs
    stamp: Mapping[str, Any] = field(default_factory=dict)

    def upstream(self, stage: str) -> Path | None:
        """The folder of an upstream stage of `needs`; None if it is optional and has not run (or is out of date)."""
        return self.upstreams.get(stage)

    def made_by(self, stage: str) -> Path:
        """The folder of an upstream stage that has run. Raises LookupError where it has not; who may go on without it asks `upstream`."""
        return present(self.upstream(stage), f"what {stage} leaves")

    def model_kite(self) -> Path:
        """The kite file of the newest model upstream: of the last stage in `needs` that hands one on, else the declared one.

        "Newest" is by the order of the stages table: trace-residual's where it has run since identify, else identify's.
        """
        for folder in reversed([*self.upstreams.values()]):
            if (kite := folder / KITE_FILE).is_file():
                return kite
        return self.kite


class Stage(ABC):
    """One question asked of a flight. Subclasses fill this and are final."""

    name: ClassVar[str]
    """The command (`train-hybrid`) and the name of the folder of its artifacts."""
    help: ClassVar[str]
    """One line: the command's help."""
    Config: ClassVar[type[StageConfig]] = StageConfig
    """Its settings. `report: bool` becomes the option `--report`; with `figures: bool` there is `--figures DIR` too, which writes what
    `figures` gives to DIR and leaves the stage as it is."""
    makes: ClassVar[tuple[str, ...]]
    """Names of the files it always writes into `context.folder`; it may write more."""
    reads: ClassVar[tuple[str, ...]] = ("flight", "kite")
    """Which of the plan's inputs it reads; a change in one that it does not read does not make it run again."""

    def needs(self, config: Any) -> tuple[Need, ...]:
        """The upstream stages it takes something from; they stand before it in the stages table."""
        return ()

    def unread(self, config: Any, upstreams: Mapping[str, Path]) -> tuple[str, ...]:
        """Those of `needs` that it leaves alone, by what the others (`upstreams`: stage -> its folder) say: they take no part in what it
        is made from, so that it stands when they are made again."""
        return ()

    def flights(self, config: Any) -> tuple[Path, ...]:
        """Folders of further flights that it takes something from, beside the plan's."""
        return ()

    def check(self, inputs: Inputs, config: Any) -> Iterable[tuple[str, BadInput]]:
        """What `run` would refuse, found without computing anything long: (name of the setting, or "", the mistake), all of them.

        Seen by `awes check` and by the runner, which calls it before `run`. It may raise BadInput too, as reading the inputs does.
        """
        return ()

    def figures(self, context: Context, config: Any) -> Iterable[tuple[str, str | bytes]]:
        """(file name, content) of its figures, drawn from the artifacts in `context.folder`, which are not touched."""
        return ()

    @abstractmethod
    def run(self, context: Context, config: Any) -> Mapping[str, Any]:
        """Do it. Returns the summary for the terminal: `answer` -> the sentences in which the stage ends (see answers.py); a mapping of
        mappings is shown above it as a table (rows of columns); label -> number or short text is for --json."""
