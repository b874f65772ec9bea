"""What a flight without a verdict says of its sensors and actuators: all their errors at once, beside gusts and model error.

A measured flight may be too far from its model for any one effect to explain the rest. Yet no gust delays a position or turns a heading,
and model error does not move with a surface: with both of them open, errors of instruments stand out. One alone would take what belongs
to the others; all together they are one fit, in which each has its size and interval. They are no verdict: nothing says that the model errs
because of them. What reads the line is not asked: what a model of the line lacks passes for it (its weight for a load cell that reads high,
its length for a clock).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.levels_in_turn import COARSE
from awescli.flightlog.log import FlightLog
from awescli.flightlog.reconstruction.result import clearly_matters
from awescli.physics.effects.base import Effect
from awescli.physics.effects.rate_feedback import TURNS
from awescli.physics.kite import make_effect
from awescli.tracing.criteria import CRITERIA, Criteria
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.frame import Frame
from awescli.tracing.lateness import lateness
from awescli.tracing.models import Say, fit_all_added, fit_in_gusts
from awescli.tracing.shapes import plausible

LOOKED_AT = 60.0
"""[s] of train that are looked at, spread over the flight: more tells no more than the model's own errors allow."""
BEGUN = 0.05
"""[s] from which a delay is fitted, for it is late by something ..."""
LATE = 0.15
"""... and by equation error beyond which it is also fitted to set-points that were given so much later: its form holds for short delays.
Set, as `lateness.BAND` is, on delays put into the records of UMN's Thor and Ampyx' AP2."""
TOLD = 0.5
"""Of the size that matters, standard deviation beyond which the flight does not tell an error."""


@dataclass(frozen=True)
class InstrumentError:
    """key: of the effect; parameter: its short name; null: where there is no error; size, std: in `unit` (SI); matters: size of an error
    from which it changes what a model learns; plausible: not at the end of its range; rivals: effects that do nearly the same."""

    key: str
    parameter: str
    null: float
    size: float
    std: float
    unit: str
    matters: float
    plausible: bool = True
    rivals: tuple[str, ...] = ()

    @property
    def error(self) -> float:
        """What it is away from none."""
        return self.size - self.null

    @property
    def found(self) -> bool:
        """Clearly there, and of a size that matters."""
        return self.plausible and clearly_matters(self.error, self.std, self.matters)


def instrument_errors(
    frame: Frame, start: Mapping[str, float], keys: Sequence[str], criteria: Criteria = CRITERIA, progress: Say = lambda text: None
) -> tuple[InstrumentError, ...]:
    """The errors of all instruments of the plan's flight among the effects `keys`, the clearest first, from parameter values `start`: those
    that it tells. None where the model with all of them does not follow it."""
    part = replace(frame, flights=frame.flights[:1], per_flight=(), seconds=LOOKED_AT, spacing=COARSE)
    every = [e for e in (make_effect(key, frame.declared) for key in keys) if e.matters]
    # what does not turn the kite does not say when it answers
    every = [e for e in every if e.instrument != "actuator" or e.target in TURNS]
    # of those that do nearly the same one stands for all: of a lag put into a measured record a delay said more than the lag
    effects = [e for i, e in enumerate(every) if not any(_alike(e, later) for later in every[i + 1 :])]
    if not effects:
        return ()
    progress("fitting the declared model in gusts")
    base = fit_in_gusts(part, start)
    progress("fitting the errors of all instruments")
    part, earlier, model = _all_fitted(part, base, effects)
    if not _follows(model, criteria):
        return ()
    found = [
        _error(e, name, model, earlier.get(e.target, 0.0), [o.key for o in every if _alike(o, e) and o is not e], criteria)
        for e in effects for name in e.matters
    ]  # fmt: skip
    return tuple(sorted((e for e in found if e.found or e.std < TOLD * e.matters), key=lambda e: -abs(e.error) / e.std))


def _alike(a: Effect, b: Effect) -> bool:
    """Do two effects do nearly the same to one instrument?"""
    return (a.instrument, a.target, *a.matters) == (b.instrument, b.target, *b.matters)


def _all_fitted(part: Frame, base: FittedModel, effects: Sequence[Effect]) -> tuple[Frame, dict[str, float], FittedModel]:
    """(the part of the flight, its record given later by so much [s] of each surface that is very late; the model with all errors)."""
    keys, log = [e.key for e in effects], part.flights[0].log
    null = {f"{e.key}.{p.name}": p.value for e in effects for p in e.parameters if p.name in e.matters}
    actuators = [e for e in effects if e.instrument == "actuator"]
    begun = null | {f"{e.key}.{name}": BEGUN for e in actuators for name in e.matters}
    model = fit_all_added(part, base, keys, begun)
    far = {e.target: found - BEGUN for e in actuators if (found := lateness(log, e.target)) > LATE}
    if far:
        later = replace(part, flights=(replace(part.flights[0], log=given_later(log, far)),))
        other = fit_all_added(later, base, keys, begun)
        if other.deviance < model.deviance:
            return later, far, other
    return part, {}, model


def given_later(log: FlightLog, shifts: Mapping[str, float]) -> FlightLog:
    """The log with set-points as if they had been given so many seconds later, by surface."""
    moved = {s: np.interp(log.time - late, log.time, log[s]) for s, late in shifts.items()}
    return replace(log, inputs={**log.inputs, **moved})


def _follows(model: FittedModel, criteria: Criteria) -> bool:
    """Does a model come to its minimum, lose no more segments than a null model may, and follow unseen loops? (Of a segment that it hardly
    follows the chi-square may come out negative.)"""
    return model.fit.ended and model.flies >= (1 - criteria.lost_share) * model.segments and 0 <= model.chi2 <= criteria.follows


def _error(
    effect: Effect, name: str, model: FittedModel, earlier: float, rivals: Sequence[str], criteria: Criteria
) -> InstrumentError:
    """The size of an error in the model with all of them. earlier: [s] by which the record was given later before the fit."""
    row, full = next(p for p in effect.parameters if p.name == name), f"{effect.key}.{name}"
    place, dt = model.fit.names.index(full), model.problems[0].log.dt
    # between approximate models evidence is overconfident; and no time is known better than the samples
    std = np.sqrt(criteria.temperature * model.fit.covariance[place, place])
    std = np.hypot(std, dt / np.sqrt(12)) if row.unit == "s" else std
    size, sound = model.table[full].value + earlier, plausible(model, effect.key)
    return InstrumentError(effect.key, name, row.value, float(size), float(std), row.unit, effect.matters[name], sound, tuple(rivals))
