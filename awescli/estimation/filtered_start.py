"""Where a filter over the warm-up leaves a model: its states, and what acts beside it (gusts, a longer line, model error, drifts).

Over a warm-up these are estimated together, at the levels that a fit has found (filter error, Jategaonkar ch. 5). From then on nothing is
measured. What is to be expected of an Ornstein-Uhlenbeck process with memory tau is then

    x(t) = x(t0) exp(-(t - t0) / tau),

so a prediction begins in the air that the kite has just flown in, and the air fades. A linear model of past outputs (ARX) does as much
without saying so. Every warm-up stands alone: what later ones see is the future.
"""

from dataclasses import replace

import numpy as np

from awescli.estimation.known import Known
from awescli.estimation.misfit import Misfit, NuisanceValues
from awescli.estimation.processes.base import active
from awescli.notation.quantities import OUTPUTS
from awescli.simulation.rollout import Simulator, Trajectories
from awescli.simulation.segments import Observed

ROUNDS = 8
"""Most Gauss-Newton steps of a warm-up."""
SHARES = (1.0, 0.5, 0.25, 0.1)
"""Of a step, in turn, until a segment gains by it."""
ENOUGH = 0.1
"""Cost (chi-square) below which a segment gains nothing any more: it is at its best."""
AT_ONCE = 200
"""Warm-ups that are filtered together: an hour of flight has thousands, and each has sensitivities of its own."""
UNKNOWN = np.zeros(0)
"""No parameter is fitted."""


def filtered(simulator: Simulator, observed: Observed, before: int, known: Known) -> tuple[Misfit, NuisanceValues]:
    """(misfit of whole segments, their starts and processes): estimated from the first `before` samples, fading after them. The
    simulator must be differentiable in the disturbances."""
    whole = Misfit(simulator, observed.scaled(known.factors), (), known.processes, apart=True)
    warm = replace(whole, observed=whole.observed.head(before))
    every = np.arange(len(warm.observed.segments))
    parts = [smoothed(replace(warm, observed=warm.observed.pick(some))) for some in np.split(every, every[AT_ONCE::AT_ONCE])]
    own = NuisanceValues(*(np.concatenate([getattr(p, what) for p in parts]) for what in ("starts", "path")))
    return whole, faded(whole, warm, own)


def smoothed(misfit: Misfit) -> NuisanceValues:
    """Starts and processes of segments that stand alone, each at its best or as near as steps lead."""
    own = misfit.own()
    cost, moving = _costs(misfit, own), np.ones(len(own.starts), bool)
    for _ in range(ROUNDS):
        links, trajectories = misfit.links(UNKNOWN, own)
        moving &= trajectories.alive > misfit.observed.segments.steps
        if not moving.any():
            break
        change = misfit.eliminated(links.gram(), own, np.flatnonzero(moving)).nuisances()
        before, waiting = cost, moving
        for share in SHARES:
            trial = own.moved(change, share, waiting)
            new = _costs(misfit, trial)
            better = waiting & (new < cost)
            own = NuisanceValues(*(_chosen(better, *pair) for pair in ((trial.starts, own.starts), (trial.path, own.path))))
            cost, waiting = np.where(better, new, cost), waiting & ~better
        moving = moving & (before - cost >= ENOUGH)
    return own


def faded(whole: Misfit, warm: Misfit, own: NuisanceValues) -> NuisanceValues:
    """Nuisances of a warm-up, carried on to the end of segments that go on."""
    dt, memory = whole.observed.segments.dt, {g.name: g.memory for g in active(whole.processes)}
    seen, at = warm.nodes * dt, whole.nodes * dt
    path = np.zeros((len(own.starts), len(at), len(whole.labels)))
    for w, (group, axis) in enumerate(whole.labels):
        known = own.path[..., warm.labels.index((group, axis))]
        held = np.stack([np.interp(at, seen, row) for row in known]) if len(known) else path[..., w]
        path[..., w] = held * np.exp(-np.maximum(at - seen[-1], 0.0) / memory[group])
    return NuisanceValues(own.starts, path)


def as_reported(misfit: Misfit, own: NuisanceValues) -> Trajectories:
    """What sensors with these drifts report of the segments in these processes."""
    flown = misfit.simulator.rollout(misfit.segments(own))
    outputs = flown.outputs.copy()
    for name, drift in misfit.drifted(own).items():
        outputs[..., OUTPUTS.index(name)] += drift
    return replace(flown, outputs=outputs)


def _costs(misfit: Misfit, own: NuisanceValues) -> np.ndarray:
    """(K,) what each segment costs, its processes included."""
    squares, _ = misfit.costs(UNKNOWN, own)
    return squares + [misfit.prior_cost(own, np.array([k])) for k in range(len(squares))]


def _chosen(which: np.ndarray, new: np.ndarray, old: np.ndarray) -> np.ndarray:
    return np.where(which.reshape(-1, *[1] * (new.ndim - 1)), new, old)
