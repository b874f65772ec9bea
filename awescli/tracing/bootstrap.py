"""What a controller that feels the kite makes of an effect of its surfaces in gusty air, where nothing is missing.

The flight is flown again by the fitted model, in other gusts of the same levels, its surfaces answering what is different as the record
says that they answer the kite. What the effect gains there, it gains of a flight without it (a parametric bootstrap; Efron & Tibshirani,
An Introduction to the Bootstrap, 1993).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.fitted import Fit
from awescli.estimation.links import RUNAWAY
from awescli.estimation.misfit import Misfit, NuisanceValues
from awescli.estimation.problem import EstimationProblem
from awescli.flightlog.smoothing import local_quadratic
from awescli.notation.quantities import OUTPUTS, STATES, SURFACES
from awescli.physics.disturbances import GUST_RATES, GUSTS
from awescli.simulation.rollout import Trajectories
from awescli.simulation.segments import Observed
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.frame import Frame
from awescli.tracing.models import fit_added, fit_on, fit_on_part
from awescli.tracing.tried import Tried

SLOWER = 1.5
"""[s] What lasts longer is the plan of a flight; what is shorter answers gusts."""
ROUNDS = 100
"""Times that a flight and its set-points are brought to agree, at most: each brings them nearer, over a segment in some twenty."""
AGREED = 1e-5
"""[rad] by which they may differ then."""
AIR = (*GUSTS, *GUST_RATES)
Flights = dict[int, tuple[np.ndarray, np.ndarray]]
"""First sample of a segment -> (set-points (N+1, 5), measured (N+1, n_out))."""


@dataclass(frozen=True)
class FlownAgain(Frame):
    """A frame in which the segments of all flights have been flown again."""

    of: tuple[Flights, ...] = ()

    def problems(self, keys: Sequence[str]) -> list[EstimationProblem]:
        each = zip(super().problems(keys), self.of, strict=True)
        return [replace(p, fitted=_in_place(p, p.fitted, made), validation=_in_place(p, p.validation, made)) for p, made in each]


def _in_place(problem: EstimationProblem, observed: Observed, made: Flights) -> Observed:
    """The segments with what was flown again in the place of what was recorded, rates of set-points included."""
    segments, names = observed.segments, problem.kite.input_names
    setpoints, measured = (np.stack(a) for a in zip(*(made[first] for first in segments.first.tolist()), strict=True))
    columns = [names.index(f"{s}_rate") for s in SURFACES]
    rates = segments.inputs[:, :, columns]
    rates[:, 1:] = np.diff(setpoints, axis=1) / segments.dt
    return replace(observed, segments=replace(segments, setpoints=setpoints).with_inputs(columns, rates), measured=measured)


def gain_under_null(frame: Frame, here: FittedModel, tried: Tried, seed: int = 0) -> float:
    """Deviance that a candidate gains beside the fitted model `here` in its flights flown again without it, at least 0."""
    part, few = fit_on_part(frame, here)
    made = []
    for flight, fit, judged in zip(frame.flights, few.fit.flights, few.judged, strict=True):
        surfaces = [SURFACES.index(s) for s in flight.answering]
        K = feedback_gains(fit, surfaces)
        made.append({**flown_again(fit, K, surfaces, seed), **flown_again(judged, K, surfaces, seed + 1)})
    again = FlownAgain(part.flights, part.horizon, part.outputs, part.per_flight, part.seconds, part.spacing, tuple(made))
    null = fit_on(again, few)
    late = fit_on(again, fit_added(again, null, tried.key, *tried.start))
    return max(here.segments / few.segments * (null.deviance - late.deviance), 0.0)


@RUNAWAY
def feedback_gains(fit: Fit, surfaces: Sequence[int]) -> np.ndarray:
    """(surfaces, 9) by how much the recorded set-points of some surfaces change with the kite's `motion` [rad per unit], slow changes of
    either aside: a linear regression over the segments that fly; zero where none does."""
    recorded = fit.misfit.observed.segments
    flown = _flown(fit, fit.own, recorded.setpoints)
    felt, asked = (a[~flown.diverged] for a in (motion(flown, recorded.dt), recorded.setpoints[:, :, surfaces]))
    if not len(felt):
        return np.zeros((len(surfaces), felt.shape[2]))
    X, u = (np.concatenate([one - local_quadratic(one, recorded.dt, SLOWER) for one in each]) for each in (felt, asked))
    return np.linalg.lstsq(X, u, rcond=None)[0].T


def motion(flown: Trajectories, dt: float) -> np.ndarray:
    """(K, N+1, 9) what a controller may feel along segments: body rates, the angles through which they have turned it, body velocity."""
    rates, velocity = (flown.states[:, :, [STATES.index(n) for n in names]] for names in ("pqr", "uvw"))
    turned = np.zeros_like(rates)
    turned[:, 1:] = np.cumsum((rates[:, 1:] + rates[:, :-1]) * dt / 2, axis=1)
    return np.concatenate([rates, turned, velocity], axis=2)


@RUNAWAY
def flown_again(fit: Fit, K: np.ndarray, surfaces: Sequence[int], seed: int) -> Flights:
    """The segments of a fit in other gusts, from where they began; `surfaces` answer by K what is different from the flight that was, all
    else that acts is as it was. What is measured has noise of the levels that were found. One that diverges stays as it was recorded."""
    random, observed = np.random.default_rng(seed), fit.misfit.observed
    own = replace(fit.own, path=_other_gusts(fit.misfit, fit.own.path, random))
    flown, setpoints = _closed(fit, own, K, surfaces)
    measured = flown.outputs[:, :, [OUTPUTS.index(n) for n in observed.outputs]].copy()
    for name, drift in fit.misfit.drifted(own).items():
        measured[..., observed.outputs.index(name)] += drift
    measured += np.where(np.isfinite(observed.sigma), observed.sigma, 0.0) * random.standard_normal(measured.shape)
    lost = flown.diverged[:, None, None]
    setpoints, measured = np.where(lost, observed.segments.setpoints, setpoints), np.where(lost, observed.measured, measured)
    return {first: (setpoints[k], measured[k]) for k, first in enumerate(observed.segments.first.tolist())}


def _closed(fit: Fit, own: NuisanceValues, K: np.ndarray, surfaces: Sequence[int]) -> tuple[Trajectories, np.ndarray]:
    """(trajectories, set-points) that agree: what a flight makes the surfaces answer is flown next (Picard's iteration). In a segment that
    diverges nothing answers."""
    recorded = fit.misfit.observed.segments
    before, setpoints = motion(_flown(fit, fit.own, recorded.setpoints), recorded.dt), recorded.setpoints
    for _ in range(ROUNDS):
        flown, asked = _flown(fit, own, setpoints), recorded.setpoints.copy()
        flies = ~flown.diverged[:, None, None]
        asked[:, :, surfaces] += np.where(flies, motion(flown, recorded.dt) - before, 0.0) @ K.T
        if np.where(flies, np.abs(asked - setpoints), 0.0).max() < AGREED:
            break
        setpoints = asked
    return flown, setpoints


def _flown(fit: Fit, own: NuisanceValues, setpoints: np.ndarray) -> Trajectories:
    """The segments of a fit with other nuisances and set-points."""
    misfit = fit.misfit
    segments = replace(misfit.segments(own), setpoints=setpoints)
    return misfit.simulator.rollout(segments, misfit.values(fit.parameters.vector(misfit.names)))


def _other_gusts(misfit: Misfit, path: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Values (K, L + 1, W) of the processes at the nodes, with those of gusts drawn anew; every segment has its own."""
    spans = np.diff(misfit.nodes) * misfit.observed.segments.dt
    kept, spread, drawn = misfit.axes.decay(spans), np.sqrt(misfit.axes.variance(spans)), random.standard_normal(path.shape)
    drawn[:, 0] *= misfit.axes.level
    for link, (decay, std) in enumerate(zip(kept, spread, strict=True)):
        drawn[:, link + 1] = decay * drawn[:, link] + std * drawn[:, link + 1]
    return np.where([axis in AIR for _, axis in misfit.labels], drawn, path)
