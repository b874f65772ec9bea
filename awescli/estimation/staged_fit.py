"""A whole identification: from short horizons to the whole one, levels of processes and noise estimated along; one or several flights."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from awescli.estimation.coloured import coloured_information
from awescli.estimation.fit import Fit, JointFit, Share, fit_together
from awescli.estimation.levels import noise_factors, opened, prior_deviance, relevelled
from awescli.estimation.misfit import DIVERGED_COST, Misfit, NuisanceValues
from awescli.estimation.problem import EstimationProblem
from awescli.estimation.processes.base import Group, Process
from awescli.notation.parameters import ParameterTable
from awescli.physics.disturbances import MOMENTS

MODEL_ERROR = "model_error"
WIDE = 0.5
"""Share of its prior's median at which model error is open at first: a poor guess of the parameters then follows the flight by its help."""
COARSE = 0.1
"""[s] between nodes while processes are only looked for."""
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
LOOSE, TIGHT = 2.0, 0.1
"""What a fit need not gain any more (chi-square) while levels still change, and in the end."""
FEW, MANY = 2, 8
"""Probes of a look at the log determinant of the nuisances, while levels still change and in the end."""
LOST = 2
"""Fits in a row that do not come to their minimum, after which levels are not asked any more: they are those of a model that is nowhere."""
UNCHANGED = 2.0
"""Deviance that new levels must gain to be worth another fit."""
OFF = 0.03
"""A noise whose factor is within 1 +- this is as declared."""
AT_ONCE, SMALLEST, LARGEST = 1.5, 0.1, 5.0
"""A noise changes by at most the first factor in a round, and stays between the others in all."""
OnIteration = Callable[[float, int, float], None]
"""horizon [s], iteration, cost"""


@dataclass(frozen=True)
class Flight:
    """One flight of a fit. label: its own parameters are called `dl@label` in the fit; the first flight of a fit needs none."""

    problem: EstimationProblem
    label: str = ""


def own_names(problem: EstimationProblem, patterns: Sequence[str]) -> tuple[str, ...]:
    """Fitted parameters that belong to the flight and not to the kite: those that a pattern names, and the errors of its wind record."""
    return tuple(n for n in problem.names if n in problem.kite.record or any(fnmatchcase(n, p) for p in patterns))


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
    near, tables, owns = _at_near_nodes(turned, rough, there)
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
        result = _fitted(short, labels, tables, none, per_flight, prior, LOOSE, on_iteration)
        tables = [f.parameters for f in result.flights]
    result = _fitted(problems, labels, tables, none, per_flight, prior, TIGHT, on_iteration, OUTPUT_ERROR_ITERATIONS)
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
    new = problem.with_processes(_spaced_as(problem, processes))
    return new, new.misfit(fit.misfit.simulator).carried(own, wide)


def fit_levels(
    problems: Sequence[EstimationProblem], labels: Sequence[str], tables: Sequence[ParameterTable], per_flight: Sequence[str], prior: bool,
    rounds: int, tolerance: float, on_iteration: OnIteration = lambda h, i, c: None, owns: Sequence[NuisanceValues | None] | None = None,
    noise: bool = True, slopes: Sequence[np.ndarray | None] | None = None, reach: float = np.inf,
) -> tuple[JointFit, list[EstimationProblem]]:  # fmt: skip
    """Fit parameters and levels in turn until neither moves, at most `rounds` times; the last fit has the levels that are returned. Ends
    where fits do not come to their minimum (`JointFit.ended`). Raises OutOfReach where that comes nowhere near a deviance of `reach`
    with levels that were estimated.

    tables: parameters to start from; owns: nuisances to begin from; noise: estimate the white noise too; slopes: as of `Share`; others as
    `fit_flights`.
    """
    known: Sequence[NuisanceValues | None] = owns or [None] * len(problems)
    slopes = slopes or [None] * len(problems)

    def fitted(tolerance: float, reach: float = np.inf) -> JointFit:
        return _fitted(problems, labels, tables, known, per_flight, prior, tolerance, on_iteration, slopes=slopes, reach=reach)

    result, lost = fitted(max(tolerance, LOOSE)), 0
    risen: list[set[str]] = [set() for _ in problems]
    for _ in range(rounds - 1):
        lost = 0 if result.ended else lost + 1
        if lost == LOST:
            return result, list(problems)
        moved = [_relevelled(p, f, noise, r) for p, f, r in zip(problems, result.flights, risen, strict=True)]
        if all(gain < UNCHANGED for _, _, gain in moved):
            break
        problems, known = [problem for problem, _, _ in moved], [own for _, own, _ in moved]
        tables = [f.parameters for f in result.flights]
        result = fitted(max(tolerance, LOOSE), reach)
    if tolerance < LOOSE:
        tables, known = [f.parameters for f in result.flights], [f.own for f in result.flights]
        result = fitted(tolerance, reach)
    return result, list(problems)


def fit_coarsely_first(
    problems: Sequence[EstimationProblem], labels: Sequence[str], tables: Sequence[ParameterTable], per_flight: Sequence[str], prior: bool,
    rounds: int, tolerance: float, on_iteration: OnIteration = lambda h, i, c: None, owns: Sequence[NuisanceValues | None] | None = None,
    noise: bool = True,
) -> tuple[JointFit, list[EstimationProblem]]:  # fmt: skip
    """`fit_levels`, from where parameters and levels settle at nodes of processes that are far apart: between nodes as close as those of
    gusts are, each step takes several times as long."""
    how = {"per_flight": per_flight, "prior": prior, "rounds": rounds, "on_iteration": on_iteration, "noise": noise}
    begun = owns or [None] * len(problems)
    if any(g.level > 0 and p.spacing < COARSE for problem in problems for p in problem.processes for g in p.groups):
        coarse = [p.spaced(COARSE) for p in problems]
        at = [own and new.misfit().carried(own, p.misfit()) for new, p, own in zip(coarse, problems, begun, strict=True)]
        rough, found = fit_levels(coarse, labels, tables, tolerance=LOOSE, owns=at, **how)
        if rough.ended:
            problems, tables, begun = _at_near_nodes(problems, rough, found)
    return fit_levels(problems, labels, tables, tolerance=tolerance, owns=begun, **how)


def _at_near_nodes(
    problems: Sequence[EstimationProblem], rough: JointFit, found: Sequence[EstimationProblem]
) -> tuple[list[EstimationProblem], list[ParameterTable], list[NuisanceValues]]:
    """(Problems, parameters, nuisances) to go on from at nodes as close as those of some problems, where a fit at nodes that are far apart
    has ended, with the levels that it found."""
    near = [p.at_noise(c.factors).with_processes(_spaced_as(p, c.processes)) for p, c in zip(problems, found, strict=True)]
    owns = [p.misfit().carried(f.own, c.misfit()) for p, f, c in zip(near, rough.flights, found, strict=True)]
    return near, [f.parameters for f in rough.flights], owns


def _spaced_as(problem: EstimationProblem, processes: Sequence[Process]) -> list[Process]:
    """The processes with nodes as far apart as those of a problem are."""
    return [replace(p, spacing=own.spacing) for p, own in zip(processes, problem.processes, strict=True)]


def _fitted(
    problems: Sequence[EstimationProblem], labels: Sequence[str], tables: Sequence[ParameterTable], owns: Sequence[NuisanceValues | None],
    per_flight: Sequence[str], prior: bool, tolerance: float, on_iteration: OnIteration, iterations: int = 30,
    slopes: Sequence[np.ndarray | None] | None = None, reach: float = np.inf,
) -> JointFit:  # fmt: skip
    slopes = slopes or [None] * len(problems)
    each = zip(problems, labels, tables, owns, slopes, strict=True)
    shares = [replace(_share(problem, label, table, own, per_flight), slope=t) for problem, label, table, own, t in each]
    length = max(p.horizon for p in problems)
    how = {"prior": prior, "tolerance": tolerance, "iterations": iterations, "probes": FEW if tolerance >= LOOSE else MANY, "reach": reach}
    return fit_together(shares, **how, on_iteration=lambda i, c: on_iteration(length, i, c))


def _relevelled(problem: EstimationProblem, fit: Fit, noise: bool, risen: set[str]) -> tuple[EstimationProblem, NuisanceValues, float]:
    """The problem with the likeliest levels and noise at a fit, the nuisances to go on from, and the deviance that the levels gain (that
    of a noise that is off is not counted, and enough). risen: groups whose level has risen in a round; those that rise now are added."""
    if not len(fit.counted) or not problem.processes:
        return problem, fit.own, 0.0
    processes, gain = relevelled(fit.misfit, fit.gram, fit.own, fit.counted)
    factors = noise_factors(fit) if noise else {}
    off = {n: g for n, f in factors.items() if abs((g := _trusted(problem.factors.get(n, 1.0), f)) - 1) > OFF}
    before, after = _noises(problem.processes), _noises(processes)
    risen |= {name for name, noise in after.items() if noise > before.get(name, 0.0)}
    problem = problem.with_processes(_hurried(problem.processes, processes, risen))
    new = problem.with_factors(off) if off else problem
    return new, new.misfit(fit.misfit.simulator).carried(fit.own, fit.misfit), np.inf if off else gain


def _noise(g: Group) -> float:
    """Strength of the white noise that drives a group, in its unit over the root of a second: what a flight shows of level and memory
    together."""
    return float(g.level * np.sqrt(2 / g.memory))


def _noises(processes: Sequence[Process]) -> dict[str, float]:
    """Name of a group that is there -> strength of the noise that drives it."""
    return {g.name: _noise(g) for p in processes for g in p.groups if g.level > 0}


def _trusted(before: float, factor: float) -> float:
    """A further factor on a noise, in small steps and never far from what is declared: what is much more than noise is not noise, and a
    model that is still far from the flight would be excused by it."""
    return float(np.clip(before * np.clip(factor, 1 / AT_ONCE, AT_ONCE), SMALLEST, LARGEST)) / before


def _hurried(before: Sequence[Process], after: Sequence[Process], risen: set[str]) -> tuple[Process, ...]:
    """Levels that fall fall twice as far (in logarithms): with the parameters held they would come down slowly, fit after fit, as the
    parameters give up what they had left to the process. Not one that has risen before: it is near its value, and would swing about it."""
    was = _noises(before)

    def level(g: Group) -> float:
        share = _noise(g) / was.get(g.name, _noise(g))
        return g.level if g.name in risen else g.level * min(share, 1.0)

    return tuple(p.at({g.name: level(g) for g in p.groups if g.level > 0}) for p in after)


def _share(problem: EstimationProblem, label: str, table: ParameterTable, own: NuisanceValues | None, per_flight: Sequence[str]) -> Share:
    """A flight's part of a fit."""
    mine = own_names(problem, per_flight) if label else ()
    unknowns = tuple(f"{n}@{label}" if n in mine else n for n in problem.names)
    return Share(problem.misfit(problem.simulator.holding(table)), table, problem.prior, unknowns, own)


def fit_in_stages(problem: EstimationProblem, horizons: Sequence[float], **how: Any) -> tuple[Fit, EstimationProblem]:
    """`fit_flights` of one flight."""
    result, problems = fit_flights([Flight(problem)], horizons, **how)
    return result.flights[0], problems[0]
