"""The ladder of models: initial, identified, with_effects, hybrid; each step adds what the stage before it found."""

from awescli.stages.base import KITE_FILE, Context


def ladder(context: Context, log) -> dict:
    """name -> Simulator of every model that exists, in the order in which they were made."""
    from awescli.estimation.question import simulator_of
    from awescli.physics.declaration import read_kite

    files = {"initial": context.kite}
    for name, stage in (("identified", "identify"), ("with_effects", "trace-residual")):
        if folder := context.upstream(stage):
            files[name] = folder / KITE_FILE
    models = {name: simulator_of(read_kite(path), log) for name, path in files.items()}
    if folder := context.upstream("train-hybrid"):
        models["hybrid"] = hybrid_simulator(folder, read_kite(folder / KITE_FILE), log)
    return models


def hybrid_simulator(folder, declaration, log):
    """The trained network on the kite it was trained with."""
    from awescli.artifacts import read_json, read_tensors
    from awescli.learning.correction import hybrid_from_artifact

    return hybrid_from_artifact(read_json(folder / "network.json"), read_tensors(folder / "network.safetensors"), declaration, log)


def score_ladder(models: dict, context: Context, log, parts, config, task) -> tuple[dict, dict]:
    """(metrics.json, arrays of predictions.npz): every model predicted alike on train, validation and test."""
    from awescli.estimation.prediction import predict
    from awescli.simulation import scores

    metrics: dict = {
        "horizon_s": config.horizon,
        "split": {p: [list(r) for r in getattr(parts, p)] for p in ("train", "validation", "test")},
    }
    arrays: dict = {}
    for name, simulator in models.items():
        task.update(name)
        block: dict = {"horizon_s": config.horizon, "nrmse": {}, "diverged_predictions": {}, "outcome": "scored"}
        for part in ("train", "validation", "test"):
            prediction = predict(simulator, log, getattr(parts, part), config.horizon)
            block["nrmse"][part] = prediction.nrmse() | rudder_error(context, log, prediction)
            block["diverged_predictions"][part] = prediction.diverged
            if part == "test":
                kept = prediction
        if kept.diverged:
            block["outcome"] = f"{kept.diverged} of {len(kept.first)} predictions diverged"
        block["rmse"] = {n: scores.rmse(kept.errors(n)) for n in kept.simulated}
        block["r2"] = {n: scores.r_squared(kept.errors(n), kept.measured[n]) for n in kept.simulated}
        block["theil"] = {n: scores.theil(kept.errors(n), kept.measured[n], kept.measured[n] - kept.errors(n)) for n in kept.simulated}
        block["by_horizon"] = {}
        for horizon in config.horizons:
            try_ranges = [r for r in parts.test if (r[1] - r[0]) * log.dt > horizon]
            if try_ranges:
                at = predict(simulator, log, try_ranges, horizon)
                block["by_horizon"][f"{horizon:g}"] = at.nrmse()["mean"]
        metrics[name] = block
        arrays["time"], arrays["first"] = kept.time, kept.first
        for n in kept.simulated:
            arrays[f"measured_{n}"] = kept.measured[n]
            arrays[f"{name}_{n}"] = kept.measured[n] - kept.errors(n)
        metrics["noise_floor"] = kept.noise_floor()
        task.advance()
    return metrics, arrays


def rudder_error(context: Context, log, prediction) -> dict:
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
    z = {n: prediction.simulated[n].reshape(-1) for n in STATES}
    z |= {n: log.inputs[n][rows].reshape(-1) for n in ("tether_length", "reel_out_speed") if n in log.inputs}
    z["wind_direction"] = wind_direction(log)
    commanded = deflections_of_states(law, z)
    flown = {s: log.inputs[s][rows] for s in law.surfaces}
    return {s: scores.nrmse(commanded[s].reshape(rows.shape) - flown[s], scores.span(flown[s], s)) for s in law.surfaces}
