"""A model as JSON: every state, input, output and parameter with unit and value, its source, and its interval where one is known."""

import json
from collections.abc import Mapping
from typing import Any

from awescli.control.laws import to_artifact
from awescli.export.model import ExportedModel
from awescli.export.words import Signal

FORMAT = "awes model 1"


def json_files(model: ExportedModel) -> dict[str, str]:
    """`NAME.json`."""
    return {f"{model.identifier}.json": json.dumps(tables(model), indent=1, allow_nan=False) + "\n"}


def tables(model: ExportedModel) -> dict[str, Any]:
    """The whole model but its equations, as plain values."""
    declaration = model.declaration
    kite = declaration.model_dump(mode="json", exclude={"parameters", "name", "description"})
    return {
        "format": FORMAT,
        "name": declaration.name,
        "identifier": model.identifier,
        "description": declaration.description,
        "model": model.label,
        "provenance": dict(model.provenance),
        "conventions": "SI units and radians; NED axes from the winch, FRD body axes; x = states, then the set-points that are held",
        "sample_interval_s": model.dt,
        "longest_step_s": model.longest,
        "states": [_signal(s) for s in model.states],
        "set_points": [_signal(s) for s in model.set_points],
        "inputs": [_signal(s) for s in model.inputs],
        "outputs": [_signal(s) for s in model.outputs],
        "parameters": [_parameter(model, s) for s in model.parameters],
        "start": model.start.origin,
        "flown_range": {name: list(ends) for name, ends in model.ranges.items()},
        "effects": [
            {"key": e.key, "doc": e.doc, "place": e.place, "parameters": [p.name for p in e.rows()], "states": e.state_names()}
            for e in model.kite.effects
        ],
        "wind_heights_m": list(model.kite.heights),
        "kite": kite,
        "controller": _controller(model),
        "network": _network(model),
    }


def _signal(s: Signal) -> dict[str, Any]:
    return {"name": s.name, "unit": s.unit, "words": s.words} | ({} if s.value is None else {"start": s.value})


def _parameter(model: ExportedModel, s: Signal) -> dict[str, Any]:
    """A value with its unit, its source, what a flight says of it, and what was declared of it."""
    row = model.kite.parameters[s.name]
    bounds = [None if abs(end) == float("inf") else end for end in (row.lower, row.upper)]
    spread = {"std": s.std, "interval_95": None if s.interval is None else list(s.interval)}
    return {"name": s.name, "value": s.value, "unit": s.unit, "source": s.source, **spread, "bounds": bounds, "free": row.free}


def _controller(model: ExportedModel) -> Mapping[str, Any] | None:
    if model.controller is None:
        return None
    document, arrays = to_artifact(model.controller)
    return {k: v for k, v in document.items() if k != "metrics"} | {name: a.tolist() for name, a in arrays.items()}


def _network(model: ExportedModel) -> Mapping[str, Any] | None:
    if model.correction is None:
        return None
    return model.correction.description() | {name: a.tolist() for name, a in model.correction.to_arrays().items()}
