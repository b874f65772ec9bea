"""What every stage asks of a flight first: the log, and its loops dealt to train, validation and test."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from awescli.notation.errors import BadInput
from awescli.notation.names import nearest_quantity
from awescli.notation.quantities import SURFACES
from awescli.stages.base import Context, Inputs

if TYPE_CHECKING:
    from awescli.estimation.prediction import Prediction
    from awescli.flightlog.log import FlightLog
    from awescli.flightlog.split import Split
    from awescli.physics.declaration import KiteDeclaration
    from awescli.simulation.rollout import Simulator


def flight_parts(context: Context, flight: Path | None = None) -> "tuple[FlightLog, Split]":
    """(FlightLog, Split) of the plan's flight, or of another folder. Raises BadInput where a model would lack signals."""
    inputs = context.inputs
    if flight is None or flight == inputs.flight:
        return inputs.log, inputs.parts
    from awescli.flightlog.read import read_flight

    log = read_flight(flight)
    return log, inputs.parts_of(log, flight)


def unknown_channels(
    log: "FlightLog", wanted: Sequence[str] | None, key: str = "outputs", closed: bool = False
) -> Iterator[tuple[str, BadInput]]:
    """(key, mistake) of every wanted channel that the flight does not measure; closed: set-points count, a law predicts them."""
    for name in wanted or ():
        if name in SURFACES and name in log.inputs:
            if not closed:
                what = f"'{name}' is a set-point that is replayed: no model predicts it"
                yield key, BadInput(what, do="Close the loop (surfaces: controller), or leave it out.")
        elif name not in log.measured:
            yield key, BadInput(f"the flight has no measured channel '{name}'", do=nearest_quantity(name, log.measured))


def too_long(inputs: Inputs, horizon: float, parts: tuple[str, ...], key: str = "horizon") -> Iterator[tuple[str, BadInput]]:
    """(key, mistake) where no stretch of `horizon` seconds, and the warm-up before, fits into the loops of a part."""
    from awescli.flightlog.split import prediction_starts

    for part in parts:
        if not len(prediction_starts(inputs.log, getattr(inputs.parts, part), horizon)):
            where = f"the {part} loops of flight '{inputs.log.name}'"
            what = f"no {horizon:g} s in a row fit into {where}, with the second before that tells where they begin"
            yield key, BadInput(what, do="Use a shorter one, or a longer flight; `awes check` lists what was left out and why.")


def closed_loop(
    context: Context, declaration: "KiteDeclaration", log: "FlightLog", closed: bool = True
) -> "tuple[KiteDeclaration, Callable | None]":
    """(kite, law) to simulate with: as `driven_upstream` where the loop is closed, else the kite as it is and no law."""
    return driven_upstream(context, declaration, log) if closed else (declaration, None)


def driven_upstream(context: Context, declaration: "KiteDeclaration", log: "FlightLog") -> "tuple[KiteDeclaration, Callable]":
    """(the kite as the fitted controller drives it, delay and rate limit of its set-points included; the controller as the law of a
    simulator of that kite). Raises BadInput where there is no controller."""
    from awescli.physics.kite import Kite

    driven, closes = closing_upstream(context, declaration, log)
    return driven, closes(Kite(driven, log.recorded_wind.height))


def closing_upstream(context: Context, declaration: "KiteDeclaration", log: "FlightLog") -> "tuple[KiteDeclaration, Callable]":
    """`driven_upstream` for whoever adds effects to the kite: (kite, function of a Kite that makes the law of its simulator)."""
    folder = context.upstream("fit-controller")
    if folder is None:
        do = "Run awes fit-controller first, or set surfaces: recorded."
        raise BadInput("there is no fitted controller to close the loop with", do=do)
    from awescli.simulation.closed_loop import loop, with_setpoint_dynamics
    from awescli.stages.controller_artifact import read_controller, wind_direction

    fitted = read_controller(folder)
    direction = wind_direction(log)
    return with_setpoint_dynamics(declaration, fitted), lambda kite: loop(fitted, kite, direction)


def predicted(simulator: "Simulator", log: "FlightLog", parts: "Split", horizon: float, known_starts: bool = False) -> dict:
    """Part -> the one prediction of a model on it, from which all its numbers and pictures are made."""
    from awescli.estimation.prediction import predict

    part_of = {part: getattr(parts, part) for part in ("train", "validation", "test")}
    return {part: predict(simulator, log, ranges, horizon, known_starts=known_starts) for part, ranges in part_of.items()}


def scores_of(predictions: "Mapping[str, Prediction]", horizon: float) -> dict:
    """metrics.json's `nrmse` of one model: split -> channel -> NRMSE, and how many predictions diverged."""
    return {
        "horizon_s": horizon, "nrmse": {part: p.nrmse() for part, p in predictions.items()},
        "diverged_predictions": {part: p.diverged for part, p in predictions.items()}, "noise_floor": predictions["test"].noise_floor(),
    }  # fmt: skip


def score_parts(simulator: "Simulator", log: "FlightLog", parts: "Split", horizon: float, known_starts: bool = False) -> dict:
    """`scores_of` a model's predictions."""
    return scores_of(predicted(simulator, log, parts, horizon, known_starts), horizon)
