"""How well predicted power is known: from the covariance of parameters, the error of the wind record, and what loops show of the rest.

    variance = J C J'                          parameters and the record's errors together, as the fit left them
             + (b^2 - s^2 / L) F^2             b: share by which the model, the found error of the record in it, errs on the L loops that
                                               it was fitted and chosen on, if more than chance
             + (s F)^2 / K                     s: scatter of single loops about that share; K: loops' worth of seconds

F is the power that the mean tension of those loops would have at the speed of the line: a phase in which a model says no tension is not
known exactly.

J is the exact sensitivity of tension times reel-out speed, integrated. Noise, gusts and what starts leave are in the scatter: they differ
from loop to loop. The interval is Student's, with the effective degrees of freedom of such a sum (Welch, Biometrika 34, 1947).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from awescli.estimation.known import Known
from awescli.estimation.prediction import WARM_UP, Prediction
from awescli.flightlog.log import FlightLog
from awescli.simulation.rollout import Columns, Simulator
from awescli.simulation.segments import observe

LEVEL = 0.9


@dataclass(frozen=True)
class Seen:
    """How a model errs on the loops it was fitted and chosen on. tension: their mean [N]; share: of their energy; scatter: of one loop
    about that share; seconds: of a loop; loops: how many."""

    tension: float
    share: float
    scatter: float
    seconds: float
    loops: int

    @classmethod
    def of(cls, blocks: Sequence[Mapping | None]) -> "Seen | None":
        """From `mechanical_power` of those parts; None for fewer than two loops."""
        rows = [row for block in blocks if block for row in block["by_loop"]]
        keys = ("measured_J", "predicted_J", "seconds", "reeled_m")
        E, predicted, seconds, reeled = (np.array([row[key] for row in rows]) for key in keys)
        if len(rows) < 2 or not E.sum() or not reeled.sum():
            return None
        share = float(predicted.sum() / E.sum() - 1)
        left = (predicted - (1 + share) * E) / np.abs(E).mean()
        tension = float(np.abs(E).sum() / reeled.sum())
        return cls(tension, share, float(np.sqrt(left @ left / (len(rows) - 1))), float(seconds.mean()), len(rows))


def energy_sensitivities(simulator: Simulator, log: FlightLog, prediction: Prediction, names: Sequence[str]) -> np.ndarray:
    """(K, N, n) [J per unit] by how much the predicted energy between two samples changes with parameters.

    Segments begin at measured states, WARM_UP before the prediction, where a line whose length is changed has come to rest: as its start,
    which is fitted to that second, would have. Zero where a segment has diverged, and for parameters that the simulator is not
    differentiable in.
    """
    steps, dt = len(prediction.time) - 1, float(prediction.time[1])
    before = int(round(WARM_UP / dt))
    asked = [n for n in names if n in simulator.wrt]
    segments = observe(log, simulator.kite, prediction.first - before, before + steps, ("tension",)).segments
    trajectories, J = simulator.sensitivities(segments, Columns(parameters=tuple(asked)), ("tension",))
    rows = prediction.first[:, None] + np.arange(steps + 1)[None]
    alive = np.arange(before, before + steps + 1)[None] < trajectories.alive[:, None]
    power = np.where(alive[..., None], J[:, before:, 0], 0.0) * log["reel_out_speed"][rows][..., None]
    between = dt / 2 * (power[:, :-1] + power[:, 1:])
    result = np.zeros((*between.shape[:2], len(names)))
    result[..., [list(names).index(n) for n in asked]] = between
    return result


def energy_believed(simulator: Simulator, log: FlightLog, prediction: Prediction, known: Known) -> np.ndarray:
    """(K, N) [J] by how much a fit believes the energy between two samples to differ from what is predicted: the record's error, which
    kite files leave out."""
    differ = known.found != 0.0
    names = [n for n, d in zip(known.names, differ, strict=True) if d]
    return energy_sensitivities(simulator, log, prediction, names) @ known.found[differ]


def power_interval(mean: float, seconds: float, reeled: float, J: np.ndarray, known: Known, seen: Seen | None) -> dict:
    """interval_W (LEVEL), and std_W of its parts, of a mean power [W] over `seconds` in which `reeled` metres of line moved through the
    winch, with sensitivities J (n,) [W per unit].

    None in place of an interval where the model has no loops that it was fitted to.
    """
    of = known.variances(J)
    if seen is None:
        return {"interval_W": None, "interval_level": LEVEL, "std_W": {}}
    usual = seen.tension * reeled / seconds
    once = (seen.scatter * usual) ** 2 * max(seen.seconds / seconds, 1e-12)
    # a model that is right has a share too, by chance: what the scatter leaves of a mean over the seen loops
    shared = max(seen.share**2 - seen.scatter**2 / seen.loops, 0.0) * usual**2
    total = of["together"] + shared + once
    own = (shared + once) ** 2 / (seen.loops - 1)
    freedom = total**2 / own if own > 0 else np.inf
    half = float(stdtrit(min(freedom, 1e6), (1 + LEVEL) / 2) * np.sqrt(total))
    centre = mean + float(J @ known.found)
    std = {part: float(np.sqrt(of[part])) for part in ("parameters", "wind")} | {"loops": float(np.sqrt(shared + once))}
    return {"interval_W": [centre - half, centre + half], "interval_level": LEVEL, "std_W": std}
