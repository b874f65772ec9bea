"""Power and energy per phase and per cycle of a flight, measured and predicted, over everything flown that predictions reach."""

from collections.abc import Sequence

import numpy as np

from awescli.estimation.known import Known
from awescli.estimation.power_interval import Pieces, Seen, power_interval
from awescli.estimation.prediction import Prediction
from awescli.flightlog.cycles import cycles
from awescli.flightlog.log import runs_of
from awescli.notation.phases import WORKING


def flown_ranges(labels: np.ndarray, valid: np.ndarray, of: Sequence[str] = WORKING) -> tuple[tuple[int, int], ...]:
    """Half-open sample ranges of some phases in which the log may be scored."""
    return tuple((int(a), int(b)) for a, b in runs_of(np.isin(labels, of) & valid))


def phase_power(
    prediction: Prediction, speed: np.ndarray, labels: np.ndarray, fitted: Sequence[tuple[int, int]],
    sensitivities: np.ndarray | None = None, known: Known | None = None, seen: Seen | None = None,
) -> dict[str, list[dict]]:  # fmt: skip
    """by_phase: a row for each phase of what no stage was fitted to or chosen on; by_cycle: a row for each cycle of the flight (`cycles`),
    with the share of it that was not fitted to.

    Each row: seconds predicted, of_seconds that there are, measured_J, predicted_J, measured_mean_W, mean_W, and where sensitivities (K, N,
    n) of the energies are given `power_interval`. speed, labels: (N,) of the log; fitted: sample ranges.
    """
    dt = float(prediction.time[1])
    rows = prediction.first[:, None] + np.arange(len(prediction.time))[None]
    measured = prediction.measured["tension"]
    powers = [T * speed[rows] for T in (measured, measured - prediction.errors("tension"))]
    E, predicted, moved = (dt / 2 * (p[:, :-1] + p[:, 1:]) for p in (*powers, np.abs(speed[rows])))
    used = np.zeros(len(labels), bool)
    for first, last in fitted:
        used[first:last] = True
    at, working = rows[:, :-1], np.isin(labels, WORKING)

    def rows_of(which: np.ndarray, place: dict) -> list[dict]:
        """The row of the samples (N,) of the log; none where predictions reach none of them."""
        inside = which[at]
        if not inside.any():
            return []
        seconds, sums = float(inside.sum() * dt), [float(energy[inside].sum()) for energy in (E, predicted)]
        row = place | {
            "seconds": seconds, "of_seconds": float((which & working).sum() * dt), "measured_J": sums[0], "predicted_J": sums[1],
            "measured_mean_W": sums[0] / seconds, "mean_W": sums[1] / seconds,
        }  # fmt: skip
        if sensitivities is not None and known is not None:
            J = sensitivities[inside].sum(axis=0) / seconds
            lasting, some = dt * inside.sum(axis=1), inside.any(axis=1)
            pieces = Pieces(dt * at.mean(axis=1)[some], lasting[some], (moved * inside).sum(axis=1)[some])
            row |= power_interval(row["mean_W"], pieces, J, known, seen)
        return [row]

    by_cycle = []
    for number, (first, last) in enumerate(cycles(labels)):
        which = (np.arange(len(labels)) >= first) & (np.arange(len(labels)) < last)
        place = {"cycle": number + 1, "from_s": first * dt, "to_s": last * dt, "unseen_share": float(np.mean(~used[first:last]))}
        by_cycle += rows_of(which, place)
    return {"by_phase": [row for name in WORKING for row in rows_of((labels == name) & ~used, {"phase": name})], "by_cycle": by_cycle}
