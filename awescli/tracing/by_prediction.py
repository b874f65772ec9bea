"""Where no likelihood holds, candidates are judged by what they predict (cross-validation; Jategaonkar ch. 11).

A measured flight may be too far from its model for a verdict: model error as a process takes all that is wrong, and no fit with it
comes to its minimum. Output error still fits what predicts best. Each candidate is fitted so beside the declared model, on train, and
unseen loops of validation say with which one the model predicts better. That is no verdict: what helps a model that is wrong need not be
what is missing. It is where to look first, and its worth is told on test loops like any other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.levels_in_turn import fit_levels
from awescli.estimation.prediction import predict
from awescli.physics.kite import make_effect
from awescli.tracing.criteria import CRITERIA, Criteria
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.frame import Frame
from awescli.tracing.models import Say
from awescli.tracing.screen import Score, Screening, screen
from awescli.tracing.search import mends
from awescli.tracing.shapes import plausible

TIGHT = 0.1
"""Chi-square that a fit need not gain any more."""


@dataclass(frozen=True)
class Better:
    """An effect with which the model predicts better. before, after: mean NRMSE on validation loops without and with it; rivals: key ->
    the same, of those that take away half as much or more."""

    key: str
    before: float
    after: float
    rivals: Mapping[str, float]


@dataclass(frozen=True)
class ByPrediction:
    """base: the declared model, fitted by output error; model: the same with the effects `better`, in the order in which they came."""

    base: FittedModel
    model: FittedModel
    better: tuple[Better, ...]


def better_by_prediction(
    frame: Frame, start: Mapping[str, float], keys: Sequence[str], criteria: Criteria = CRITERIA,
    progress: Say = lambda text: None,
) -> ByPrediction | None:  # fmt: skip
    """Effects of `keys` that take away much of the prediction error on validation loops, one after the other; None where there is none, or
    where the declared model, fitted from `start`, is nowhere near the flight."""
    progress("fitting the declared model by output error")
    base = model = _declared(frame, start)
    if base.flies < (1 - criteria.lost_share) * base.segments or not base.fit.ended or base.chi2 > criteria.nowhere:
        return None
    found: list[Better] = []
    for _ in range(criteria.effects):
        progress("predicting with candidates")
        before = error_of(frame, model)
        screening = screen(frame, model, [k for k in keys if k not in model.keys and not mends(frame, (*model.keys, k))])
        tried = [_with(frame, model, screening, s) for s in entered(frame, screening, criteria)]
        errors = {m.keys[-1]: error_of(frame, m) for m in tried if _sound(model, m, criteria)}
        if not errors or min(errors.values()) > (1 - criteria.predicts) * before:
            break
        best = min(errors, key=lambda key: errors[key])
        half = (before + errors[best]) / 2
        found.append(Better(best, before, errors[best], {k: e for k, e in errors.items() if k != best and e < half}))
        model = next(m for m in tried if m.keys[-1] == best)
    return ByPrediction(base, model.widened(), tuple(found)) if found else None


def error_of(frame: Frame, model: FittedModel) -> float:
    """Mean NRMSE on the validation loops of all flights; infinite where predictions diverge."""
    predictions = [
        predict(p.simulator.holding(f.parameters), flight.log, flight.split.validation, frame.horizon)
        for p, f, flight in zip(model.problems, model.fit.flights, frame.flights, strict=True)
    ]
    return float(np.mean([np.inf if p.diverged else p.nrmse()["mean"] for p in predictions]))


def entered(frame: Frame, screening: Screening, criteria: Criteria) -> list[Score]:
    """The candidates that are fitted: those that the screening puts first, and what else acts where the first two do."""
    first = list(screening.scores[: criteria.competitors])
    targets = {t for s in first[:2] if (t := make_effect(s.key, frame.declared).target)}
    return first + [s for s in screening.scores if s not in first and make_effect(s.key, frame.declared).target in targets]


def _sound(before: FittedModel, after: FittedModel, criteria: Criteria) -> bool:
    """Has a fit with one effect more ended, with a size that may be, every segment flown, and much less left on validation?"""
    ended = after.fit.ended and after.flies >= before.flies and plausible(after, after.keys[-1])
    return ended and after.chi2 < (1 - criteria.predicts) * before.chi2


def _declared(frame: Frame, start: Mapping[str, float]) -> FittedModel:
    problems = [p.with_processes([q if q.certain else q.at(dict.fromkeys(q.levels, 0.0)) for q in p.processes]) for p in frame.problems(())]
    tables = [p.simulator.kite.parameters.with_values(start) for p in problems]
    return FittedModel.of((), (), *fit_levels(problems, frame.labels, tables, frame.per_flight, True, 1, TIGHT, noise=False))


def _with(frame: Frame, model: FittedModel, screening: Screening, score: Score) -> FittedModel:
    """The model with a candidate added, fitted from where the screening sees it."""
    strengths, shapes = score.start(screening.rows)
    free, problems, tables, owns = tuple(dict.fromkeys((*model.strengths, *strengths))), [], [], []
    for raw, before, fitted in zip(frame.problems((*model.keys, score.key)), model.problems, model.fit.flights, strict=True):
        table = raw.simulator.kite.parameters
        known = {n: fitted.parameters[n].value for n in table if n in fitted.parameters}
        table = table.with_values({**known, **strengths, **shapes})
        table = table.with_rows(replace(table[n], free=True) for n in free)
        prior = raw.prior.with_rows(replace(raw.prior[n], free=True) for n in free)
        names = tuple(dict.fromkeys((*before.names, *free)))
        problem = replace(raw, processes=before.processes, names=names, prior=prior)
        problems.append(problem)
        tables.append(table)
        owns.append(problem.misfit().carried(fitted.own, fitted.misfit))
    found = fit_levels(problems, frame.labels, tables, frame.per_flight, True, 1, TIGHT, owns=owns, noise=False)
    return FittedModel.of((*model.keys, score.key), free, *found)
