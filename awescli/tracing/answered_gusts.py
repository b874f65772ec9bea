"""Effects of control surfaces in gusty air, where the surfaces answer gusts.

A fit takes the record of a surface as given. In a closed loop that is sound where the controller answers what the log's own sensors say:
then their noise is in the surface, too. One that feels the kite better than its log says with the surface where the kite really is, u =
-K x, and the error of the estimated state goes with it, E[u (x - x_estimated)] = -K P. What acts between surface and kite is biased by that
(Ljung, System Identification, 1999, ch. 13), and the more so the more gusts there are: a rudder that follows at once seemed 44 ms late, and
2 ms where its controller saw the log's sensors (`benchmarks/felt_by_controllers.py`). What other effects do goes with the states alone,
whose estimates have no part in their error: E[x_estimated (x - x_estimated)] = 0. So it is with surfaces that a plan moves (`feedback`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from awescli.tracing.bootstrap import gain_under_null
from awescli.tracing.criteria import Criteria
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.frame import Frame
from awescli.tracing.models import Say, fit_added, fit_on
from awescli.tracing.tried import Tried

SET_ASIDE = "set aside"
"""Outcome of a candidate whose gain is no more than what a controller that answers gusts may make of it."""


def of_answering(frame: Frame, key: str) -> bool:
    """Does an effect act between the record of a surface and the kite, and may that surface answer what the kite does?"""
    return key.partition(":")[2] in frame.answering


def doubtful(frame: Frame, tried: Tried, criteria: Criteria) -> bool:
    """May what a candidate gains be the controller's answer to gusts?"""
    little = tried.gain < criteria.clear_of_gusts or is_feedback(tried, criteria)
    return tried.model is not None and of_answering(frame, tried.key) and little


def is_feedback(tried: Tried, criteria: Criteria) -> bool:
    """Does a candidate gain hardly more than it would of the same flight, were it not there? The root of a gain is a size over its standard
    error, and the difference of two has a variance of 2."""
    return tried.under_null > 0 and (np.sqrt(max(tried.gain, 0.0)) - np.sqrt(tried.under_null)) / np.sqrt(2) < np.sqrt(criteria.in_gusts)


def with_gains_under_null(
    frame: Frame, here: FittedModel, tried: Sequence[Tried], criteria: Criteria, progress: Say = lambda text: None
) -> tuple[Tried, ...]:
    """What was tried, with what a controller makes of the effects of a surface where nothing is missing: asked of the one that gains most,
    of every surface that answers the kite, where that is clear of gusts and not far beyond them."""
    gains: dict[str, float] = {}
    clear = [t for t in tried if t.model is not None and of_answering(frame, t.key) and t.gain >= criteria.clear_of_gusts]
    for t in sorted(clear, key=lambda t: -t.gain):
        surface = t.key.partition(":")[2]
        if surface in gains:
            continue
        asked = t.gain < criteria.beyond_gusts and not any(f.closes for f in frame.flights)
        if asked:
            progress(f"flying again in other gusts, without {t.key}")
        gains[surface] = gain_under_null(frame, here, t) if asked else 0.0
    return tuple(replace(t, under_null=gains[t.key.partition(":")[2]]) if t in clear else t for t in tried)


def set_aside(frame: Frame, tried: Sequence[Tried], criteria: Criteria) -> tuple[Tried, ...]:
    """What was tried, without the fits of the doubtful."""
    return tuple(replace(t, outcome=SET_ASIDE, model=None) if doubtful(frame, t, criteria) else t for t in tried)


def beside_answers(
    frame: Frame, here: FittedModel, standing: Sequence[FittedModel], tried: Sequence[Tried], criteria: Criteria
) -> FittedModel | None:
    """The likeliest of the models that stand whose last effect is not doubtful, where it gains what an effect must gain in gusty air,
    alone and beside the likeliest of the doubtful: None where there is none. Where gusts only make a surface seem late, both gains add up;
    where it is late, what else looks like that has nothing left to gain beside it."""
    aside = [t for t in tried if doubtful(frame, t, criteria)]
    clear = [m for m in standing if m.keys[-1] not in {t.key for t in aside}]
    best = min(clear, key=lambda m: m.deviance, default=None)
    if best is None or here.deviance - best.deviance < criteria.in_gusts:
        return None
    first = max(aside, key=lambda t: t.gain, default=None)
    if first is None or first.gain < criteria.decisive:
        return best
    least = here.deviance - first.gain - criteria.in_gusts
    both = _both(frame, best, first)
    if both.deviance > least:  # a quick fit leaves levels as they are
        both = fit_on(frame, both)
    return best if both.deviance <= least else None


def _both(frame: Frame, best: FittedModel, other: Tried) -> FittedModel:
    """A model with a further candidate, from where that came alone."""
    return fit_added(frame, best, other.key, *other.start)
