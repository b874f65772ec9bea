"""A whole identification: from short horizons to the whole one, levels of processes and noise estimated along; one or several flights."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from awescli.estimation.coloured import coloured_information
from awescli.estimation.fit import fit_together
from awescli.estimation.fitted import Fit, JointFit, Share
from awescli.estimation.levels import opened, prior_deviance, relevelled
from awescli.estimation.levels_in_turn import (
    COARSE,
    LOOSE,
    TIGHT,
    UNCHANGED,
    OnIteration,
    at_near_nodes,
    fit_coarsely_first,
    fit_levels,
    fit_once,
    spaced_as,
)
from awescli.estimation.misfit import DIVERGED_COST, Misfit, NuisanceValues
from awescli.estimation.problem import EstimationProblem
from awescli.estimation.processes.base import Process
from awescli.notation.parameters import ParameterTable
from awescli.physics.disturbances import MOMENTS

MODEL_ERROR = "model_error"
WIDE = 0.5
"""Share of its prior's median at which model error is open at first: a poor guess of the parameters then follows the flight by its help."""
SLIGHT = 0.05
"""The same of whatever may be there, once the parameters are near."""
GUSTS = "gusts"
TURNING = ("roll_gusts", "pitch_yaw_gusts")
"""Gusts that turn a kite: there where gusts are."""
OPEN = (GUSTS, "drift", *TURNING)
"""Processes that are looked for once model error has shown what they are not."""
IN_GUSTS = (GUSTS, *TURNING, "line")
"""Processes that are there from the beginning, beside model error, where a fit is said to begin in gusts."""
SETTLED_ON = 120.0
"""[s] of a flight's train on which parameters and levels settle, at most, spread over the flight; the whole is fitted from there."""
LEVEL_ROUNDS = 4
"""Most often are levels fitted while parameters are held."""
OUTPUT_ERROR_ITERATIONS = 100
"""Most iterations of a fit without processes: a model that is far from the flight has a long valley before it."""
ROUNDS, LAST_ROUNDS = 16, 2
"""Most often are levels and parameters fitted in turn; on the whole of a long flight in the end. A noise that is a tenth of what was
declared is six rounds away; on the AP2's flight, where this was set, parameters that had moved at the wrong noise needed as many more."""


@dataclass(frozen=True)
class Flight:
    """One flight of a fit. label: its own parameters are called `dl@label` in the fit; the first flight of a fit needs none."""

    problem: EstimationProblem
    label: str = ""


def fit_flights(
    flights: Sequence[Flight], horizons: Sequence[float], *, per_flight: Sequence[str] = (), prior: bool = True,
    start: dict[str, float] | None = None, in_gusts: bool = False, on_iteration: OnIteration = lambda h, i, c: None,
) -> tuple[JointFit, tuple[EstimationProblem, ...]]:  # fmt: skip
    """Fit from short horizons to the whole one (a poor guess cannot follow five seconds), levels of processes and of noise along.

    per_flight: patterns of the parameters that every flight has for itself; start: name -> value to start from where that differs from
    the declared one; in_gusts: begin with gusts, those that turn the kite, and the line's length beside model error, on the whole horizon.
    Returns the fit and the problems with processes and noise as finally used.

    On a measured flight air, line and what the model does not say act together, under a controller that answers all of them. Model error
    alone, at its wide nodes, leaves quick motion to the noise; surfaces that answer gusts then count as surfaces that do nothing, and
    derivatives come out small.
    """
    problems = [f.problem for f in flights]
    if not prior:
        # without priors nothing keeps the wind record near what was recorded
        problems = [replace(p, names=tuple(n for n in p.names if n not in p.kite.record)) for p in problems]
    labels = [f.label for f in flights]
    declared = [p.simulator.kite.parameters.with_values(start or {}) for p in problems]
    few = [p.spread_out(SETTLED_ON) for p in problems]

    def settled(problems: Sequence[EstimationProblem]) -> tuple[JointFit, list[EstimationProblem]]:
        if not in_gusts:
            return _settled(problems, labels, declared, horizons, per_flight, prior, on_iteration)
        open_ = [p.with_processes(wide_open(p.processes)) for p in problems]
        return fit_coarsely_first(open_, labels, declared, per_flight, prior, ROUNDS, TIGHT, on_iteration)

    result, found = settled(few)
    if any(some is not p for some, p in zip(few, problems, strict=True)):
        if result.ended:
            whole = [replace(p.at_noise(s.factors), processes=s.processes) for p, s in zip(problems, found, strict=True)]
            owns = [recut(f, p.misfit(p.simulator.holding(f.parameters))) for f, p in zip(result.flights, whole, strict=True)]
            tables = [f.parameters for f in result.flights]
            result, found = fit_levels(whole, labels, tables, per_flight, prior, LAST_ROUNDS, TIGHT, on_iteration, owns)
        if not result.ended:
            # a model that is far from the flight: what a part of it says is no beginning for the rest
            result, found = settled(problems)
    return widened(result), tuple(found)


def _settled(
    problems: Sequence[EstimationProblem], labels: Sequence[str], declared: Sequence[ParameterTable], horizons: Sequence[float],
    per_flight: Sequence[str], prior: bool, on_iteration: OnIteration,
) -> tuple[JointFit, list[EstimationProblem]]:  # fmt: skip
    """Parameters and levels from short horizons to the whole one."""
    tables = declared
    owns: list[NuisanceValues | None] = [None] * len(problems)
    for horizon in horizons:
        short = [
            p.shorter(horizon, p.simulator.holding(t)).spread_out(SETTLED_ON).with_processes(opened(p.processes, (MODEL_ERROR,), WIDE))
            for p, t in zip(problems, tables, strict=True)
        ]
        began = None
        if horizon == horizons[0]:
            short, began = levels_first(short, labels, tables, per_flight, on_iteration)
        result, short = fit_levels(short, labels, tables, per_flight, prior, 2, LOOSE, on_iteration, began)
        tables = [f.parameters for f in result.flights]
        problems = [replace(p.at_noise(s.factors), processes=s.processes) for p, s in zip(problems, short, strict=True)]
        owns = [recut(f, p.misfit(p.simulator.holding(f.parameters))) for f, p in zip(result.flights, problems, strict=True)]
    if not horizons:
        wide = [p.with_processes(opened(p.processes, (MODEL_ERROR,), WIDE)) for p in problems]
        problems, first = levels_first(wide, labels, tables, per_flight, on_iteration)
        owns = [*first]
    problems, before = [p.with_processes(opened(p.processes, (MODEL_ERROR,), SLIGHT)) for p in problems], problems
    owns = [own and new.misfit().carried(own, old.misfit()) for new, old, own in zip(problems, before, owns, strict=True)]
    result, problems = fit_levels(problems, labels, tables, per_flight, prior, ROUNDS, TIGHT, on_iteration, owns)
    if horizons and not any(levels_of(p.processes) for p in problems):
        # without processes, which take up what a poor guess misses, a short horizon may lead astray from what counts in a long one
        straight, _ = fit_levels(problems, labels, declared, per_flight, prior, ROUNDS, TIGHT, on_iteration)
        result = min(result, straight, key=lambda r: r.solution.cost)
    looked = [_looked_for(p, f, OPEN) for p, f in zip(problems, result.flights, strict=True)] if result.ended else []
    if any(set(levels_of(new.processes)) - set(levels_of(p.processes)) for (new, _), p in zip(looked, problems, strict=False)):
        tables = [f.parameters for f in result.flights]
        problems = [p.with_processes(_closed(p.processes, (MODEL_ERROR,), SLIGHT)) if gusty(p) else p for p, _ in looked]
        owns = [new.misfit().carried(own, old.misfit()) for new, (old, own) in zip(problems, looked, strict=True)]
        result, problems = fit_coarsely_first(problems, labels, tables, per_flight, prior, ROUNDS, TIGHT, on_iteration, owns)
        if any(_may_turn(p) for p in problems):
            result, problems = _turned(result, problems, labels, per_flight, prior, on_iteration)
    return result, problems


def _may_turn(problem: EstimationProblem) -> bool:
    """Is a model error of moments left in gusty air, without all gusts that turn a kite?"""
    there, kinds = levels_of(problem.processes), {p.name: p for p in problem.processes}
    moments = any(g.name in there and set(g.axes) <= set(MOMENTS) for p in problem.processes if p.name == MODEL_ERROR for g in p.groups)
    return gusty(problem) and moments and any(g.level == 0 for name in TURNING if name in kinds for g in kinds[name].groups)


def _turning(problem: EstimationProblem) -> set[str]:
    """Groups of gusts that turn the kite and are there."""
    return {g.name for p in problem.processes if p.name in TURNING for g in p.groups if g.level > 0}


def _turned(
    result: JointFit, problems: list[EstimationProblem], labels: Sequence[str], per_flight: Sequence[str], prior: bool,
    on_iteration: OnIteration,
) -> tuple[JointFit, list[EstimationProblem]]:  # fmt: skip
    """A fit and its problems, or those with gusts that turn the kite in place of a model error of moments, where they are likelier. Looked
    for beside what an effect had left, they found no room; the model error that stayed for them was then "more than noise". Where they find
    none at nodes that are far apart either, that is all that is asked."""
    turned = [
        p.with_processes(opened(_closed(p.processes, (MODEL_ERROR,), SLIGHT), TURNING, 1.0)) if _may_turn(p) else p for p in problems
    ]
    coarse = [p.spaced(COARSE) for p in turned]
    owns = [q.misfit().carried(f.own, f.misfit) for q, f in zip(coarse, result.flights, strict=True)]
    tables = [f.parameters for f in result.flights]
    rough, there = fit_levels(coarse, labels, tables, per_flight, prior, ROUNDS, LOOSE, on_iteration, owns)
    if not rough.ended or all(_turning(q) <= _turning(p) for p, q in zip(problems, there, strict=True)):
        return result, problems
    near, tables, owns = at_near_nodes(turned, rough, there)
    other, found = fit_levels(near, labels, tables, per_flight, prior, ROUNDS, TIGHT, on_iteration, owns)
    now, then = (fit.deviance + sum(prior_deviance(p.processes) for p in those) for fit, those in ((result, problems), (other, found)))
    return (other, found) if other.ended and then < now - UNCHANGED else (result, problems)


def fit_output_error(
    flights: Sequence[Flight],
    horizons: Sequence[float],
    *,
    per_flight: Sequence[str] = (),
    prior: bool = True,
    on_iteration: OnIteration = lambda h, i, c: None,
) -> tuple[JointFit, tuple[EstimationProblem, ...]]:
    """`fit_flights` with starts and what is certain for nuisances, the noise as declared (output error, Jategaonkar ch. 4): where model
    error is so large that it leaves the parameters nothing to say, they are asked for what predicts, coloured residuals and all."""
    problems = [f.problem for f in flights]
    if not prior:
        problems = [replace(p, names=tuple(n for n in p.names if n not in p.kite.record)) for p in problems]
    problems = [p.with_processes([q if q.certain else q.at(dict.fromkeys(q.levels, 0.0)) for q in p.processes]) for p in problems]
    labels, tables, none = [f.label for f in flights], [p.simulator.kite.parameters for p in problems], [None] * len(problems)
    for horizon in horizons:
        short = [p.shorter(horizon, p.simulator.holding(t)).spread_out(SETTLED_ON) for p, t in zip(problems, tables, strict=True)]
        result = fit_once(short, labels, tables, none, per_flight, prior, LOOSE, on_iteration)
        tables = [f.parameters for f in result.flights]
    result = fit_once(problems, labels, tables, none, per_flight, prior, TIGHT, on_iteration, OUTPUT_ERROR_ITERATIONS)
    return widened(result), tuple(problems)


def wide_open(processes: Sequence[Process]) -> tuple[Process, ...]:
    """Processes with all that there may be in gusts."""
    return opened(opened(processes, (MODEL_ERROR,), WIDE), IN_GUSTS, 1.0)


def levels_first(
    problems: Sequence[EstimationProblem],
    labels: Sequence[str],
    tables: Sequence[ParameterTable],
    per_flight: Sequence[str],
    on_iteration: OnIteration,
) -> tuple[list[EstimationProblem], list[NuisanceValues]]:
    """(The problems, nuisances) with levels of processes and noise as the flights show them while the parameters stay as declared: a
    flight that the model follows badly would otherwise drive the parameters far away before its model error is as open as it must be."""
    held = [replace(p, names=()) for p in problems]
    found, held = fit_levels(held, labels, tables, per_flight, False, LEVEL_ROUNDS, LOOSE, on_iteration)
    return [replace(h, names=p.names) for h, p in zip(held, problems, strict=True)], [f.own for f in found.flights]


def recut(fit: Fit, misfit: Misfit) -> NuisanceValues:
    """The nuisances of a fit in other segments of the same flight, those of `misfit`: starts where segments begin together, else those
    that the observations hold; paths as they ran."""
    dt, own, found = fit.misfit.observed.segments.dt, misfit.own(), fit.misfit.labels
    theirs = {int(n): k for k, n in enumerate(fit.misfit.observed.segments.first) if fit.flies[k]}
    for k, first in enumerate(misfit.observed.segments.first):
        if int(first) in theirs:
            own.starts[k] = fit.own.starts[theirs[int(first)]]
    times, at = fit.misfit.begins[:, None] + fit.misfit.nodes * dt, misfit.begins[:, None] + misfit.nodes * dt
    for w, label in enumerate(misfit.labels):
        if label in found:
            own.path[..., w] = np.interp(at, times.ravel(), fit.own.path[..., found.index(label)].ravel())
    x, fresh = fit.parameters.vector(misfit.names), misfit.own()
    (cost, whole), (plain, whole_plain) = misfit.costs(x, own), misfit.costs(x, fresh)
    lost = (whole_plain & ~whole) | ((whole_plain >= whole) & (plain < cost))
    own.starts[lost], own.path[lost] = fresh.starts[lost], fresh.path[lost]
    return own


def unaided(problem: EstimationProblem, fitted: Fit) -> float:
    """Chi-square per degree of freedom of the fitted loops with nothing but starts, and what is certain beside a model, to help it: output
    error. A model that leaves the flight without that help is as far off as a diverged one."""
    certain = [p if p.certain else p.at(dict.fromkeys(p.levels, 0.0)) for p in problem.processes]
    misfit = replace(problem.misfit(fitted.misfit.simulator), names=(), processes=tuple(certain))
    own = misfit.carried(fitted.own, fitted.misfit)
    share = Share(misfit, fitted.parameters, fitted.parameters, (), own)
    alone = fit_together([share], prior=False, tolerance=LOOSE)
    dof = max(float(alone.flights[0].information.dof.sum()), 1.0)
    chi2 = float(alone.chi2 * dof / max(dof - len(fitted.names), 1.0))
    return chi2 if alone.flights[0].flies.all() and chi2 >= 0 else DIVERGED_COST


def widened(result: JointFit) -> JointFit:
    """The fit with what coloured residuals add to its covariance."""
    C = result.covariance
    grown = C.copy()
    for fit, place in zip(result.flights, result.places, strict=True):
        grown += C[:, place] @ coloured_information(fit) @ C[place]
    return result.with_covariance(grown)


def levels_of(processes: Sequence[Process]) -> dict[str, float]:
    """Name of a group that is there -> its level."""
    return {g.name: g.level for p in processes for g in p.groups if g.level > 0}


def gusty(flight: EstimationProblem | Misfit) -> bool:
    """Are there gusts in it?"""
    return any(g.level > 0 for p in flight.processes if p.name == GUSTS for g in p.groups)


def _closed(processes: Sequence[Process], kinds: Sequence[str], share: float) -> tuple[Process, ...]:
    """The processes with those of some kinds at a share of their prior's median at most: what they stood for may have been found since.
    What was not opens them again."""
    return tuple(p.at({g.name: min(g.level, share * g.of_level.median) for g in p.groups}) if p.name in kinds else p for p in processes)


def _looked_for(problem: EstimationProblem, fit: Fit, kinds: Sequence[str]) -> tuple[EstimationProblem, NuisanceValues]:
    """The problem with what of some kinds of processes the flight shows at a fit, at nodes as far apart as they are, and the nuisances to
    go on from. Gusts that turn a kite are there where gusts are: in calm air, what rolls it against its model is no gust."""
    if not problem.processes or not len(fit.counted):
        return problem, fit.own
    wide = fit.misfit.with_processes(problem.with_processes(opened(problem.processes, kinds, SLIGHT)).spaced(COARSE).processes)
    own = wide.carried(fit.own, fit.misfit)
    gram = wide.linear(fit.parameters.vector(fit.names), own, parameters=()).gram
    processes, _ = relevelled(wide, gram, own, fit.counted)
    if not gusty(wide.with_processes(processes)):
        processes = _closed(processes, TURNING, 0.0)
    new = problem.with_processes(spaced_as(problem, processes))
    return new, new.misfit(fit.misfit.simulator).carried(own, wide)


def fit_in_stages(problem: EstimationProblem, horizons: Sequence[float], **how: Any) -> tuple[Fit, EstimationProblem]:
    """`fit_flights` of one flight."""
    result, problems = fit_flights([Flight(problem)], horizons, **how)
    return result.flights[0], problems[0]
