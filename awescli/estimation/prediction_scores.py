"""All scores of a model on a flight: per part, channel, horizon and loop, from one step to many seconds, and how often it diverges."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from awescli.estimation.known import Known
from awescli.estimation.mechanical_power import mechanical_power
from awescli.estimation.phase_power import flown_ranges, phase_power
from awescli.estimation.power_interval import Pieces, Seen, energy_sensitivities, power_interval
from awescli.estimation.prediction import Prediction, predict
from awescli.flightlog.log import FlightLog
from awescli.flightlog.phases import phases
from awescli.flightlog.split import PARTS, Split, prediction_starts
from awescli.notation.quantities import STATES
from awescli.physics.flight_model import FlightModel
from awescli.simulation import scores
from awescli.simulation.rollout import Simulator

ONE_STEP_EVERY = 0.25
"""[s] between one-step predictions: each has a start of its own to estimate, and neighbours say the same."""

Forecast = Callable[..., Prediction]
"""(ranges, horizon, every=None) -> Prediction, as `predict` for one model and one log."""


def scored(
    simulator: Simulator, log: FlightLog, parts: Split, loops: np.ndarray, horizon: float, horizons: Sequence[float],
    known_starts: bool = False, told_by: tuple[Simulator, Known] | None = None, filtered: Known | None = None,
) -> tuple[dict, dict[str, Prediction]]:  # fmt: skip
    """(scores of one model, part -> its prediction).

    loops: (K, 2) half-open sample ranges; horizon: seconds predicted ahead in all scores but by_horizon, one_step;
    known_starts: as in `predict`; told_by: who says how well its power is known (a physical model), default the model as it was declared;
    filtered: predictions begin where a filter with what is known of it leaves the model.
    """

    def forecast(ranges, horizon: float, every: float | None = None) -> Prediction:
        return predict(simulator, log, ranges, horizon, every=every, known_starts=known_starts, known=filtered)

    block, predictions = scores_of(forecast, log, parts, loops, horizon, horizons)
    if power := power_of(simulator.kite, predictions["test"], log, loops):
        physical, known = told_by or (simulator, Known.declared(simulator.kite))
        # a filter has found the record's error, as far as a second shows it, for itself
        known = replace(known, found=0.0 * known.found) if filtered else known
        fitted = [predictions[part] for part in PARTS[:2]]
        slopes = [energy_sensitivities(physical, log, p, known.names) for p in fitted]
        told = [power_of(simulator.kite, p, log, loops, J @ known.found) for p, J in zip(fitted, slopes, strict=True)]
        slope = np.sum([J[_inside(p, loops)].sum(axis=0) for p, J in zip(fitted, slopes, strict=True)], axis=0)
        seen = Seen.of(told, loops, log.dt, slope)
        block["power"] = power | _power_known(forecast, log, parts, loops, predictions["test"], power, horizon, seen, physical, known)
    return block, predictions


def scores_of(
    forecast: Forecast, log: FlightLog, parts: Split, loops: np.ndarray, horizon: float, horizons: Sequence[float]
) -> tuple[dict, dict[str, Prediction]]:
    """(scores, part -> prediction) of whatever predicts from `prediction_starts`; the rest as in `scored`."""
    predictions = {part: forecast(getattr(parts, part), horizon) for part in PARTS}
    test = predictions["test"]
    return {
        "horizon_s": horizon,
        "outcome": f"{test.diverged} of {len(test.first)} predictions diverged" if test.diverged else "scored",
        "nrmse": {part: p.nrmse() for part, p in predictions.items()},
        "predictions": {part: len(p.first) for part, p in predictions.items()},
        "diverged_predictions": {part: p.diverged for part, p in predictions.items()},
        "divergence_rate": {part: p.diverged / len(p.first) for part, p in predictions.items()},
        **{name: of_channels(test, name) for name in RELATIVES},
        "by_horizon": {f"{h:g}": at for h in horizons if (at := ahead(forecast, log, parts.test, h))},
        "one_step": ahead(forecast, log, parts.test, log.dt, every=ONE_STEP_EVERY),
        "by_loop": [row for part, p in predictions.items() for row in by_loop(p, log, loops, part)],
    }, predictions


def _power_known(
    forecast: Forecast, log: FlightLog, parts: Split, loops: np.ndarray, test: Prediction, power: dict, horizon: float,
    seen: Seen | None, physical: Simulator, known: Known,
) -> dict:  # fmt: skip
    """The interval of the test loops' mean power, and power per phase and cycle with theirs."""
    J = energy_sensitivities(physical, log, test, known.names)[_inside(test, loops)].sum(axis=0) / power["seconds"]
    tested, alike = Pieces.of(power["by_loop"], loops, log.dt), seen is not None and seen.like(power["by_loop"])
    summed = power_interval(power["mean_W"], tested, J, known, seen, alike)
    labels = phases(log)
    ranges = flown_ranges(labels, log.valid)
    if not len(prediction_starts(log, ranges, horizon)):
        return summed
    flown = forecast(ranges, horizon)
    fitted, sensitivities = (*parts.train, *parts.validation), energy_sensitivities(physical, log, flown, known.names)
    return summed | phase_power(flown, log["reel_out_speed"], labels, fitted, sensitivities, known, seen)


def _inside(prediction: Prediction, loops: np.ndarray) -> np.ndarray:
    """(K, N) which steps lie in a loop."""
    rows = prediction.first[:, None] + np.arange(len(prediction.time) - 1)[None]
    return np.any([(rows >= first) & (rows < last) for first, last in loops], axis=0)


def power_of(
    kite: FlightModel, prediction: Prediction, log: FlightLog, loops: np.ndarray, believed: np.ndarray | float = 0.0
) -> dict | None:
    """`mechanical_power` of a tethered flight; None without a line or a load cell, or where the model is given the measured tension."""
    tethered = any(e.name == "tether" for e in kite.effects) and kite.declaration.tether.tension == "constraint"
    if not tethered or "tension" not in prediction.simulated or "reel_out_speed" not in log:
        return None
    return mechanical_power(prediction, log["reel_out_speed"], loops, believed)


RELATIVES = {
    "rmse": lambda e, measured: scores.rmse(e),
    "r2": scores.r_squared,
    "theil": lambda e, measured: scores.theil(e, measured, measured - e),
}
"""Scores beside the NRMSE: name -> function of (error, measured)."""


def of_channels(prediction: Prediction, name: str) -> dict[str, float]:
    """Channel -> one of RELATIVES."""
    return {n: RELATIVES[name](prediction.errors(n), prediction.measured[n]) for n in prediction.simulated}


def ahead(forecast: Forecast, log: FlightLog, ranges: Sequence[tuple[int, int]], horizon: float, every: float | None = None) -> dict | None:
    """NRMSE, RMSE and divergence of predictions `horizon` seconds ahead; None where no range is long enough."""
    if not len(prediction_starts(log, ranges, horizon, every=every)):
        return None
    p = forecast(ranges, horizon, every)
    counts = {"horizon_s": horizon, "predictions": len(p.first), "diverged_predictions": p.diverged}
    return counts | {"nrmse": p.nrmse(), "rmse": of_channels(p, "rmse")}


def by_loop(prediction: Prediction, log: FlightLog, loops: np.ndarray, part: str) -> list[dict]:
    """NRMSE per channel of what was predicted of each loop; loops that no prediction reaches are left out."""
    rows = prediction.first[:, None] + np.arange(len(prediction.time))[None]
    errors = {n: prediction.errors(n) for n in prediction.simulated}
    found = []
    for number, (first, last) in enumerate(loops):
        inside = (rows >= first) & (rows < last)
        if not inside.any():
            continue
        nrmse = {n: scores.nrmse(e[inside], prediction.spans[n]) for n, e in errors.items()}
        nrmse["mean"] = float(np.mean([nrmse[n] for n in STATES]))
        place = {"loop": number + 1, "part": part, "from_s": float(log.time[first]), "to_s": float(log.time[last - 1])}
        found.append(place | {"nrmse": nrmse})
    return found
