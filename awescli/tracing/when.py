"""Since when, and in which flights: what an answer gains on each segment of each flight, its size in each flight, and its onset; and what
one of several flights shows that the others do not."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from awescli.tracing.criteria import CRITERIA, Criteria
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.frame import Frame
from awescli.tracing.models import fit_apart
from awescli.tracing.rest import gusts_of
from awescli.tracing.screen import Score, holm, screen_apart


@dataclass(frozen=True)
class InFlight:
    """What an answer is worth in one flight.

    keys: of the answer's effects; label: of the flight, "" for the plan's; times, gains: (K,) where the segments begin [s], and the
    deviance that the answer gains there on the declared model; onset: [s] between which two times it began to act, None where it acted from
    the beginning; sizes: full name of a strength -> (value, standard deviation) from this flight, all other parameters shared.
    """

    keys: tuple[str, ...]
    label: str
    times: np.ndarray
    gains: np.ndarray
    onset: tuple[float, float] | None
    sizes: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Alone:
    """What one of several flights shows by itself. label: of the flight; key: of the candidate that it shows most of; drop: deviance that
    it promises to gain there."""

    label: str
    key: str
    drop: float


def shown_alone(frame: Frame, model: FittedModel, keys: Sequence[str], criteria: Criteria = CRITERIA) -> tuple[Alone, ...] | None:
    """What single flights show beside a model: an instrument that was off in one of them is of no size that suits all, and its drift hides
    it there. Not of flights in gusty air, where a score by itself says little. None for one flight alone."""
    if len(frame.flights) < 2:
        return None
    found = screen_apart(frame, model, [k for k in keys if k not in model.keys])
    calm = [i for i in range(len(found)) if all(g.level < criteria.gusty for g in gusts_of(model, i))]
    scores = [(i, s) for i in calm for s in found[i].scores]
    sure = holm([s.p_value for _, s in scores], criteria.family_error)
    best: dict[int, Score] = {}
    for (i, score), seen in zip(scores, sure, strict=True):
        if seen and score.drop >= criteria.in_one_flight:
            best.setdefault(i, score)
    # parameters that suit all flights half are what the others show: of each the best, where it is that of the flight that shows most
    most = max(best.values(), key=lambda s: s.drop).key if best else ""
    labels = [f.label or f.log.name for f in frame.flights]
    return tuple(Alone(labels[i], s.key, s.drop) for i, s in sorted(best.items()) if s.key == most)


def in_flights(frame: Frame, null: FittedModel, model: FittedModel, criteria: Criteria = CRITERIA) -> tuple[InFlight, ...]:
    """The answer `model` in each of the flights."""
    apart = fit_apart(frame, model) if len(frame.flights) > 1 else model
    std = dict(zip(apart.fit.names, np.sqrt(np.diag(apart.fit.covariance)), strict=True))
    found, t, v = [], 0, 0
    for flight, fitted, judged in zip(frame.flights, model.fit.flights, model.judged, strict=True):
        of_train, of_validation = slice(t, t + len(fitted.alive)), slice(v, v + len(judged.alive))
        t, v = of_train.stop, of_validation.stop
        first = np.concatenate([f.misfit.observed.segments.first for f in (fitted, judged)])
        gains = np.concatenate([(null.train - model.train)[of_train], (null.validation - model.validation)[of_validation]])
        order = np.argsort(first)
        times, gains = first[order] * flight.log.dt, gains[order]
        names = {n: f"{n}@{flight.label}" if flight.label else n for n in model.strengths}
        sizes = {n: (float(apart.fit.parameters[own].value), float(std[own])) for n, own in names.items()}
        found.append(InFlight(model.keys, flight.label, times, gains, _between(times, onset(gains, criteria), frame.horizon), sizes))
    return tuple(found)


def onset(gains: np.ndarray, criteria: Criteria = CRITERIA) -> int:
    """The segment from which on an effect acts: 0, unless leaving it out before is decisively likelier. gains: (K,) deviance that it gains
    on each segment, in order of time. That the segment was searched for costs 2 log K (K equally likely places)."""
    if not len(gains):
        return 0
    before = np.concatenate([[0.0], np.cumsum(gains)[:-1]])
    best = int(np.argmin(before))
    return best if before[best] < -(criteria.decisive + 2 * np.log(len(gains))) else 0


def _between(times: np.ndarray, begins: int, horizon: float) -> tuple[float, float] | None:
    """From where the last segment without the effect begins to where the first one with it ends: it set in between."""
    return None if begins == 0 else (float(times[begins - 1]), float(times[begins]) + horizon)
