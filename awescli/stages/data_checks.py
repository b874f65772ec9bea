"""Data checks gate the fits: what a log shows of itself and against the declared kite, asked before any stage computes anything."""

from collections.abc import Iterator
from pathlib import Path
from textwrap import shorten
from typing import Any

from awescli.notation.errors import BadInput
from awescli.stages.base import Inputs, Stage
from awescli.stages.plan import Plan

WIDTH = 76
"""Columns of the one line in which a stage's answer names what to look at."""


def quality_of(inputs: Inputs, log: Any, folder: Path) -> Any:
    """The DataQuality of a flight, as far as what is needed for it can be read: the kite file, and loops that can be dealt."""
    from awescli.estimation.as_declared import declared_checks
    from awescli.flightlog.quality import data_quality
    from awescli.physics.kite import needed_by

    needed = parts = None
    further = []
    try:
        needed = needed_by(inputs.declared)
        parts = inputs.parts if folder == inputs.flight else inputs.parts_of(log, folder)
        further = declared_checks(inputs.declared, log)
    except BadInput:  # a stage says what is wrong
        pass
    return data_quality(log, needed, parts, further)


def stopped(stage: Stage, inputs: Inputs, plan: Plan) -> Iterator[BadInput]:
    """What of the flights of a stage lies beyond a stop limit, but for what the plan ignores. Flights that cannot be read are the stage's
    to refuse."""
    for folder, quality in _qualities(stage, inputs, plan):
        for check in quality.stopping:
            if check.name not in plan.ignore:
                value, limit = f"{check.value:.4g} {check.unit}".strip(), f"{check.stop:.4g}"
                what = f"data check '{check.name}' is {value}, limit {limit}: nothing fitted would mean anything. {check.sentence}"
                yield BadInput(what, str(folder), f"{check.do} To go on all the same: `ignore: [{check.name}]` in {plan.file}.")


def _qualities(stage: Stage, inputs: Inputs, plan: Plan) -> Iterator[tuple[Path, Any]]:
    """(folder, DataQuality) of the plan's flight and of the stage's further ones, those that can be read."""
    from awescli.flightlog.read import read_flight

    if quality := _of_plan(inputs):
        yield inputs.flight, quality
    for folder in stage.flights(plan.settings[stage.name]):
        try:
            yield folder, quality_of(inputs, read_flight(folder), folder)
        except BadInput:
            continue


def _of_plan(inputs: Inputs) -> Any:
    """The DataQuality of the plan's flight; None where it cannot be read."""
    try:
        return inputs.quality
    except BadInput:
        return None


def warning(inputs: Inputs, plan: Plan) -> str:
    """One line that names the checks of the plan's flight that are not good, ignored ones first; empty where all are."""
    quality = _of_plan(inputs)
    failed = sorted((c for c in quality.checks if not c.ok), key=lambda c: not c.stops) if quality else []
    names = [f"{c.name} (ignored)" if c.stops and c.name in plan.ignore else c.name for c in failed]
    return shorten(f"data, not good: {', '.join(names)}", WIDTH, placeholder=" ...") if names else ""
