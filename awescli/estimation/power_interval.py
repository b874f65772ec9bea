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
from dataclasses import dataclass, field

import numpy as np
from scipy.special import stdtrit

from awescli.estimation.prediction import WARM_UP, Prediction
from awescli.estimation.processes.base import Process
from awescli.flightlog.log import FlightLog
from awescli.physics.flight_model import FlightModel
from awescli.simulation.rollout import Columns, Simulator
from awescli.simulation.segments import observe

LEVEL = 0.9
AT_END = 1 - 1e-6
"""Share of its range from which an error of the record stands at the end of it."""


@dataclass(frozen=True)
class Known:
    """What is known of a model beside its values. names: of parameters and of errors of the wind record; covariance (n, n); record (n,)
    bool, which of them are the record's; found (n,): by how much they are believed to differ from what is predicted with (the fitted
    error of the record; kite files leave it out). processes: what is random in time, with its levels; factors: channel -> factor on the
    declared noise."""

    names: tuple[str, ...]
    covariance: np.ndarray
    record: np.ndarray
    found: np.ndarray
    processes: tuple[Process, ...] = ()
    factors: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def declared(cls, kite: FlightModel) -> "Known":
        """Of a kite that nothing was fitted to: the stated prior deviations."""
        names = (*kite.parameters.free, *kite.record)
        std = np.array([kite.parameters[n].prior_std for n in names])
        return cls(names, np.diag(std**2), np.isin(names, kite.record), np.zeros(len(names)))

    @classmethod
    def fitted(cls, params: Mapping, kite: FlightModel) -> "Known":
        """Of what a fit left in params.json; what the kite does not have (of another flight) is left out. An error of the record at the end
        of its range is none (`physics.kite.record_errors`): it stands for what the model lacks, and is not believed."""
        rows = params["parameters"] | params["wind_record_error"]
        correlation = params["correlation"]
        kept = [i for i, n in enumerate(correlation["names"]) if n in kite.parameter_names and n in rows]
        names = tuple(correlation["names"][i] for i in kept)
        std = np.array([rows[n]["std"] for n in names])
        record = np.isin(names, kite.record)
        believed = [n in kite.record and abs(rows[n]["value"]) < AT_END * kite.parameters[n].upper for n in names]
        found = np.array([rows[n]["value"] if b else 0.0 for n, b in zip(names, believed, strict=True)])
        return cls(names, np.array(correlation["matrix"])[np.ix_(kept, kept)] * np.outer(std, std), record, found)

    def draws(self, kite: FlightModel, count: int, seed: int, of: np.ndarray | None = None) -> list[dict[str, float]]:
        """`count` kites that might be this one: parameter -> value, from a normal distribution about the kite's own and what was found,
        kept within bounds. of: (n,) which of the names; default those of the kite: the record's errors are of one flight."""
        of = np.flatnonzero(~self.record if of is None else of)
        rows = [kite.parameters[self.names[i]] for i in of]
        random, centre = np.random.default_rng(seed), np.array([p.value for p in rows]) + self.found[of]
        lower, upper = (np.array([getattr(p, end) for p in rows]) for end in ("lower", "upper"))
        covariance = self.covariance[np.ix_(of, of)]
        std = np.maximum(np.sqrt(np.diag(covariance)), np.finfo(float).tiny)
        # in units of the deviations, for parameters differ by ten powers of ten; what rounding makes negative is nothing
        size, axes = np.linalg.eigh(covariance / np.outer(std, std))
        drawn = centre + (random.standard_normal((count, len(of))) * np.sqrt(np.maximum(size, 0.0))) @ axes.T * std
        return [{p.name: float(v) for p, v in zip(rows, np.clip(x, lower, upper), strict=True)} for x in drawn]

    def variances(self, J: np.ndarray) -> dict[str, float]:
        """Of a quantity with sensitivities J (n,): all together, of the parameters and of the record alone."""
        parts = {"together": np.ones(len(J), bool), "parameters": ~self.record, "wind": self.record}
        return {part: max(float((J * of) @ self.covariance @ (J * of)), 0.0) for part, of in parts.items()}


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
