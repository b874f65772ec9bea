"""Parameters, and levels of processes and noise, fitted in turn until neither moves."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np

from awescli.estimation.fit import fit_together
from awescli.estimation.fitted import Fit, JointFit, Share
from awescli.estimation.levels import noise_factors, relevelled
from awescli.estimation.misfit import NuisanceValues
from awescli.estimation.problem import EstimationProblem
from awescli.estimation.processes.base import Group, Process
from awescli.notation.parameters import ParameterTable

COARSE = 0.1
"""[s] between nodes while processes are only looked for."""
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
        return fit_once(problems, labels, tables, known, per_flight, prior, tolerance, on_iteration, slopes=slopes, reach=reach)

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
            problems, tables, begun = at_near_nodes(problems, rough, found)
    return fit_levels(problems, labels, tables, tolerance=tolerance, owns=begun, **how)


def at_near_nodes(
    problems: Sequence[EstimationProblem], rough: JointFit, found: Sequence[EstimationProblem]
) -> tuple[list[EstimationProblem], list[ParameterTable], list[NuisanceValues]]:
    """(Problems, parameters, nuisances) to go on from at nodes as close as those of some problems, where a fit at nodes that are far apart
    has ended, with the levels that it found."""
    near = [p.at_noise(c.factors).with_processes(spaced_as(p, c.processes)) for p, c in zip(problems, found, strict=True)]
    owns = [p.misfit().carried(f.own, c.misfit()) for p, f, c in zip(near, rough.flights, found, strict=True)]
    return near, [f.parameters for f in rough.flights], owns


def spaced_as(problem: EstimationProblem, processes: Sequence[Process]) -> list[Process]:
    """The processes with nodes as far apart as those of a problem are."""
    return [replace(p, spacing=own.spacing) for p, own in zip(processes, problem.processes, strict=True)]


def fit_once(
    problems: Sequence[EstimationProblem], labels: Sequence[str], tables: Sequence[ParameterTable], owns: Sequence[NuisanceValues | None],
    per_flight: Sequence[str], prior: bool, tolerance: float, on_iteration: OnIteration, iterations: int = 30,
    slopes: Sequence[np.ndarray | None] | None = None, reach: float = np.inf,
) -> JointFit:  # fmt: skip
    """Parameters and nuisances with the levels as they are; arguments as of `fit_levels`."""
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


def own_names(problem: EstimationProblem, patterns: Sequence[str]) -> tuple[str, ...]:
    """Fitted parameters that belong to the flight and not to the kite: those that a pattern names, and the errors of its wind record."""
    return tuple(n for n in problem.names if n in problem.kite.record or any(fnmatchcase(n, p) for p in patterns))
