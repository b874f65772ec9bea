"""The nested models of a run: initial, identified, with_effects, hybrid; each adds what one more stage found."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from awescli.stages.base import KITE_FILE, Context, Task

if TYPE_CHECKING:
    from awescli.estimation.known import Known
    from awescli.estimation.prediction import Prediction
    from awescli.flightlog.log import FlightLog
    from awescli.flightlog.split import Split
    from awescli.physics.flight_model import FlightModel
    from awescli.physics.kite import Kite
    from awescli.simulation.rollout import Simulator
    from awescli.stages.evaluate import EvaluateConfig

MADE_BY = {"identified": "identify", "with_effects": "trace-residual", "hybrid": "train-hybrid"}
"""Model -> the stage that hands it on; `initial` is what the user declared."""


def nested_models(context: Context, log: "FlightLog", closed: bool = False) -> dict:
    """name -> Simulator of every model that exists, in the order in which they were made; closed: the fitted law moves the surfaces."""
    return {name: model_of(name, file, log, context if closed else None) for name, file in kite_files(context).items()}


def model_of(name: str, file: Path, log: "FlightLog", context: Context | None = None) -> "Simulator":
    """The Simulator of one model in the wind of a flight: of its kite file, and of the network beside it; context: of the run whose fitted
    law moves the surfaces."""
    from awescli.estimation.problem import simulator_of
    from awescli.learning.correction import hybrid_from_artifact
    from awescli.physics.declaration import read_kite
    from awescli.stages.flight_parts import closed_loop

    kite, law = closed_loop(context, read_kite(file), log) if context is not None else (read_kite(file), None)
    return hybrid_from_artifact(*network(file.parent), kite, log, law) if name == "hybrid" else simulator_of(kite, log, law=law)


def kite_files(context: Context) -> dict[str, Path]:
    """name -> kite file of every model that exists, in the order in which they were made."""
    made = {name: context.upstream(stage) for name, stage in MADE_BY.items()}
    return {"initial": context.kite} | {name: folder / KITE_FILE for name, folder in made.items() if folder}


def network(folder: Path) -> tuple[dict, dict]:
    """What train-hybrid left in its folder: (description, weights)."""
    from awescli.artifacts import read_json, read_tensors

    return read_json(folder / "network.json"), read_tensors(folder / "network.safetensors")


def score_models(
    models: dict, context: Context, log: "FlightLog", parts: "Split", config: "EvaluateConfig", task: Task
) -> tuple[dict, dict]:
    """(metrics.json, arrays of predictions.npz): every model predicted alike on train, validation and test."""
    from awescli.estimation.filter_levels import with_levels
    from awescli.estimation.prediction_bands import NO_BANDS, bands
    from awescli.estimation.prediction_scores import scored
    from awescli.estimation.record_level import with_record_level
    from awescli.flightlog.loops import find_loops

    loops = find_loops(log).bounds
    metrics: dict = {
        "horizon_s": config.horizon,
        "split": {p: [list(r) for r in getattr(parts, p)] for p in ("train", "validation", "test")},
    }
    arrays: dict = {}
    for name, simulator in models.items():
        task.update(name)
        if name != "hybrid":  # a network is on top of the physics whose parameters were fitted
            known = all_known_of(context, name, simulator.kite, log)
            levelled = name in MADE_BY and not config.known_starts
            known = with_record_level(simulator, log, parts, config.horizon, known) if levelled else known
            filtered = with_levels(simulator, log, parts, config.horizon, known) if config.initial_states == "filtered" else None
            known = filtered or known
            told_by = simulator, known
        ahead = config.horizon, config.horizons, config.known_starts
        block, predictions = scored(simulator, log, parts, loops, *ahead, told_by, filtered)
        block["bands"] = NO_BANDS["network" if name == "hybrid" else "measured_starts"]
        if name != "hybrid" and not config.known_starts:
            banded = bands(simulator, log, predictions["test"], known, filters=filtered is not None)
            block["bands"] = banded.coverage(predictions["test"])
            for which, edge in (("low", 0), ("high", 1)):
                arrays |= {f"{which}_{name}_{n}": banded.edges(n)[edge] for n in banded.centre}
        enter(name, block, predictions, context, log, metrics, arrays)
        metrics["noise_floor"] = predictions["test"].noise_floor()
        task.advance()
    return metrics, arrays


def enter(name: str, block: dict, predictions: dict, context: Context, log: "FlightLog", metrics: dict, arrays: dict) -> None:
    """A scored model into metrics.json and predictions.npz."""
    for part, prediction in predictions.items():
        block["nrmse"][part] |= surface_errors(context, log, prediction)
    metrics[name], test = block, predictions["test"]
    arrays["time"], arrays["first"] = test.time, test.first
    for n in test.simulated:
        arrays[f"measured_{n}"] = test.measured[n]
        arrays[f"{name}_{n}"] = test.measured[n] - test.errors(n)


def known_of(context: Context, name: str, kite: "FlightModel") -> "Known":
    """What the fit behind a model says of its parameters; of one that nothing was fitted to, what is declared."""
    from awescli.artifacts import read_json
    from awescli.estimation.known import Known

    folder = context.upstream(MADE_BY[name]) if name in MADE_BY else None
    file = folder / "params.json" if folder else None
    return Known.fitted(read_json(file), kite) if file and file.is_file() else Known.declared(kite)


def all_known_of(context: Context, name: str, kite: "Kite", log: "FlightLog") -> "Known":
    """`known_of` with processes and noise as the fit left them: after a trace that was not testable, identify's; of a model that nothing
    was fitted to, what is always there."""
    from awescli.estimation.wind_seen import processes_at

    left = [levels_of(context, model) for model in (name, "identified") if name in MADE_BY and model in MADE_BY]
    levels, factors = next(((found, factors) for found, factors in left if found is not None), ({}, {}))
    return replace(known_of(context, name, kite), processes=processes_at(kite.declaration, log, levels), factors=factors)


def levels_of(context: Context, model: str) -> tuple[dict | None, dict]:
    """(processes, noise factors) of the fit behind a model, as its stage left them; None for a fit that left none, or that the tracer did
    not take for one."""
    from awescli.artifacts import read_json

    folder = context.upstream(MADE_BY[model])
    for name in ("effects.json", "metrics.json"):
        found = read_json(folder / name) if folder and (folder / name).is_file() else {}
        if found.get("verdict") == "not_testable" and not found.get("by_prediction"):
            return None, {}
        if "processes" in found:
            return found["processes"], found.get("noise_factors", {})
    return None, {}


def surface_errors(context: Context, log: "FlightLog", prediction: "Prediction") -> dict:
    """NRMSE of each driven surface: what the fitted law commands at the predicted states, against what was flown."""
    import numpy as np

    from awescli.control.law import deflections_of_states
    from awescli.notation.quantities import STATES
    from awescli.simulation import scores
    from awescli.stages.controller_artifact import read_controller, wind_direction

    folder = context.upstream("fit-controller")
    if folder is None:
        return {}
    law = read_controller(folder)
    rows = prediction.first[:, None] + np.arange(len(prediction.time))[None]
    z: dict[str, Any] = {n: prediction.simulated[n].reshape(-1) for n in STATES}
    z |= {n: log.inputs[n][rows].reshape(-1) for n in ("tether_length", "reel_out_speed") if n in log.inputs}
    z["wind_direction"] = wind_direction(log)
    commanded = deflections_of_states(law, z)
    flown = {s: log.inputs[s][rows] for s in law.surfaces}
    return {s: scores.nrmse(commanded[s].reshape(rows.shape) - flown[s], scores.span(flown[s])) for s in law.surfaces}
