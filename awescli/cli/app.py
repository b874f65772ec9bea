"""The `awes` application: its commands and their options, one command for every stage of the table.

Every command is a thin shell around a function in commands.py. Only what `--help` needs is imported at the top: it must answer at once.
"""

from pathlib import Path
from typing import Annotated

import typer

from awescli import __version__
from awescli.cli import commands
from awescli.cli.shell import shell
from awescli.stages import STAGES
from awescli.stages.base import Stage

StagesFile = Annotated[Path, typer.Option("--stages", metavar="FILE", help="The plan.")]
Settings = Annotated[
    list[str],
    typer.Option("--set", metavar="KEY=VALUE", help="Replace a setting: any dotted key of the plan (identify.horizon=5.0). Repeatable."),
]
OneFlight = Annotated[str, typer.Option("--flight", metavar="NAME", help="Which one of the plan's `flights`.")]
Workers = Annotated[
    int | None,
    typer.Option(min=0, help="For a plan of many `flights`: processes, default one a core; 0: one flight after the other, without Dask."),
]
Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="For a plan of many `flights`: a running Dask scheduler (tcp://HOST:PORT) instead.")
]
From = Annotated[str, typer.Option("--from", metavar="STAGE", help="Run this stage and all after it, changed or not.")]
Force = Annotated[bool, typer.Option("--force", help="Run also what has not changed.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Say what would run and why; run nothing.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print errors only.")]
Json = Annotated[bool, typer.Option("--json", help="Print the summary as JSON on stdout, all else on stderr.")]
Report = Annotated[bool, typer.Option("--report", help="Also write the report, one self-contained HTML file, and one sheet of it as PDF.")]
Figures = Annotated[
    Path | None,
    typer.Option("--figures", metavar="DIR", help="Also write every figure of the report to DIR: PNG, SVG, and its data as CSV."),
]


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
        flight: OneFlight = "",
        workers: Workers = None,
        scheduler: Scheduler = None,
        quiet: Quiet = False,
        as_json: Json = False,
    ):
        with shell(as_json, quiet) as screen:
            choices = {"begin": begin or None, "force": force, "dry_run": dry_run}
            commands.run(screen, stages, stages_file, settings, flight=flight, workers=workers, scheduler=scheduler, **choices)

    for stage in stages:
        _add_stage(app, stage, stages)

    @app.command(help="Validate the plan, the kite file and the flight log; print a data-quality table.")
    def check(
        stages_file: StagesFile = Path("stages.yaml"),
        settings: Settings = [],  # noqa: B006 - typer copies it
        flight: OneFlight = "",
        as_json: Json = False,
    ):
        with shell(as_json) as screen:
            commands.check(screen, stages, stages_file, settings, flight)

    @app.command(help="Write a commented plan to start from; drafts a flight.yaml for a CSV of unknown layout, and a kite file to fill in.")
    def init(
        folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for the new files.")],
        flight: Annotated[Path, typer.Option(metavar="F", help="The flight log: a file, or its folder.")],
        kite: Annotated[Path | None, typer.Option(metavar="K", help="Kite file; without it, one to fill in is written.")] = None,
    ):
        with shell() as screen:
            commands.init(screen, stages, folder, flight, kite)

    @app.command(help="Write the bundled flight, its kite file and the standard plan into a new folder, to try awes on.")
    def demo(folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new folder, or an empty one.")]):
        with shell() as screen:
            commands.demo(screen, folder)

    @app.command(help="List the library of effects: where each acts, its parameters with units, plausible ranges and sources.")
    def effects(as_json: Json = False):
        with shell(as_json) as screen:
            commands.effects(screen)

    @app.command(help="Compare the results in a folder with their provenance: hashes of artifacts, inputs and stages upstream.")
    def verify(
        folder: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of the results (`out` of the plan).")] = Path("out"),
        as_json: Json = False,
    ):
        with shell(as_json) as screen:
            commands.verify(screen, stages, folder)

    @app.command(help="Compare two runs side by side: what they were made from, and which numbers differ.")
    def compare(
        run_a: Annotated[Path, typer.Argument(metavar="RUN_A", help="Folder of the results (`out` of a plan).")],
        run_b: Annotated[Path, typer.Argument(metavar="RUN_B", help="Folder of other results.")],
        tolerance: Annotated[float, typer.Option(min=0.0, help="Relative difference that still counts as equal.")] = 0.0,
        most: Annotated[int, typer.Option(min=0, help="Most differing numbers shown, largest change first (--json: all).")] = 40,
        as_json: Json = False,
    ):
        with shell(as_json) as screen:
            commands.compare(screen, stages, run_a, run_b, tolerance, most)

    @app.command(help="Hand out a model to other programs: C99, FMI 3.0, CasADi, JSBSim, awebox, KiteModels.jl, JSON.")
    def export(
        source: Annotated[Path, typer.Argument(metavar="RUN_OR_KITE", help="Folder of the results (`out` of the plan), or a kite file.")],
        model: Annotated[str, typer.Option(metavar="NAME", help="newest, initial, identified, with_effects or hybrid.")] = "newest",
        to: Annotated[
            str, typer.Option(metavar="FORM", help="c, fmu, casadi, jsbsim, awebox, kitemodels, json, several with commas, or all.")
        ] = "all",
        out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the files, one below it for each form.")] = Path("export"),
        surfaces: Annotated[
            str, typer.Option(metavar="WHO", help="inputs: set-points are inputs; controller: the fitted controller flies.")
        ] = "inputs",
        flight: Annotated[
            Path | None, typer.Option(metavar="LOG", help="Flight that tells heights of the wind, start and sample interval.")
        ] = None,
        as_json: Json = False,
    ):
        with shell(as_json) as screen:
            commands.export(screen, stages, source, to, out, label=model, surfaces=surfaces, flight=flight)

    @app.command(help="Print the JSON Schema of stages.yaml, of the kite file and of flight.yaml, for editor completion.")
    def schema():
        with shell(as_json=True) as screen:
            from awescli.flightlog.flight_file import FlightFile
            from awescli.physics.declaration import KiteDeclaration
            from awescli.stages.starter import draft7, plan_schema

            screen.answer({"stages": plan_schema(stages), "kite": draft7(KiteDeclaration), "flight": draft7(FlightFile)})

    return app


def _add_stage(app: typer.Typer, stage: Stage, stages: tuple[Stage, ...]) -> None:
    """The command of one stage. The settings `report` and `figures` of a stage that has a page become options."""

    def go(stages_file: Path, settings: list[str], quiet: bool, as_json: bool, **choices) -> None:
        with shell(as_json, quiet) as screen:
            commands.run(screen, stages, stages_file, settings, only=(stage.name,), **choices)

    def plain(
        stages_file: StagesFile = Path("stages.yaml"),
        settings: Settings = [],  # noqa: B006 - typer copies it
        flight: OneFlight = "",
        force: Force = False,
        dry_run: DryRun = False,
        quiet: Quiet = False,
        as_json: Json = False,
    ):
        go(stages_file, settings, quiet, as_json, flight=flight, force=force, dry_run=dry_run)

    def with_page(
        stages_file: StagesFile = Path("stages.yaml"),
        settings: Settings = [],  # noqa: B006 - typer copies it
        report: Report = False,
        figures: Figures = None,
        flight: OneFlight = "",
        force: Force = False,
        dry_run: DryRun = False,
        quiet: Quiet = False,
        as_json: Json = False,
    ):
        wanted = [f"{stage.name}.report=true"] if report else []
        go(stages_file, [*settings, *wanted], quiet, as_json, flight=flight, force=force, dry_run=dry_run, figures=figures)

    command = with_page if "report" in stage.Config.model_fields else plain
    app.command(stage.name, help=stage.help, epilog=_settings_help(stage))(command)


def _settings_help(stage: Stage) -> str | None:
    """The stage's settings, for the end of its --help."""
    rows = []
    for name, field in stage.Config.model_fields.items():
        default = field.get_default(call_default_factory=True, validated_data={})
        rows.append(f"{stage.name}.{field.alias or name} ({default}): {field.description or ''}".rstrip(": "))
    # \b keeps the lines apart
    return "\b\nSettings (--set KEY=VALUE), defaults in brackets:\n" + "\n".join(f"  {row}" for row in rows) if rows else None
