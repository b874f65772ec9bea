"""What each command does: read the plan, call the floors below, show what came of it."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from awescli.cli.screen import Screen
from awescli.cli.tables import json_safe
from awescli.notation.errors import BadInput, BadInputs
from awescli.stages.base import Stage


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


def run(
    screen: Screen, stages: tuple[Stage, ...], file: Path, settings: Sequence[str], figures: Path | None = None, **choices: Any
) -> None:
    """Run the plan, or one stage of it, and show what came of it. figures: where copies of its figures go."""
    from awescli.stages.plan import read_plan
    from awescli.stages.runner import run_plan

    if figures is not None and figures.exists() and not figures.is_dir():
        raise BadInput("is a file, a folder is needed", f"--figures {figures}", "Choose another name.")
    plan = read_plan(file, stages, _overrides(settings))
    results = run_plan(plan, stages, progress=screen, report=screen.stage_event, **choices)
    for result in results:
        if result.status in ("ran", "unchanged"):
            screen.summary(result.stage, result.summary)
            if figures is not None and not choices.get("dry_run"):
                _copy_figures(screen, plan.out / result.stage, figures)
    screen.answer(
        {
            "out": str(plan.out),
            "stages": [
                {
                    "stage": r.stage,
                    "status": r.status,
                    "reason": r.reason,
                    "seconds": round(r.seconds, 3),
                    "summary": json_safe(r.summary),
                }
                for r in results
            ],
        }
    )


def _copy_figures(screen: Screen, folder: Path, to: Path) -> None:
    """The figures of a stage's folder, in a folder of the user's."""
    from awescli.artifacts import copy_files
    from awescli.stages.page import FIGURES

    screen.line(f"figures: {copy_files(folder / FIGURES, to)} files in {to}")


def check(screen: Screen, stages: tuple[Stage, ...], file: Path, settings: Sequence[str]) -> None:
    """Everything that can be wrong before hours are spent; all complaints together."""
    from awescli.engine.object_cache import why_unused
    from awescli.flightlog.quality import data_quality
    from awescli.flightlog.read import read_flight
    from awescli.physics.declaration import read_kite
    from awescli.physics.doubts import doubts
    from awescli.stages.plan import read_plan

    plan = read_plan(file, stages, _overrides(settings))
    screen.line(f"plan    {plan.file}: good, runs {', '.join(plan.planned) or 'nothing'}")
    if why := why_unused():
        screen.line(f"cache   compiled code is not kept, each start takes seconds longer: {why}")
    errors: list[BadInput] = []
    log = None
    try:
        kite = read_kite(plan.kite)
        screen.line(f"kite    {plan.kite}: good")
        for doubt in doubts(kite):
            screen.line(f"        but {doubt}")
    except BadInput as e:
        errors.append(e)
    try:
        log = read_flight(plan.flight)
        screen.line(f"flight  {plan.flight}: readable, {len(log)} samples in {len(log) * log.dt:.1f} s at {1 / log.dt:.4g} Hz")
    except BadInput as e:
        errors.append(e)
    if log is not None:
        quality = data_quality(log)
        for title, content in quality_sections(quality).items():
            screen.section(title, content)
        screen.answer({"plan": str(plan.file), "quality": json_safe(quality.as_dict())})
    if errors:
        raise errors[0] if len(errors) == 1 else BadInputs(errors)


def quality_sections(quality: Any) -> dict[str, Any]:
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


def verify(screen: Screen, stages: tuple[Stage, ...], folder: Path) -> None:
    """Are the results in a folder what their provenance says? Every mismatch is one line, and makes it bad input."""
    from awescli.stages.verify import verify as compare

    verified = compare(folder, stages)
    for stage, count in verified.files.items():
        screen.line(f"{stage}: {count} files")
    screen.answer({"run": str(folder), "files": dict(verified.files), "mismatches": list(verified.mismatches)})
    if verified.mismatches:
        raise BadInputs([BadInput(line) for line in verified.mismatches])
    screen.line("all hashes as in the provenance")


def compare(screen: Screen, stages: tuple[Stage, ...], a: Path, b: Path, tolerance: float, most: int) -> None:
    """What differs between two runs: what they were made from, the errors of their models, their numbers."""
    from dataclasses import asdict

    from awescli.stages.comparison import compare as of_runs

    found = of_runs(a, b, stages, tolerance)
    screen.line(f"a  {a}\nb  {b}")
    for run, names in found.only.items():
        if names:
            screen.line(f"only in {run}: {', '.join(names)}")
    for stage, lines in found.made_from.items():
        screen.section(f"{stage}, a -> b", lines)
    errors = {m: {"a": x, "b": y, "b / a": y / x if x and y else None} for m, (x, y) in found.errors.items()}
    if errors:
        screen.section("mean NRMSE on the test loops", {m: {k: _or_dash(v) for k, v in row.items()} for m, row in errors.items()})
    both = [d for d in found.differences if not d.one_sided]
    screen.line(f"{len(both)} values differ, {found.same} are equal, {len(found.differences) - len(both)} are in one run only")
    if both[:most]:
        screen.section("largest changes", {d.where: {"a": d.a, "b": d.b} for d in both[:most]})
    if len(both) > most or len(both) < len(found.differences):
        screen.line("--most shows more of them, --json all")
    screen.answer({"a": str(a), "b": str(b), **json_safe(asdict(found))})


def _or_dash(value: Any) -> Any:
    return "-" if value is None else value


def init(screen: Screen, stages: tuple[Stage, ...], folder: Path, flight: Path, kite: Path) -> None:
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
