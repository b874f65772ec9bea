"""What each command does: read the plan, call the floors below, show what came of it."""

import shlex
from collections.abc import Iterable, Mapping, Sequence
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
    screen: Screen, stages: tuple[Stage, ...], file: Path, settings: Sequence[str], figures: Path | None = None, flight: str = "",
    **choices: Any,
) -> None:  # fmt: skip
    """Run the plan, or one stage of it, and show what came of it. figures: where copies of its figures go; flight: which one of many."""
    from awescli.artifacts import Journal
    from awescli.stages.plan import read_plans
    from awescli.stages.runner import drawn, run_plan

    if figures is not None and figures.exists() and not figures.is_dir():
        raise BadInput("is a file, a folder is needed", f"--figures {figures}", "Choose another name.")
    plans = read_plans(file, stages, _overrides(settings))
    processes = {key: choices.pop(key, None) for key in ("workers", "scheduler")}
    if plans.many and not flight and not choices.get("only"):
        return run_many(screen, stages, plans, **processes, **choices)
    plan = plans.one(flight)
    for option, value in processes.items():
        if value is not None:
            raise BadInput("one flight is run, in this process", f"--{option}", "Leave it out; it is for a plan with `flights: [...]`.")
    if not choices.get("dry_run"):
        screen.keep_log(Journal(plan.out))
    results = run_plan(plan, stages, progress=screen, report=screen.stage_event, **choices)
    for result in results:
        if result.status in ("ran", "unchanged") and figures is not None and not choices.get("dry_run"):
            _write_figures(screen, drawn(plan, stages, result.stage, screen), figures)
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


def run_many(
    screen: Screen, stages: tuple[Stage, ...], plans: Any, workers: int | None, scheduler: str | None, dry_run: bool = False, **choices: Any
) -> None:
    """Run the plan of every flight, show the table over them; ends with the exit code of what went wrong."""
    from awescli.artifacts import Journal
    from awescli.cli.flights import FlightLines, raise_for, show_table
    from awescli.stages.flights import PAGE, TABLE, TABLE_JSON
    from awescli.stages.many import run_flights

    if dry_run:
        return _decide_many(screen, stages, plans, **choices)
    screen.keep_log(Journal(plans.out))
    lines = FlightLines(screen, len(plans.by_flight))
    rows = run_flights(plans, stages, workers, scheduler, hear=lines.hear, **choices)
    screen.close()
    show_table(screen, rows, [str(plans.out / name) for name in (TABLE, TABLE_JSON, PAGE)])
    screen.answer({"out": str(plans.out), "flights": json_safe(rows)})
    raise_for(rows)


def _decide_many(screen: Screen, stages: tuple[Stage, ...], plans: Any, **choices: Any) -> None:
    """What would run, flight by flight."""
    from awescli.stages.checking import raise_all
    from awescli.stages.runner import run_plan

    decided, errors = [], []
    for name, plan in plans.by_flight.items():
        try:
            results = run_plan(plan, stages, dry_run=True, **choices)
        except BadInput as e:
            errors += e.errors if isinstance(e, BadInputs) else [e]
            continue
        for result in results:
            screen.line(f"{name}: {result.stage}: {result.status} ({result.reason})")
        decided.append({"flight": name, "stages": [{"stage": r.stage, "status": r.status, "reason": r.reason} for r in results]})
    screen.answer({"out": str(plans.out), "flights": decided})
    raise_all(errors)


def _write_figures(screen: Screen, files: Iterable[tuple[str, str | bytes]], to: Path) -> None:
    """The figures of a stage, in a folder of the user's, beside what may lie there. All are drawn before the first is written."""
    from awescli.artifacts import put_beside

    task, drawn = screen.task("drawing figures"), {}
    for name, content in files:
        drawn[name] = content.encode() if isinstance(content, str) else content
        task.advance()
    screen.close()
    put_beside(to, drawn)
    screen.line(f"figures: {len(drawn)} files in {to}")


def check(screen: Screen, stages: tuple[Stage, ...], file: Path, settings: Sequence[str], flight: str = "") -> None:
    """Everything that can be wrong before hours are spent; all complaints together. flight: which one of many, in full."""
    from awescli.engine.object_cache import why_unused
    from awescli.flightlog.reconstruction.flight_path import reconstruct
    from awescli.physics.doubts import doubts
    from awescli.stages.base import Inputs
    from awescli.stages.checking import raise_all, refused
    from awescli.stages.plan import read_plans

    plans = read_plans(file, stages, _overrides(settings))
    if plans.many and not flight:
        return check_many(screen, stages, plans)
    plan = plans.one(flight)
    screen.paragraph(f"plan    {plan.file}: good, runs {', '.join(plan.planned) or 'nothing'}")
    if why := why_unused():
        screen.paragraph(f"cache   compiled code is not kept, each start takes seconds longer: {why}")
    inputs = Inputs(plan.flight, plan.kite, plan.split)
    errors: list[BadInput] = []
    log = None
    noise: dict[str, float] = {}
    try:
        noise = {channel: std for channel, (std, share) in inputs.declared.noise.channels().items() if not share}
        screen.line(f"kite    {plan.kite}: good, {sum(row.free for row in inputs.declared.parameters.values())} free parameters")
        for doubt in doubts(inputs.declared):
            screen.paragraph(f"but {doubt}", 8 * " ")
    except BadInput as e:
        errors += e.errors if isinstance(e, BadInputs) else [e]
    try:
        log = inputs.log
        screen.line(f"flight  {plan.flight}: readable, {len(log)} samples in {len(log) * log.dt:.1f} s at {1 / log.dt:.4g} Hz")
    except BadInput as e:
        errors += e.errors if isinstance(e, BadInputs) else [e]
    if log is not None:
        quality = inputs.quality
        for title, content in quality_sections(quality).items():
            screen.section(title, content)
        path = reconstruct(log)
        for title, content in kinematics_sections(path, noise).items():
            screen.section(title, content)
        answer = {"plan": str(plan.file), "quality": quality.as_dict(), "kinematics": path.as_dict()}
        screen.answer(json_safe(answer))
    for stage in stages:
        if stage.name in plan.planned:
            errors += refused(stage, inputs, plan)
    raise_all(errors)
    if plan.planned:
        at = "" if str(plan.file) == "stages.yaml" else f" --stages {plan.file}"
        at += f" --flight {flight}" if flight else ""
        one_by_one = "" if at else f"; stage by stage: {', '.join(f'awes {name}' for name in plan.planned[:2])}, ..."
        screen.line(f"next: awes run{at}{one_by_one}")


def check_many(screen: Screen, stages: tuple[Stage, ...], plans: Any) -> None:
    """The flights of a plan, a line each; all complaints together."""
    from awescli.stages.base import Inputs
    from awescli.stages.checking import raise_all, refused

    errors: list[BadInput] = []
    answers = {}
    for name, plan in plans.by_flight.items():
        inputs = Inputs(plan.flight, plan.kite, plan.split)
        mistakes = list({str(e): e for s in stages if s.name in plan.planned for e in refused(s, inputs, plan)}.values())
        errors += [e if str(plan.flight) in str(e) else BadInput(f"flight {name}: {e.what}", e.where, e.do) for e in mistakes]
        try:
            log, failed = inputs.log, [c.name for c in inputs.quality.checks if not c.ok]
        except BadInput:
            screen.line(f"{name}: cannot be read")
            answers[name] = {"refused": [str(e) for e in mistakes]}
            continue
        seen = "refused" if mistakes else f"look at {', '.join(failed)}" if failed else "good"
        screen.line(f"{name}: {len(log)} samples in {len(log) * log.dt:.1f} s at {1 / log.dt:.4g} Hz: {seen}")
        answers[name] = {"quality": inputs.quality.as_dict(), "refused": [str(e) for e in mistakes]}
    screen.answer(json_safe({"plan": str(plans.file), "flights": answers}))
    raise_all(errors)
    at = "" if str(plans.file) == "stages.yaml" else f" --stages {plans.file}"
    first = next(iter(plans.by_flight))
    screen.line(f"next: awes run{at}; one flight in full: awes check{at} --flight {first}")


def quality_sections(quality: Any) -> dict[str, Any]:
    """A DataQuality (flightlog/quality.py) as title -> table, list or sentence."""
    from awescli.flightlog.split import PARTS

    sections: dict[str, Any] = {
        "signals": {
            c.name: {"unit": c.unit, "low": c.low, "high": c.high, "noise": "" if c.noise is None else c.noise, "clock": c.group}
            for c in quality.channels
        },
        "checks": {
            c.name: {"value": c.value, "limit": c.threshold, "unit": c.unit, "": how_good(c), "means": c.sentence} for c in quality.checks
        },
        "ranges of the parts": {
            r.name: {"unit": r.unit, **{p: between(getattr(r, p)) for p in PARTS}, "test goes": f"{r.test_reach:.2f} x"}
            for r in quality.ranges
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


def how_good(check: Any) -> str:
    """A check in a word or two."""
    return "good" if check.ok else "STOPS" if check.stops else "NOT GOOD"


def kinematics_sections(path: Any, declared: Mapping[str, float]) -> dict[str, Any]:
    """A FlightPath (flightlog/reconstruction) as title -> table or list. declared: white noise of the kite file [SI], by channel."""
    from awescli.flightlog.reconstruction.tables import error_table, noise_table, said

    sections: dict[str, Any] = {}
    if path.noise:
        sections["noise, by kinematics"] = noise_table(path, declared)
    if path.errors:
        sections["sensor errors, by kinematics"] = error_table(path)
    found = [said(e) for e in path.findings]
    sections["kinematics alone"] = [*(found or ["no error of a sensor that matters"]), *path.notes]
    return sections


def between(ends: tuple[float, float]) -> str:
    """A range in a cell."""
    return "{:.4g} to {:.4g}".format(*(round(end, 1) for end in ends))


def effects(screen: Screen) -> None:
    """The library: every effect, where it acts, its parameters with units and plausible ranges, and where these come from."""
    from awescli.physics.library import library

    rows = library()
    for e in rows:
        where = f"on {', '.join(e['targets'])}" if e["targets"] else f"acts on {e['place']}"
        screen.paragraph(f"{e['name']} ({where}; {e['role']}): {e['doc']}")
        if e["parameters"]:
            screen.table({p["name"]: _parameter(p) for p in e["parameters"]})
    screen.line("In a kite file: effects: [..., actuator_lag:rudder, tether], parameters actuator_lag:rudder.tau: {value: 0.1, unit: s}.")
    screen.answer({"effects": json_safe(rows)})


def _parameter(p: dict[str, Any]) -> dict[str, Any]:
    """One row of the library's table."""
    ends = " .. ".join(f"{p[end]:g}" if p[end] is not None else "" for end in ("lower", "upper"))
    return {"unit": p["unit"], "range": ends, "null": p["null"], "source": p["source"]}


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
    sides = {"verdicts": found.verdicts, "effects": found.effects}
    tables = {title: {n: {"a": x, "b": y} for n, (x, y) in of.items()} for title, of in sides.items()}
    for title, rows in (tables | {"mean error (NRMSE) on the test loops": errors}).items():
        if rows:
            screen.section(title, {name: {k: _or_dash(v) for k, v in row.items()} for name, row in rows.items()})
    both = [d for d in found.differences if not d.one_sided]
    screen.line(f"{len(both)} values differ, {found.same} are equal, {len(found.differences) - len(both)} are in one run only")
    # numbers that have a name, then those that only have a place in a list, then words
    shown = sorted((d for d in both if d.number or not d.advice), key=lambda d: (not d.number, d.nameless))
    if shown[:most]:
        screen.section("largest changes", {d.where: {"a": d.a, "b": d.b} for d in shown[:most]})
    if len(shown) > most or len(both) < len(found.differences):
        screen.line("--most shows more of them, --json all")
    screen.answer({"a": str(a), "b": str(b), **json_safe(asdict(found))})


def _or_dash(value: Any) -> Any:
    return "-" if value is None else value


def init(screen: Screen, stages: tuple[Stage, ...], folder: Path, flight: Path, kite: Path | None) -> None:
    """A stages.yaml to start from; for a log of unknown layout a flight.yaml, and without a kite file one to fill in."""
    from awescli.artifacts import write_text
    from awescli.stages.beginning import begin

    made = begin(folder, flight, kite, stages)
    if made.found:
        screen.section("columns found", made.found)
    for title, sentences in made.findings.items():
        screen.section(title, sentences)
    for name, text in made.files.items():
        write_text(folder / name, text)
    screen.line(f"wrote {', '.join(str(folder / name) for name in made.files)}")
    screen.line(f"next: cd {folder}; awes check")


def demo(screen: Screen, folder: Path) -> None:
    """The bundled flight, its kite file and the standard plan, in a folder of the user's."""
    from awescli.artifacts import new_folder
    from awescli.stages.demonstration import demonstration

    files = demonstration()
    new_folder(folder, files)
    screen.line(f"wrote {', '.join(str(folder / name) for name in files)}")
    at = "" if folder.resolve() == Path.cwd() else f"cd {shlex.quote(str(folder))}; "
    screen.line(f"next: {at}awes check; awes run")


def export(screen: Screen, stages: tuple[Stage, ...], source: Path, to: str, out: Path, **which: Any) -> None:
    """A model in the forms of other programs. Everything is printed before the first file is written; with `all`, a form that cannot hold
    the model is named with the reason."""
    from awescli.artifacts import write_content
    from awescli.export import EXPORTERS, exported
    from awescli.notation.errors import did_you_mean
    from awescli.stages.exported import model_to_export

    wanted = list(EXPORTERS) if to == "all" else [name.strip() for name in to.split(",")]
    for name in wanted:
        if name not in EXPORTERS:
            raise BadInput(f"there is no form '{name}'", "--to", did_you_mean(name, [*EXPORTERS, "all"]))
    if out.exists() and not out.is_dir():
        raise BadInput("is a file, a folder is needed", f"--out {out}", "Choose another name.")
    model = model_to_export(source, stages, **which)
    files, refused = {}, {}
    for name in wanted:
        try:
            files[name] = exported(model, name)
        except BadInput as e:
            if to != "all":
                raise
            refused[name] = e
    for name, own in files.items():
        for path, content in own.items():
            write_content(out / name / path, content.encode() if isinstance(content, str) else content)
    surfaces = "by the fitted controller" if model.law else "are inputs"
    screen.line(f"{model.declaration.name}: the {model.label} model, set-points {surfaces}; starts {model.start.origin}")
    for name in files:
        screen.line(f"{out / name}: {EXPORTERS[name].doc}")
    for name, e in refused.items():
        screen.line(f"{out / name}: not written: {e.what}")
    written = {name: [str(out / name / path) for path in own] for name, own in files.items()}
    answers = {"model": model.label, "surfaces": "controller" if model.law else "inputs", "out": str(out), "files": written}
    screen.answer({**answers, "refused": {name: str(e) for name, e in refused.items()}})
