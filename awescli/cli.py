"""The command line, built from STAGES; the only file that prints or exits.

Every command is a thin shell around a function below it (`run_plan`, `read_plan`, ...). Exit codes: 0 done; 2 bad input;
3 a numerical failure; 130 interrupted. Only what `--help` needs is imported at the top: it must answer at once.
"""

import os
import signal
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from awescli import __version__
from awescli.notation.errors import AwesError, BadInput, BadInputs
from awescli.stages import STAGES
from awescli.stages.base import Stage

StagesFile = Annotated[Path, typer.Option("--stages", metavar="FILE", help="The plan.")]
Settings = Annotated[
    list[str],
    typer.Option("--set", metavar="KEY=VALUE", help="Replace a setting: any dotted key of the plan (identify.horizon=5.0). Repeatable."),
]
From = Annotated[str, typer.Option("--from", metavar="STAGE", help="Run this stage and all after it, changed or not.")]
Force = Annotated[bool, typer.Option("--force", help="Run also what has not changed.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Say what would run and why; run nothing.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print errors only.")]
Json = Annotated[bool, typer.Option("--json", help="Print the summary as JSON on stdout, all else on stderr.")]
Report = Annotated[bool, typer.Option("--report", help="Also write the report, one self-contained HTML file.")]


def main() -> None:
    """Entry point of the `awes` command."""
    build_app(STAGES)()


def build_app(stages: tuple[Stage, ...]) -> typer.Typer:
    """The `awes` application with one command for every stage."""
    # plain help: rich's costs a third of the time that --help may take
    app = typer.Typer(
        name="awes",
        help="Close the loop between an airborne wind energy model and its measured flights.",
        no_args_is_help=True,
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"max_content_width": 120},
    )

    def show_version(wanted: bool) -> None:
        if wanted:
            print(f"awes {__version__}")
            raise typer.Exit()

    @app.callback()
    def awes(version: Annotated[bool, typer.Option("--version", callback=show_version, is_eager=True, help="Print the version.")] = False):
        pass

    @app.command(help="Run all stages of the plan in order; unchanged ones are skipped with the reason.")
    def run(
        stages_file: StagesFile = Path("stages.yaml"),
        settings: Settings = [],  # noqa: B006 - typer copies it
        begin: From = "",
        force: Force = False,
        dry_run: DryRun = False,
        quiet: Quiet = False,
        as_json: Json = False,
    ):
        with _shell(as_json, quiet) as screen:
            _run(screen, stages, stages_file, settings, begin=begin or None, force=force, dry_run=dry_run)

    for stage in stages:
        _add_stage(app, stage, stages)

    @app.command(help="Validate the plan, the kite file and the flight log; print a data-quality table.")
    def check(stages_file: StagesFile = Path("stages.yaml"), settings: Settings = [], as_json: Json = False):  # noqa: B006
        with _shell(as_json) as screen:
            _check(screen, stages, stages_file, settings)

    @app.command(help="Write a commented stages.yaml to start from.")
    def init(
        folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for the new stages.yaml.")],
        flight: Annotated[Path, typer.Option(metavar="F", help="Folder of the flight log.")],
        kite: Annotated[Path, typer.Option(metavar="K", help="Kite file.")],
    ):
        with _shell() as screen:
            _init(screen, stages, folder, flight, kite)

    @app.command(help="Print the JSON Schema of stages.yaml and of the kite file, for editor completion.")
    def schema():
        with _shell(as_json=True) as screen:
            from awescli.physics.declaration import KiteDeclaration
            from awescli.stages.starter import draft7, plan_schema

            screen.answer({"stages": plan_schema(stages), "kite": draft7(KiteDeclaration)})

    return app


def _add_stage(app: typer.Typer, stage: Stage, stages: tuple[Stage, ...]) -> None:
    """The command of one stage. A setting `report` of the stage becomes `--report`."""

    def go(stages_file: Path, settings: list[str], force: bool, dry_run: bool, quiet: bool, as_json: bool) -> None:
        with _shell(as_json, quiet) as screen:
            _run(screen, stages, stages_file, settings, only=(stage.name,), force=force, dry_run=dry_run)

    def plain(
        stages_file: StagesFile = Path("stages.yaml"),
        settings: Settings = [],  # noqa: B006 - typer copies it
        force: Force = False,
        dry_run: DryRun = False,
        quiet: Quiet = False,
        as_json: Json = False,
    ):
        go(stages_file, settings, force, dry_run, quiet, as_json)

    def with_report(
        stages_file: StagesFile = Path("stages.yaml"),
        settings: Settings = [],  # noqa: B006 - typer copies it
        report: Report = False,
        force: Force = False,
        dry_run: DryRun = False,
        quiet: Quiet = False,
        as_json: Json = False,
    ):
        go(stages_file, [*settings, *([f"{stage.name}.report=true"] if report else [])], force, dry_run, quiet, as_json)

    command = with_report if "report" in stage.Config.model_fields else plain
    app.command(stage.name, help=stage.help, epilog=_settings_help(stage))(command)


def _settings_help(stage: Stage) -> str | None:
    """The stage's settings, for the end of its --help."""
    rows = []
    for name, field in stage.Config.model_fields.items():
        default = field.get_default(call_default_factory=True, validated_data={})
        rows.append(f"{stage.name}.{field.alias or name} ({default}): {field.description or ''}".rstrip(": "))
    # \b keeps the lines apart
    return "\b\nSettings (--set KEY=VALUE), defaults in brackets:\n" + "\n".join(f"  {row}" for row in rows) if rows else None


# --- the commands --------------------------------------------------------------------------------------------------------


def _overrides(settings: Sequence[str]) -> dict[str, str]:
    """`KEY=VALUE` texts -> {key: value}; the last of several for one key counts."""
    found, errors = {}, []
    for text in settings:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            errors.append(BadInput("not KEY=VALUE", f"--set {text}", "Write for example --set identify.horizon=5.0."))
        found[key.strip()] = value
    if errors:
        raise errors[0] if len(errors) == 1 else BadInputs(errors)
    return found


def _run(screen: "Screen", stages: tuple[Stage, ...], file: Path, settings: Sequence[str], **choices: Any) -> None:
    """Run the plan, or one stage of it, and show what came of it."""
    from awescli.stages.plan import read_plan
    from awescli.stages.runner import run_plan

    plan = read_plan(file, stages, _overrides(settings))
    results = run_plan(plan, stages, progress=screen, report=screen.stage_event, **choices)
    for result in results:
        if result.status in ("ran", "unchanged"):
            screen.summary(result.stage, result.summary)
    screen.answer(
        {
            "out": str(plan.out),
            "stages": [
                {
                    "stage": r.stage,
                    "status": r.status,
                    "reason": r.reason,
                    "seconds": round(r.seconds, 3),
                    "summary": _json_safe(r.summary),
                }
                for r in results
            ],
        }
    )


def _check(screen: "Screen", stages: tuple[Stage, ...], file: Path, settings: Sequence[str]) -> None:
    """Everything that can be wrong before hours are spent; all complaints together."""
    from awescli.flightlog.quality import data_quality
    from awescli.flightlog.read import read_flight
    from awescli.physics.declaration import read_kite
    from awescli.stages.plan import read_plan

    plan = read_plan(file, stages, _overrides(settings))
    screen.line(f"plan    {plan.file}: good, runs {', '.join(plan.planned) or 'nothing'}")
    errors: list[BadInput] = []
    log = None
    try:
        read_kite(plan.kite)
        screen.line(f"kite    {plan.kite}: good")
    except BadInput as e:
        errors.append(e)
    try:
        log = read_flight(plan.flight)
        screen.line(f"flight  {plan.flight}: readable, {len(log)} samples in {len(log) * log.dt:.1f} s at {1 / log.dt:.4g} Hz")
    except BadInput as e:
        errors.append(e)
    if log is not None:
        quality = data_quality(log)
        for title, content in _quality_sections(quality).items():
            screen.section(title, content)
        screen.answer({"plan": str(plan.file), "quality": _json_safe(quality.as_dict())})
    if errors:
        raise errors[0] if len(errors) == 1 else BadInputs(errors)


def _quality_sections(quality: Any) -> dict[str, Any]:
    """A DataQuality (flightlog/quality.py) as title -> table, list or sentence."""
    sections: dict[str, Any] = {
        "signals": {
            c.name: {"unit": c.unit, "low": c.low, "high": c.high, "noise": "" if c.noise is None else c.noise, "clock": c.group}
            for c in quality.channels
        },
        "checks": {
            c.name: {"value": c.value, "limit": c.threshold, "unit": c.unit, "": "good" if c.ok else "NOT GOOD", "means": c.sentence}
            for c in quality.checks
        },
        "phases [s]": dict(quality.phases),
        "left out [s]": dict(quality.left_out),
        "loops": quality.loops,
    }
    if counted := {name: number for name, number in quality.counters.items() if number}:
        sections["counted while reading"] = counted
    lists = {"missing for a model": quality.missing, "notes": quality.notes}
    sections |= {title: list(items) for title, items in lists.items() if items}
    bad = [c.name for c in quality.checks if not c.ok]
    sections["verdict"] = "good" if quality.ok else "look at " + ", ".join([*bad, *(["what is missing"] if quality.missing else [])])
    return sections


def _init(screen: "Screen", stages: tuple[Stage, ...], folder: Path, flight: Path, kite: Path) -> None:
    """A stages.yaml to start from."""
    from awescli.artifacts import write_text
    from awescli.stages.starter import starter_text

    file = folder / "stages.yaml"
    if file.exists():
        raise BadInput("is there already and is not overwritten", str(file), "Choose another folder, or move it away.")
    if not flight.exists():
        raise BadInput("there is no such folder", f"--flight {flight}", "Name the folder of the flight log.")
    if not kite.is_file():
        raise BadInput("there is no such file", f"--kite {kite}", "Name the kite's YAML file.")
    relative = [os.path.relpath(path.resolve(), folder.resolve()) if not path.is_absolute() else str(path) for path in (flight, kite)]
    write_text(file, starter_text(stages, *relative))
    screen.line(f"wrote {file}; next: cd {folder}; awes check; awes run")


# --- the shell around every command ---------------------------------------------------------------------------------------


@contextmanager
def _shell(as_json: bool = False, quiet: bool = False) -> Iterator["Screen"]:
    """A screen to print on; errors become messages and exit codes, signals become interruptions."""
    screen = Screen(as_json, quiet)
    code = 0
    before = _terminate_like_ctrl_c()
    try:
        yield screen
    except AwesError as e:
        code = e.exit_code
        screen.error(f"error: {e}")
    except KeyboardInterrupt:
        code = 130
        screen.error(screen.interrupted())
    except BrokenPipeError:  # `awes ... | head`: the reader has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as e:
        code = 2
        screen.error(f"error: {e.filename or 'file'}: {e.strerror or e}\n  Check paths, permissions and free space.")
    except (typer.Exit, typer.Abort):
        raise
    except Exception as e:
        if os.environ.get("AWES_DEBUG"):
            raise
        code = 1
        screen.error(f"error: {_last_place(e)}: {type(e).__name__}: {e}\n  This is a fault of awes. AWES_DEBUG=1 shows where it happened.")
    finally:
        screen.close()
        if before is not None:
            signal.signal(signal.SIGTERM, before)
    if code:
        raise typer.Exit(code)


def _terminate_like_ctrl_c() -> Any:
    """SIGTERM stops a run as cleanly as Ctrl-C does. Returns the handler before, None outside the main thread."""

    def interrupt(number: int, frame: Any) -> None:
        raise KeyboardInterrupt

    try:
        return signal.signal(signal.SIGTERM, interrupt)
    except ValueError:
        return None


def _last_place(e: BaseException) -> str:
    """`identify.py:120`: the deepest frame of an unexpected error."""
    trace, place = e.__traceback__, "awes"
    while trace is not None:
        place = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"
        trace = trace.tb_next
    return place


class Screen:
    """What the person sees: bars and colours on a terminal, plain lines in a pipe; with --json all of it on stderr.

    It is also the `Progress` that stages report to.
    """

    def __init__(self, as_json: bool = False, quiet: bool = False):
        self.as_json, self.quiet = as_json, quiet
        self.stream = sys.stderr if as_json else sys.stdout
        self.fancy = not quiet and self.stream.isatty() and os.environ.get("TERM") != "dumb"
        self.bars: Any = None
        self.running = ""
        self.finished: list[str] = []
        self._console: Any = None

    @property
    def console(self) -> Any:
        if self._console is None:
            from rich.console import Console

            options = {} if self.fancy else {"color_system": None, "force_terminal": False, "width": 140}
            self._console = Console(file=self.stream, highlight=False, **options)
        return self._console

    # lines

    def line(self, text: str) -> None:
        if not self.quiet:
            self.console.print(text, markup=False, soft_wrap=True)

    def error(self, text: str) -> None:
        self.close()
        print(text, file=sys.stderr)

    def answer(self, obj: Any) -> None:
        """The machine-readable answer, with --json."""
        if self.as_json:
            import json

            print(json.dumps(obj, indent=2, allow_nan=False))

    # progress of the runner

    def stage_event(self, stage: str, event: Any) -> None:
        """A stage begins (event: why) or has ended (event: its Result)."""
        if isinstance(event, str):
            self.running = stage
            self.line(f"{stage}: runs ({event})")
            return
        self._end_task()
        self.running = ""
        self.finished.append(stage)
        if event.status == "ran":
            self.line(f"{stage}: done in {event.seconds:.1f} s")
        elif event.status == "unchanged":
            self.line(f"{stage}: skipped, unchanged")
        else:
            self.line(f"{stage}: {event.status} ({event.reason})")

    def interrupted(self) -> str:
        text = f"interrupted during {self.running}" if self.running else "interrupted"
        kept = f"Finished and kept: {', '.join(self.finished)}." if self.finished else "Results from before are as they were."
        return f"{text}\n  {kept} The same command continues."

    # Progress, for stages

    def task(self, description: str, total: int | None = None) -> "_Bar | _PlainTask":
        self._end_task()
        if not self.fancy:
            return _PlainTask(self, description, total)
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        columns = TextColumn("  {task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
        self.bars = Progress(*columns, TextColumn("{task.fields[text]}", markup=False), console=self.console, transient=True)
        self.bars.start()
        return _Bar(self.bars, self.bars.add_task(description, total=total, text=""))

    def note(self, text: str) -> None:
        self.line(f"  {text}")

    def _end_task(self) -> None:
        if self.bars is not None:
            self.bars.stop()
            self.bars = None

    def close(self) -> None:
        self._end_task()

    # summaries

    def summary(self, stage: str, summary: Mapping[str, Any]) -> None:
        """A stage's summary: one line of numbers, and a table for every mapping of mappings."""
        numbers = {k: v for k, v in summary.items() if not isinstance(v, Mapping)}
        if numbers:
            self.line(f"{stage}: " + ", ".join(f"{k} {_text(v)}" for k, v in numbers.items()))
        for title, content in summary.items():
            if isinstance(content, Mapping):
                self.section(f"{stage}: {title}", content)

    def section(self, title: str, content: Any) -> None:
        """A table of rows of columns, a table of values, a list, or one value."""
        if self.quiet:
            return
        if isinstance(content, Mapping) and content:
            self.line(title)
            self.console.print(_table(content))
        elif isinstance(content, (list, tuple)):
            self.line(f"{title}:" + ("" if content else " none"))
            for item in content:
                self.line(f"  {_text(item)}")
        else:
            self.line(f"{title}: {_text(content)}")


class _Bar:
    """A task with a bar, on a terminal."""

    def __init__(self, bars: Any, task: Any):
        self.bars, self.id = bars, task

    def advance(self, n: int = 1) -> None:
        self.bars.advance(self.id, n)

    def update(self, text: str) -> None:
        self.bars.update(self.id, text=text)


class _PlainTask:
    """A task in a pipe or a log file: a line when it begins, then at most one every ten seconds."""

    def __init__(self, screen: Screen, description: str, total: int | None):
        self.screen, self.description, self.total = screen, description, total
        self.count, self.text, self.last = 0, "", time.monotonic()
        screen.line(f"  {description}")

    def advance(self, n: int = 1) -> None:
        self.count += n
        self._tell()

    def update(self, text: str) -> None:
        self.text = text
        self._tell()

    def _tell(self) -> None:
        if time.monotonic() - self.last >= 10:
            self.last = time.monotonic()
            steps = f" {self.count}/{self.total}" if self.total else f" {self.count}" if self.count else ""
            self.screen.line(f"  {self.description}{steps} {self.text}".rstrip())


def _table(content: Mapping[str, Any]) -> Any:
    """A rich table: rows of columns, or names and values."""
    from rich.table import Table
    from rich.text import Text

    rows = [row for row in content.values() if isinstance(row, Mapping)]
    columns = list(dict.fromkeys(key for row in rows for key in row)) or [""]
    table = Table(box=None, show_header=bool(rows), padding=(0, 2, 0, 0))
    table.add_column("")
    cells = [[row.get(c, "") for c in columns] if isinstance(row, Mapping) else [row] for row in content.values()]
    for i, column in enumerate(columns):
        sentences = any(len(_text(row[i])) > 24 for row in cells if i < len(row))
        table.add_column(Text(str(column)), justify="left" if sentences else "right")
    for name, row in zip(content, cells, strict=True):
        table.add_row(Text(f"  {name}"), *(Text(_text(cell)) for cell in row))
    return table


def _text(value: Any) -> str:
    """A number with four figures, a truth value as a word, all else as it is."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if hasattr(value, "item") and getattr(value, "ndim", 1) == 0:
        value = value.item()
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _json_safe(value: Any) -> Any:
    """Plain JSON values; what is not finite becomes text."""
    if isinstance(value, Mapping):
        return {str(k): _json_safe(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_json_safe(v) for v in value]
    if isinstance(value, float):
        return value if value == value and abs(value) != float("inf") else str(value)
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
