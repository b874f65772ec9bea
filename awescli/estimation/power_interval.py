"""How well predicted power is known: from loops that a model was fitted to and chosen on, from parameters, and from the wind's record.

    expected = mean + J f - w e F              f: found error of the record; e: what the model is off by on seen loops, as a share of F, the
                                               power that their mean tension would have at the speed of the line
    variance = D C D' + v F^2 + (1 - w)^2 max(e^2 - v, 0) F^2

e and its variance v are of the seconds that are asked for, among the seen loops: the errors of loops are a constant, a process in time (the
wind's record is off for minutes), and what differs from loop to loop (noise, gusts, starts). That is kriging with an unknown constant
(Cressie, Statistics for Spatial Data, 1993, ch. 3); memory and shares are weighed by their restricted likelihood.

What was seen is taken off as far as parameters or the record may be to blame for it: w = min(1, V / (e F)^2), V = J C J' of the parameters
and of what was declared of the record. D is then what J has beyond that of the seen loops, which have shown the rest. What the model lacks
stays in the variance. In other phases, and where loops reel out and in, nothing is taken off: w = 0, D = J.

J is the exact sensitivity of tension times reel-out speed, integrated; C the covariance of parameters and of the record's errors, as a
fit left them. The interval is Student's, with the effective degrees of freedom of such a sum (Welch, Biometrika 34, 1947).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import softmax, stdtrit

from awescli.estimation.known import Known
from awescli.estimation.prediction import Prediction
from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import WARM_UP
from awescli.simulation.rollout import Columns, Simulator
from awescli.simulation.segments import observe

LEVEL = 0.9
MEMORIES = tuple(2.0**k for k in range(9))
"""Of the errors of loops, in loops."""
LOOSE = (0.001, 0.01, 0.1)
"""Shares of their variance that differ from loop to loop."""
EXACT = 1e-12
"""Share of a loop's energy below which an error is rounding."""


@dataclass(frozen=True)
class Pieces:
    """The seconds that a mean power is of, piece by piece. time: (P,) [s] middle of each; seconds: (P,); reeled: (P,) [m] line that
    moved through the winch."""

    time: np.ndarray
    seconds: np.ndarray
    reeled: np.ndarray

    @classmethod
    def of(cls, rows: Sequence[Mapping], loops: np.ndarray, dt: float) -> "Pieces":
        """From the rows by loop of `mechanical_power`; loops: (K, 2) their sample ranges."""
        time = [dt * loops[row["loop"] - 1].mean() for row in rows]
        return cls(np.array(time), *(np.array([row[key] for row in rows]) for key in ("seconds", "reeled_m")))


@dataclass(frozen=True)
class Seen:
    """How a model errs on the loops it was fitted and chosen on. pieces: these loops; tension: their mean [N]; error: (L,) of their
    energies, as a share of what that tension gives; slope: (n,) what changes it, of all together [1 per unit of a parameter]; earns:
    power is earned in each of them."""

    pieces: Pieces
    tension: float
    error: np.ndarray
    slope: np.ndarray
    earns: bool = True

    @classmethod
    def of(cls, blocks: Sequence[Mapping | None], loops: np.ndarray, dt: float, slope: np.ndarray) -> "Seen | None":
        """From `mechanical_power` of those parts and the sensitivities (n,) [J per unit] of their energy; None for fewer than two loops."""
        rows = [row for block in blocks if block for row in block["by_loop"] if row["reeled_m"] > 0]
        E, predicted = (np.array([row[key] for row in rows]) for key in ("measured_J", "predicted_J"))
        if len(rows) < 2 or not E.sum():
            return None
        pieces = Pieces.of(rows, loops, dt)
        tension = float(np.abs(E).sum() / pieces.reeled.sum())
        usual = tension * pieces.reeled
        return cls(pieces, tension, (predicted - E) / usual, slope / usual.sum(), bool((E > 0).all()))

    def like(self, rows: Sequence[Mapping]) -> bool:
        """Does each of other loops, rows of `mechanical_power`, earn power as each of these does? Tension that is too large earns too much
        in one that reels out, and costs too much in one that reels in."""
        return self.earns and all(row["predicted_J"] > 0 for row in rows)

    def expected(self, pieces: Pieces) -> tuple[float, float]:
        """(mean, variance) of the error of other seconds, as the same share."""
        loop = float(self.pieces.seconds.mean())
        processes = [(memory * loop, loose) for memory in MEMORIES for loose in LOOSE]
        means, variances, likelihoods = np.array([self._kriged(pieces, *p) for p in [*processes, (loop, 1.0)]]).T
        # before anything is seen, that there is no process at all is as likely as that there is one
        weight = softmax(likelihoods - np.log([*[len(processes)] * len(processes), 1.0]))
        mean = float(weight @ means)
        return mean, float(weight @ (variances + (means - mean) ** 2))

    def _kriged(self, pieces: Pieces, memory: float, loose: float) -> tuple[float, float, float]:
        """(mean, variance, restricted log likelihood) with a process of that memory [s], of whose variance a share is loose."""
        time, usual = self.pieces.time, float(self.pieces.seconds.mean())
        share = pieces.reeled / max(pieces.reeled.sum(), EXACT)
        K = (1 - loose) * _alike(time[:, None] - time, memory) + loose * np.diag(usual / self.pieces.seconds)
        across = (1 - loose) * _alike(time[:, None] - pieces.time, memory) @ share
        own = (1 - loose) * share @ _alike(pieces.time[:, None] - pieces.time, memory) @ share
        own += loose * share**2 @ (usual / pieces.seconds)
        factor = cho_factor(K, lower=True)
        of_one, of_across = cho_solve(factor, np.stack([np.ones(len(time)), across], axis=1)).T
        constant = of_one @ self.error / of_one.sum()
        left = self.error - constant
        variance = max(left @ cho_solve(factor, left) / (len(left) - 1), EXACT**2)
        likelihood = -0.5 * ((len(left) - 1) * np.log(variance) + np.log(of_one.sum())) - np.log(np.diag(factor[0])).sum()
        kriged = own - across @ of_across + (1 - of_across.sum()) ** 2 / of_one.sum()
        return float(constant + of_across @ left), float(variance * kriged), float(likelihood)


def _alike(apart: np.ndarray, memory: float) -> np.ndarray:
    """Correlation of a smooth process, so many seconds apart: a wind's record runs in lines from entry to entry."""
    return np.exp(-0.5 * (apart / memory) ** 2)


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


def power_interval(mean: float, pieces: Pieces, J: np.ndarray, known: Known, seen: Seen | None, alike: bool = False) -> dict:
    """interval_W (LEVEL), and std_W of its parts, of a mean power [W] over `pieces`, with sensitivities J (n,) [W per unit].

    alike: they are of loops as the seen ones are (`Seen.like`). None in place of an interval where the model has no loops that it was
    fitted to.
    """
    if seen is None:
        return {"interval_W": None, "interval_level": LEVEL, "std_W": {}}
    usual = seen.tension * float(pieces.reeled.sum() / pieces.seconds.sum())
    error, variance = (usual * e for e in seen.expected(pieces))
    variance *= usual
    blamed = min(1.0, known.room(J) / max(error**2, EXACT)) if alike else 0.0
    of = known.variances(J - usual * seen.slope if alike else J)
    own = variance + (1 - blamed) ** 2 * max(error**2 - variance, 0.0)
    total = of["together"] + own
    freedom = total**2 * (len(seen.error) - 1) / own**2 if own > 0 else np.inf
    half = float(stdtrit(min(freedom, 1e6), (1 + LEVEL) / 2) * np.sqrt(total))
    centre = mean + float(J @ known.found) - blamed * error
    std = {part: float(np.sqrt(of[part])) for part in ("parameters", "wind")} | {"loops": float(np.sqrt(own))}
    return {"interval_W": [centre - half, centre + half], "interval_level": LEVEL, "std_W": std}
