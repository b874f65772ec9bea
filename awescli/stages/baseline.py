"""The linear baseline beside the nested models, fitted anew for every evaluation: it takes seconds and belongs to no stage before it."""

from typing import TYPE_CHECKING

from awescli.stages.base import Context, Task

if TYPE_CHECKING:
    from awescli.flightlog.log import FlightLog
    from awescli.flightlog.split import Split
    from awescli.stages.evaluate import EvaluateConfig


def score_baseline(
    metrics: dict, arrays: dict, context: Context, log: "FlightLog", parts: "Split", config: "EvaluateConfig", closed: bool, task: Task
) -> None:
    """Put the block `linear`, its predictions, and `baseline` (how it was chosen, and who does not beat it) beside the models that stand in
    `metrics` already."""
    from awescli.estimation.linear_baseline import linear_baseline
    from awescli.estimation.prediction_bands import NO_BANDS
    from awescli.estimation.prediction_scores import scores_of
    from awescli.flightlog.loops import find_loops
    from awescli.physics.declaration import read_kite
    from awescli.physics.kite import Kite
    from awescli.stages.nested_models import MADE_BY, enter

    task.update("linear")
    kite = Kite(read_kite(context.kite), log.recorded_wind.height)
    found = linear_baseline(log, parts, kite, config.horizon, closed)
    task.advance()
    if found is None:
        metrics["baseline"] = {"outcome": "too_short"}
        return

    def forecast(ranges, horizon: float, every: float | None = None):
        return found.predict(log, kite.declaration.noise, ranges, horizon, every)

    block, predictions = scores_of(forecast, log, parts, find_loops(log).bounds, config.horizon, config.horizons)
    block["bands"] = NO_BANDS["regression"]
    enter("linear", block, predictions, context, log, metrics, arrays)
    metrics["baseline"] = {
        "outcome": found.outcome, "order": found.model.order, "step_s": found.model.step * log.dt, "ridge": found.ridge,
        "place": found.place, "validation": found.error, "outputs": list(found.signals.outputs), "inputs": list(found.signals.inputs),
        "not_beaten": {model: not_beaten(metrics[model], block) for model in ("initial", *MADE_BY) if model in metrics},
    }  # fmt: skip


def not_beaten(model: dict, linear: dict) -> list[str]:
    """Horizons [s] at which the mean error of a model on test is not below the linear one's, shortest first."""
    own, its = (_by_horizon(block) for block in (model, linear))
    return [h for h in sorted(own, key=float) if own[h] >= its[h]]


def _by_horizon(block: dict) -> dict[str, float]:
    """Seconds ahead -> mean NRMSE on test."""
    return {h: at["nrmse"]["mean"] for h, at in block["by_horizon"].items()} | {f"{block['horizon_s']:g}": block["nrmse"]["test"]["mean"]}
