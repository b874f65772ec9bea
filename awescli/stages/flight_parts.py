"""What every stage asks of a flight first: the log, and its loops dealt to train, validation and test."""

from pathlib import Path

from awescli.stages.base import Context, StageConfig


def flight_parts(context: Context, flight: Path | None = None):
    """(FlightLog, Split) of the plan's flight, or of another folder. Raises BadInput where a model would lack signals."""
    from awescli.flightlog.loops import find_loops
    from awescli.flightlog.read import missing_for_model, read_flight
    from awescli.flightlog.split import split
    from awescli.notation.errors import BadInput

    folder = flight or context.flight
    log = read_flight(folder)
    if missing := missing_for_model(log):
        raise BadInput(
            f"flight '{log.name}' lacks what a model needs: {'; '.join(missing)}", str(folder), "See `awes check` for what it has."
        )
    return log, split(find_loops(log), **context.split.model_dump())


def known_channels(log, wanted, where: str) -> tuple[str, ...]:
    """The channels that are wanted. Raises BadInput for one that the flight does not measure."""
    from awescli.notation.errors import BadInput, did_you_mean

    for name in wanted:
        if name not in log.measured:
            raise BadInput(f"the flight has no measured channel '{name}'", where, did_you_mean(name, log.measured))
    return tuple(wanted)


def driven_upstream(context: Context, declaration, log):
    """(the kite as the fitted controller drives it, delay and rate limit of its set-points included; the controller as the law of a
    simulator of that kite). Raises BadInput where there is no controller."""
    from awescli.physics.kite import Kite
    from awescli.simulation.closed_loop import loop, with_setpoint_dynamics
    from awescli.stages.controller_artifact import read_controller, wind_direction

    fitted = read_controller(context.upstream("fit-controller"))
    driven = with_setpoint_dynamics(declaration, fitted)
    heights = log.wind.height if log.wind is not None else (10.0,)
    return driven, loop(fitted, Kite(driven, heights), wind_direction(log))


def score_parts(simulator, log, parts, horizon: float) -> dict:
    """metrics.json's `nrmse` of one model: split -> channel -> NRMSE, and how many predictions diverged."""
    from awescli.estimation.prediction import predict

    nrmse, diverged = {}, {}
    for part in ("train", "validation", "test"):
        prediction = predict(simulator, log, getattr(parts, part), horizon)
        nrmse[part] = prediction.nrmse()
        diverged[part] = prediction.diverged
    return {"horizon_s": horizon, "nrmse": nrmse, "diverged_predictions": diverged}


__all__ = ["StageConfig", "driven_upstream", "flight_parts", "known_channels", "score_parts"]
