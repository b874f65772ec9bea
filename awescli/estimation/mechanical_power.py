"""Mechanical power of a tethered flight, tension times reel-out speed, as measured and as predicted: what an operator is paid for."""

import numpy as np

from awescli.estimation.prediction import Prediction
from awescli.simulation import scores

LEAST_COVERED = 0.5
"""Share of a loop that predictions must cover for its energy to be compared with that of other loops."""


def mechanical_power(prediction: Prediction, speed: np.ndarray, loops: np.ndarray, believed: np.ndarray | float = 0.0) -> dict | None:
    """The power block of one model on one part of a flight; None where no prediction reaches a loop.

    speed: (N,) logged reel-out speed [m/s], the same for both: the winch is driven by the log; loops: (L, 2) half-open sample ranges;
    believed: (K, N) [J] what is known to be missing in the predicted energies between samples.

    mean_W, measured_mean_W: over all predicted seconds inside loops (seconds, of loop_seconds that these loops last: predictions begin
    anew every horizon, and what is left at the end of a stretch is not predicted); error_share: mean_W / measured_mean_W - 1, with
    interval_share over loops (95 %, see `scores.share_interval`); energy_per_loop_J: NRMSE over the range of the measured energies (None
    for loops that are all alike) and RMSE over their mean (relative_rmse), of loops that predictions cover by LEAST_COVERED, each scaled
    to the whole loop; by_loop: the seconds covered of each, the line that moved through the winch, and
    its energies in them. A diverged prediction goes on with its last error,
    as in all other scores.
    """
    dt = float(prediction.time[1])
    rows = prediction.first[:, None] + np.arange(len(prediction.time))[None]
    measured = prediction.measured["tension"]
    energies = [_trapezoids(T * speed[rows], dt) for T in (measured, measured - prediction.errors("tension"))]
    energies[1] = energies[1] + believed
    of = np.searchsorted(loops[:, 0], rows[:, :-1], side="right") - 1
    inside = (of >= 0) & (rows[:, :-1] < loops[np.maximum(of, 0), 1])
    numbers = np.unique(of[inside])
    if not len(numbers):
        return None
    E, predicted = (np.array([energy[inside & (of == k)].sum() for k in numbers]) for energy in energies)
    seconds = np.array([(inside & (of == k)).sum() * dt for k in numbers])
    moved = _trapezoids(np.abs(speed[rows]), dt)
    reeled = np.array([moved[inside & (of == k)].sum() for k in numbers])
    lasting = (loops[numbers, 1] - loops[numbers, 0]) * dt
    compared = seconds >= LEAST_COVERED * lasting
    whole = (lasting / seconds)[compared]
    total = float(seconds.sum())
    interval = scores.share_interval(E, predicted)
    return {
        "mean_W": float(predicted.sum()) / total, "measured_mean_W": float(E.sum()) / total,
        "error_share": float(predicted.sum() / E.sum() - 1) if E.sum() else None,
        "interval_share": None if interval is None else list(interval),
        "seconds": total, "loop_seconds": float(lasting.sum()), "loops": len(numbers),
        "energy_per_loop_J": {**_energy_errors(whole * E[compared], whole * predicted[compared]), "loops": int(compared.sum())},
        "by_loop": [
            {"loop": int(k) + 1, "seconds": float(covered), "of_seconds": float(whole), "reeled_m": float(m), "measured_J": float(a),
             "predicted_J": float(b)}
            for k, covered, whole, m, a, b in zip(numbers, seconds, lasting, reeled, E, predicted, strict=True)
        ],
    }  # fmt: skip


def _trapezoids(power: np.ndarray, dt: float) -> np.ndarray:
    """(K, N) energy [J] between the samples of power (K, N+1) [W]."""
    return dt / 2 * (power[:, :-1] + power[:, 1:])


def _energy_errors(measured: np.ndarray, predicted: np.ndarray) -> dict:
    """nrmse and relative_rmse of energies per loop (K,); None where there is nothing to divide by."""
    if not len(measured):
        return {"nrmse": None, "relative_rmse": None}
    rmse, width, mean = scores.rmse(predicted - measured), float(np.ptp(measured)), abs(float(measured.mean()))
    return {"nrmse": rmse / width if width > 1e-9 * mean else None, "relative_rmse": rmse / mean if mean else None}
