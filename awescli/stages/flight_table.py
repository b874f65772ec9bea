"""One row for each flight of a plan: its verdict, the effects with sizes and intervals, errors and power, as its run left them."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from awescli.artifacts import read_json
from awescli.notation.errors import AwesError, BadInput
from awescli.stages.answers import named, number
from awescli.stages.plan import Plan
from awescli.stages.runner import Result

TRACE, EVALUATE = "trace-residual", "evaluate"
MODELS = ("initial", "identified", "with_effects", "hybrid")
"""The models of evaluate's metrics.json, the newest last."""
STATUS = {0: "done", 1: "fault", 2: "refused", 3: "no answer"}
"""Exit code of the flight's own run -> how it ended."""


def row(
    plan: Plan, results: Mapping[str, Result], error: AwesError | None = None, seconds: float = 0.0, status: str = "", reason: str = ""
) -> dict[str, Any]:
    """The row of one flight. results: of the stages whose artifacts stand, so that nothing of an earlier plan is reported; error: what
    ended the run; status: where no error says it.

    Sizes have 95 % intervals (`low`, `high`), in their unit. `error`: mean NRMSE on test loops, of the declared kite's fit and of the
    traced model, and of noise alone; without a trace of the first and of the last model. `power`: share of the measured mean power by which
    the last model errs, with its interval over loops.
    """
    found: dict[str, Any] = {
        "flight": plan.name, "status": status or STATUS[error.exit_code if error else 0], "reason": str(error) if error else reason,
        "seconds": round(seconds, 3), "stages": {name: result.status for name, result in results.items()},
        "verdict": None, "effects": [], "error": None, "power": None, "report": None, "log": str(plan.flight), "out": str(plan.out),
    }  # fmt: skip
    traced = _read(plan, results, TRACE, "effects.json")
    scores = _read(plan, results, EVALUATE, "metrics.json")
    if traced:
        found |= {"verdict": traced["verdict"], "effects": [_effect(e) for e in traced["effects"]]}
    if traced and traced["error"].get("before"):
        error_of = traced["error"]
        found["error"] = _errors(error_of["horizon_s"], error_of["before"]["mean"], error_of["after"]["mean"], error_of["noise_floor"])
    elif scores:
        *_, last = (name for name in MODELS if name in scores)
        first, last = (scores[name]["nrmse"]["test"]["mean"] for name in (MODELS[0], last))
        found["error"] = _errors(scores["horizon_s"], first, last, scores["noise_floor"])
    if scores:
        powers = [(name, scores[name]["power"]) for name in MODELS if scores.get(name, {}).get("power")]
        if powers:
            name, power = powers[-1]
            found["power"] = {"model": name, "error_share": power["error_share"], "interval_share": power["interval_share"]}
    if EVALUATE in results and (page := plan.out / EVALUATE / "report.html").is_file():
        found["report"] = str(page)
    return found


def as_written(row: Mapping[str, Any], plan: Plan) -> dict[str, Any]:
    """A row whose paths are those of the plan, wherever the flight was run."""
    page = plan.out / EVALUATE / "report.html"
    return {**row, "out": str(plan.out), "report": row["report"] and str(page)}


def _read(plan: Plan, results: Mapping[str, Result], stage: str, file: str) -> dict[str, Any] | None:
    """An artifact of a stage that stands; None where the stage does not, or does not write it in the form that it has today."""
    path: Path = plan.out / stage / file
    if stage not in results or not path.is_file():
        return None
    try:
        found = read_json(path)
    except BadInput:
        return None
    return found if isinstance(found, dict) else None


def _errors(horizon: float, before: float | None, after: float | None, noise: Mapping[str, float]) -> dict[str, float | None]:
    return {"horizon_s": horizon, "before": before, "after": after, "noise": noise["mean"]}


def _effect(effect: Mapping[str, Any]) -> dict[str, Any]:
    """An effect as the table has it."""
    from awescli.estimation.identifiability import interval

    sizes = {}
    for name, size in effect["parameters"].items():
        low, high = interval(size["value"], size["std"]) if size["std"] is not None else (None, None)
        sizes[name] = {"value": size["value"], "low": low, "high": high, "unit": size.get("unit", "-")}
    rivals = [named(r) for r in effect["rivals"]]
    return {"name": effect["name"], "acts_on": effect.get("acts_on", ""), "parameters": sizes, "rivals": rivals}


def effects_said(row: Mapping[str, Any], short: bool = False) -> str:
    """The effects of a row in one cell: `actuator_lag on rudder, tau 0.202 s [0.19, 0.214]`; short: without sizes."""
    said = []
    for e in row["effects"]:
        sizes = [] if short else [_size(name, size) for name, size in e["parameters"].items()]
        said.append(", ".join([named(e), *sizes]))
    return "; ".join(said)


def _size(name: str, size: Mapping[str, Any]) -> str:
    unit = "" if size["unit"] in ("", "-") else f" {size['unit']}"
    between = "" if size["low"] is None else f" [{number(size['low'])}, {number(size['high'])}]"
    return f"{name} {number(size['value'])}{unit}{between}"


COLUMNS = (
    "flight", "status", "verdict", "effects", "horizon_s", "error_before", "error_after", "error_noise", "power_error_share",
    "power_interval_low", "power_interval_high", "reason", "log", "out",
)  # fmt: skip


def as_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """The table as CSV: a line for each flight, numbers in full, effects in one cell."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(_cells(row) for row in rows)
    return text.getvalue()


def _cells(row: Mapping[str, Any]) -> Iterable[Any]:
    error, power = row["error"] or {}, row["power"] or {}
    low, high = power.get("interval_share") or (None, None)
    values = {
        **row, "effects": effects_said(row), "horizon_s": error.get("horizon_s"), "power_error_share": power.get("error_share"),
        "power_interval_low": low, "power_interval_high": high, "reason": " ".join(row["reason"].split()),
        **{f"error_{key}": error.get(key) for key in ("before", "after", "noise")},
    }  # fmt: skip
    return ["" if values[name] is None else values[name] for name in COLUMNS]
