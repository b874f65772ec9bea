"""Sizes and shapes of the last effect of a model: is the size one that anything has; and shapes, which give no size but a form, are held
where they were probed until the effect is worth a fit to the end."""

from collections.abc import Iterable

import numpy as np

from awescli.estimation.gauss_newton import OutOfReach
from awescli.notation.present import present
from awescli.physics.effects.base import Effect
from awescli.physics.kite import make_effect
from awescli.tracing.criteria import CRITERIA, Criteria
from awescli.tracing.fitted_model import FittedModel, bounded
from awescli.tracing.frame import Frame
from awescli.tracing.models import QUICK, WHOLE, begins_nowhere, fit_held, fit_on, part_of

AT_END = 1e-3
"""Share of its range, of a lower end above zero itself, within which a strength sits at that end."""
UNSEEN = 0.05
"""Share of a segment by which an onset may be uncertain, and not be chosen on unseen loops."""


def plausible(model: FittedModel, key: str) -> bool:
    """No fitted strength of an effect sits at the end of its plausible range, null aside."""
    for name in (n for n in model.strengths if n.startswith(f"{key}.")):
        p = model.table[name]
        near, null_at_lower = AT_END * (p.upper - p.lower), abs(p.lower) < 1e-12
        # a range over decades begins where its smallest sizes are distinguished
        above = min(near, AT_END * p.lower) if p.lower > 0 else near
        if p.value > p.upper - near or (p.value < p.lower + above and not null_at_lower):
            return False
    return True


def refined(frame: Frame, model: FittedModel, criteria: Criteria = CRITERIA, partly: FittedModel | None = None) -> FittedModel:
    """The model with the shapes of its last effect fitted too. One that stands where it was probed is as uncertain as the strength, and
    stays free unless that does worse; one at null is freed only where the model is decisively likelier for it. partly: the model as fitted
    to a part of the flight, which says first whether that may be so."""
    effect = make_effect(model.keys[-1], frame.declared)
    null, held = {p.name: p.value for p in effect.parameters}, None
    for shape in effect.shapes:
        name, probes = f"{effect.key}.{shape}", effect.probes.get(shape, ())
        if model.table[name].value != null[shape]:
            held = held or (fit_on(part_of(frame), partly) if partly else None)
            model = _freed(frame, model, effect, shape, criteria, held)
            model = _held_where_null(frame, model, name, null[shape], criteria)
            continue
        for start in (s for s in (*probes, *effect.refinements.get(shape, ())) if s != null[shape] and not begins_nowhere(model, name, s)):
            held = held or (fit_on(part_of(frame), partly) if partly else None)
            if held and not _promising(part_of(frame), held, name, start, model.segments / held.segments, criteria):
                continue
            trial = _begun(frame, model, name, start, criteria)
            if trial and trial.fit.ended and trial.deviance < model.deviance - criteria.decisive and trial.unseen < model.unseen:
                model = trial
    return model


def _likeliest(model: FittedModel) -> tuple[bool, float]:
    """What the likeliest of some models has least of: a fit that came to no end says nothing."""
    return not model.fit.ended, model.deviance


def _promising(part: Frame, model: FittedModel, name: str, start: float, times: float, criteria: Criteria) -> bool:
    """May a shape that leaves its null, from `start`, gain half of what is decisive on the whole of a flight that is `times` its part?"""
    freed = _begun(part, model, name, start, criteria)
    return freed is not None and times * (model.deviance - freed.deviance) > criteria.decisive / 2


def _begun(frame: Frame, model: FittedModel, name: str, start: float, criteria: Criteria) -> FittedModel | None:
    """The model with a shape free, from `start`; None where that comes nowhere near."""
    try:
        return fit_on(frame, model, {name: start}, free=(name,), reach=model.fit.deviance + criteria.finalists)
    except OutOfReach:
        return None


def _freed(
    frame: Frame, model: FittedModel, effect: Effect, shape: str, criteria: Criteria, partly: FittedModel | None = None
) -> FittedModel:
    """The model with a probed shape of its last effect free, from the likeliest place. partly: the model as fitted to a part of the flight,
    where that place is sought then, but for an onset, which may lie in the rest."""
    name = f"{effect.key}.{shape}"
    if shape == effect.onset:
        best = _onset_freed(frame, model, name, criteria)
    elif partly:
        place = _freed_anywhere(part_of(frame), partly, effect, shape, QUICK, criteria).table[name].value
        best = fit_on(frame, model, {name: place}, free=(name,))
    else:
        best = _freed_anywhere(frame, model, effect, shape, WHOLE, criteria)
    gained = best.deviance < model.deviance + criteria.decisive and best.unseen < model.unseen + criteria.decisive
    return best if best.fit.ended and gained else model


def _freed_anywhere(
    frame: Frame, model: FittedModel, effect: Effect, shape: str, how: tuple[int, float], criteria: Criteria
) -> FittedModel:  # fmt: skip
    """The likeliest of the models with a shape free, from where it stands and from its probes."""
    name, null = f"{effect.key}.{shape}", next(p.value for p in effect.parameters if p.name == shape)
    probes = (p for p in effect.probes.get(shape, ()) if p != null)
    starts = dict.fromkeys((model.table[name].value, *(p for p in probes if not begins_nowhere(model, name, p))))
    return present(_likelier(frame, None, model, name, starts, how, criteria), f"a fit with {name} free")


def _likelier(
    frame: Frame, best: FittedModel | None, model: FittedModel, name: str, starts: Iterable[float], how: tuple[int, float],
    criteria: Criteria,
) -> FittedModel | None:  # fmt: skip
    """The likeliest of a model and of those that are fitted with a shape free, from each of some values. One that comes nowhere near the
    best is given up."""
    for start in starts:
        reach = best.fit.deviance + criteria.finalists if best and best.fit.ended else np.inf
        try:
            other = fit_on(frame, model, {name: start}, free=(name,), reach=reach, how=how)
        except OutOfReach:
            continue
        best = min(best or other, other, key=_likeliest)
    return best


def _onset_freed(frame: Frame, model: FittedModel, name: str, criteria: Criteria) -> FittedModel:
    """The model with the onset of its last effect free: from where it stands, for the screening has sought it all over the flight. Where it
    lies in none of the loops that are fitted, unseen ones choose it, by halves of a segment, and it is held there."""
    best = present(_likelier(frame, None, model, name, [model.table[name].value], WHOLE, criteria), f"a fit with {name} free")
    step, place = frame.horizon, best.fit.names.index(name)
    uncertain = np.sqrt(best.fit.covariance[place, place]) > UNSEEN * step and name not in bounded(best.fit)
    if not uncertain or frame.fits(best.table[name].value):
        return best
    while (step := step / 2) > UNSEEN * frame.horizon:
        there = best.table[name]
        either = {min(max(there.value + side, there.lower), there.upper) for side in (-step, step)} - {there.value}
        best = present(_likelier(frame, best, best, name, sorted(either), WHOLE, criteria), f"a fit with {name} free")
    return fit_held(frame, best, {name: best.table[name].value})


def _held_where_null(frame: Frame, model: FittedModel, name: str, null: float, criteria: Criteria) -> FittedModel:
    """The model with a shape that has come to its null held there, where that is as likely: a lag that was probed with a limit of its rate,
    and has none, ended with that limit at the end of its range and counted as an implausible size."""
    p = model.table[name]
    if name not in model.strengths or abs(p.value - null) > AT_END * (p.upper - p.lower):
        return model
    held = fit_held(frame, model, {name: null})
    return held if held.deviance < model.deviance + criteria.decisive else model
