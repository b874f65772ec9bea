"""Models that compete: the declared kite with some effects added, fitted to the same flights with levels of processes of its own."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from awescli.estimation.fitted import Fit
from awescli.estimation.levels_in_turn import LOOSE, fit_coarsely_first, fit_levels
from awescli.estimation.problem import EstimationProblem
from awescli.estimation.processes.base import Process
from awescli.estimation.staged_fit import MODEL_ERROR, ROUNDS, SETTLED_ON, SLIGHT, Flight, fit_flights, wide_open
from awescli.notation.parameters import ParameterTable
from awescli.physics.kite import make_effect
from awescli.tracing.fitted_model import FittedModel, bounded
from awescli.tracing.frame import Frame, Levels, unbounded

Say = Callable[[str], None]
"""Tells the user what is being done."""
QUICK = (2, 2.0)
"""Rounds of levels and tolerance [deviance] of a fit that tells candidates apart, with the slope of the model before (`laplace`) ..."""
WHOLE = (5, 0.2)
"""... and of one that is fitted to the end."""
TOLD_APART = 0.05
"""[s] between nodes of gusts where candidates are told apart. With 0.1 s, which do where levels are looked for, quick gusts looked like a
rudder that is late, worth 198 and 318: more than the wind shear and the stall that were there (JSBSim)."""
NOWHERE = 100.0
"""Times what a model leaves from which on a fit would only come back from afar: a rudder that had no rate limit, fitted from one of half a
degree a second, began at 1800 times and took 20 steps back to where it had been."""


def fit_null(
    frame: Frame, start: Mapping[str, float], horizons: Sequence[float], levels: Sequence[Levels] = (),
    on_iteration: Callable = lambda h, i, c: None,
) -> FittedModel:  # fmt: skip
    """The declared model, from parameter values `start`. levels: of every flight, as an identification left them: the fit then begins where
    that one ended; without, it begins with short horizons. Where it is likelier without model error it is that: beside one that leads
    parameters astray every candidate would seem to gain what it gains itself without."""
    model = _fit_null(frame, start, horizons, levels, on_iteration)
    bare = fit_bare(frame, model) if model.rest else model
    # a model that does not follow is likelier by what it loses
    return fit_on(frame, bare) if bare.deviance < model.deviance and bare.fit.ended and bare.flies >= model.flies else model


def _fit_null(
    frame: Frame, start: Mapping[str, float], horizons: Sequence[float], levels: Sequence[Levels], on_iteration: Callable
) -> FittedModel:
    problems = frame.problems(())
    if not levels:
        flights = [Flight(p, f.label) for p, f in zip(problems, frame.flights, strict=True)]
        found = fit_flights(flights, horizons, per_flight=frame.per_flight, start=dict(start), on_iteration=on_iteration)
        return FittedModel.of((), (), *found)
    problems = [p.at(left.processes, left.memories, left.factors) for p, left in zip(problems, levels, strict=True)]
    tables = [p.simulator.kite.parameters.with_values(start) for p in problems]
    rounds, tolerance = WHOLE
    return FittedModel.of((), (), *fit_levels(problems, frame.labels, tables, frame.per_flight, True, rounds, tolerance, on_iteration))


def fit_added(
    frame: Frame, base: FittedModel, key: str, strengths: Mapping[str, float], shapes: Mapping[str, float], alone: bool = True,
    reach: float = np.inf,
) -> FittedModel:  # fmt: skip
    """The base model with one effect added. strengths: full name -> value to start from, fitted; shapes: full name -> value, held; alone:
    the fit begins with next to no model error, so that the effect must follow the flight by itself. Raises OutOfReach where it comes
    nowhere near a deviance of `reach` on train."""
    free = tuple(dict.fromkeys((*base.strengths, *strengths)))
    return _fitted(frame, base, (*base.keys, key), free, {**strengths, **shapes}, QUICK, alone, reach=reach)


def fit_in_gusts(frame: Frame, start: Mapping[str, float]) -> FittedModel:
    """The declared model from parameter values `start`, begun with all that there may be in gusts beside its model error."""
    problems = [p.with_processes(wide_open(p.processes)) for p in frame.problems(())]
    tables = [p.simulator.kite.parameters.with_values(start) for p in problems]
    return FittedModel.of((), (), *fit_levels(problems, frame.labels, tables, frame.per_flight, True, ROUNDS, LOOSE))


def fit_all_added(frame: Frame, base: FittedModel, keys: Sequence[str], strengths: Mapping[str, float]) -> FittedModel:
    """The base model with several effects added at once, beside its model error, with what coloured residuals add to its covariance.
    strengths: as in `fit_added`."""
    return _fitted(frame, base, (*base.keys, *keys), (*base.strengths, *strengths), strengths, QUICK).widened()


def fit_on(
    frame: Frame, model: FittedModel, values: Mapping[str, float] | None = None, free: Sequence[str] = (), reach: float = np.inf,
    how: tuple[int, float] = WHOLE,
) -> FittedModel:  # fmt: skip
    """The same model fitted to the end (how: or no further than tells candidates apart), from other `values`, with further strengths free;
    reach: as in `fit_added`."""
    return _fitted(frame, model, model.keys, tuple(dict.fromkeys((*model.strengths, *free))), dict(values or {}), how, reach=reach)


def part_of(frame: Frame) -> Frame:
    """The frame with no more than what tells candidates apart: of long flights a part, of gusts every twentieth of a second."""
    return replace(frame, seconds=SETTLED_ON, spacing=TOLD_APART)


def fit_on_part(frame: Frame, model: FittedModel) -> tuple[Frame, FittedModel]:
    """(The frame, the model) with no more than what tells candidates apart, where that is less."""
    part = part_of(frame)
    there = [p.with_processes([q for q in p.processes if any(g.level > 0 for g in q.groups)]) for p in model.problems]
    less = any(p.spread_out(part.seconds).spaced(part.spacing) is not p for p in there)
    return (part, _fitted(part, model, model.keys, model.strengths, {}, WHOLE)) if less else (frame, model)


def fit_held(frame: Frame, model: FittedModel, values: Mapping[str, float]) -> FittedModel:
    """The same model fitted to the end, some of its strengths held at `values`."""
    return _fitted(frame, model, model.keys, tuple(n for n in model.strengths if n not in values), dict(values), WHOLE)


def fit_without(frame: Frame, model: FittedModel, gone: Sequence[str]) -> FittedModel:
    """The model without some of its effects."""
    kept = [k for k in model.keys if k not in gone]
    strengths = tuple(n for n in model.strengths if not any(n.startswith(f"{k}.") for k in gone))
    return _fitted(frame, model, kept, strengths, {}, WHOLE)


def fit_swapped(frame: Frame, model: FittedModel, out: str, other: FittedModel) -> FittedModel:
    """The model with the last effect of `other` instead of its effect `out`."""
    new = other.keys[-1]
    values = {p.name: other.table[p.name].value for p in make_effect(new, frame.declared).rows()}
    strengths = {n: values[n] for n in other.strengths if n in values}
    return fit_instead(frame, model, out, new, strengths, values)


def fit_instead(
    frame: Frame, model: FittedModel, out: str, new: str, strengths: Mapping[str, float], shapes: Mapping[str, float]
) -> FittedModel:
    """The model with an effect `new` instead of its effect `out`; strengths, shapes as in `fit_added`."""
    keys = tuple(new if k == out else k for k in model.keys)
    kept = tuple(n for n in model.strengths if not n.startswith(f"{out}."))
    return _fitted(frame, model, keys, (*kept, *strengths), {**shapes, **strengths}, WHOLE, alone=True)


def fit_bare(frame: Frame, model: FittedModel) -> FittedModel:
    """The model without model error: what it is worth when nothing helps it. The noise stays as model error left it: it would grow until
    what is missing looked like noise."""
    return _fitted_as_known(frame, model, [_slight(p.processes, share=0.0) for p in model.problems])


def _fitted_as_known(frame: Frame, model: FittedModel, processes: Sequence[Sequence[Process]]) -> FittedModel:
    """The model fitted anew with other processes of every flight, the noise as it is."""
    bare = [p.with_processes(others) for p, others in zip(model.problems, processes, strict=True)]
    owns = [p.misfit().carried(f.own, f.misfit) for p, f in zip(bare, model.fit.flights, strict=True)]
    tables = [f.parameters for f in model.fit.flights]
    found = fit_coarsely_first(bare, frame.labels, tables, frame.per_flight, True, *WHOLE, owns=owns, noise=False)
    return FittedModel.of(model.keys, model.strengths, *found, model.judged)


def fit_apart(frame: Frame, model: FittedModel) -> FittedModel:
    """The model fitted anew with strengths that every flight has for itself."""
    return _fitted(replace(frame, per_flight=(*frame.per_flight, *model.strengths)), model, model.keys, model.strengths, {}, WHOLE)


def fit_beyond(frame: Frame, model: FittedModel, names: Sequence[str]) -> FittedModel:
    """The model fitted anew with parameters or strengths `names` free to leave their bounds; their priors stay."""
    return _fitted(frame, model, model.keys, model.strengths, {}, WHOLE, beyond=names)


def begins_nowhere(model: FittedModel, name: str, value: float) -> bool:
    """Is a model so far from the flights with another value of one of its parameters that no fit should begin there?"""

    def cost(p: EstimationProblem, f: Fit, table: ParameterTable) -> float:
        return float(p.misfit(p.simulator.holding(table)).costs(table.vector(p.names), f.own)[0].sum())

    each = list(zip(model.problems, model.fit.flights, strict=True))
    there = sum(cost(p, f, f.parameters.with_values({name: value})) for p, f in each)
    return there > NOWHERE * sum(cost(p, f, f.parameters) for p, f in each)


def promised_beyond(model: FittedModel, names: Sequence[str]) -> float:
    """Deviance that `fit_beyond` would gain, to first order."""
    s, held = model.fit.solution, set(bounded(model.fit)) - set(names)
    free = [i for i, name in enumerate(model.fit.names) if name not in held]
    b = s.at.b[free]
    return float(b @ np.linalg.solve(s.H[np.ix_(free, free)], b))


def fit_without_process(frame: Frame, model: FittedModel, kind: str) -> FittedModel:
    """The model without processes of `kind`, the noise as it is."""
    return _fitted_as_known(frame, model, [_gone(p.processes, kind) for p in model.problems])


def _fitted(
    frame: Frame, base: FittedModel, keys: Sequence[str], strengths: Sequence[str], values: Mapping[str, float], how: tuple[int, float],
    alone: bool = False, beyond: Sequence[str] = (), reach: float = np.inf,
) -> FittedModel:  # fmt: skip
    rounds, tolerance = how
    problems, tables, owns, slopes = [], [], [], []
    for raw, before, fitted in zip(frame.problems(keys), base.problems, base.fit.flights, strict=True):
        prior = raw.prior.with_rows(unbounded(raw.prior[n]) for n in beyond if n in raw.prior)
        simulator = raw.simulator.holding(prior)
        table = simulator.kite.parameters
        table = table.with_values({**{n: fitted.parameters[n].value for n in table if n in fitted.parameters}, **values})
        table = table.with_rows(replace(table[n], free=True) for n in strengths)
        prior = prior.with_rows(replace(prior[n], free=True) for n in strengths)
        names = tuple(n for n in dict.fromkeys((*before.names, *strengths)) if n in strengths or n not in base.strengths)
        processes = _slight(before.processes) if alone else before.processes
        processes = tuple(replace(p, spacing=q.spacing) for p, q in zip(processes, raw.processes, strict=True))
        problem = replace(raw.with_factors(before.factors), simulator=simulator, processes=processes, names=names, prior=prior)
        problems.append(problem)
        tables.append(table)
        owns.append(problem.misfit().carried(fitted.own, fitted.misfit))
        was = dict(zip(fitted.names, fitted.slope, strict=True))
        share = len(problem.fitted.segments) / len(fitted.misfit.observed.segments)
        slopes.append(share * np.array([was.get(n, 0.0) for n in names]) if how is QUICK else None)
    found = fit_levels(problems, frame.labels, tables, frame.per_flight, True, rounds, tolerance, owns=owns, slopes=slopes, reach=reach)
    return FittedModel.of(keys, strengths, *found, base.judged)


def _gone(processes: Sequence[Process], kind: str) -> tuple[Process, ...]:
    """The processes with those of a kind at zero."""
    return tuple(p.at(dict.fromkeys(p.levels, 0.0)) if p.name == kind else p for p in processes)


def _slight(processes: Sequence[Process], share: float = SLIGHT) -> tuple[Process, ...]:
    """The processes with a `share` of model error at most, and those that are certain as they are known beforehand: a new model must
    follow the flight by itself, and what helped the one before is not what helps it. What it does not say opens again."""

    def begun(p: Process) -> dict[str, float]:
        if p.name == MODEL_ERROR:
            return {g.name: min(g.level, share * g.of_level.median) for g in p.groups}
        return {g.name: g.of_level.median for g in p.groups} if p.certain else p.levels

    return tuple(p.at(begun(p)) for p in processes)
