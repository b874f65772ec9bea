"""A fit from several starts: the best of them, and what their optima say of each other."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from awescli.estimation.fitted import JointFit
from awescli.estimation.levels import prior_deviance
from awescli.estimation.outliers import outliers
from awescli.estimation.problem import EstimationProblem
from awescli.estimation.staged_fit import Flight, fit_flights

GROSS = 300.0
"""Squares (chi-square) that values in a row must come to, to be worth another fit: a position that is off by forty times its noise for
half a second comes to 40000 at 50 Hz. Two values of the AP2's flight that are off come to less."""
PASSES = 4
"""Further fits at most: the noise is too large until the farthest values are gone."""
SAME_OPTIMUM = 4.0
"""Difference in deviance below which two starts have led to the same optimum: levels are not fitted closer."""


@dataclass(frozen=True)
class Optimum:
    """Where one start of several led. cost: -2 log posterior of parameters, levels and noise."""

    cost: float
    outcome: str
    x: np.ndarray


Starts = tuple[JointFit, tuple[EstimationProblem, ...], list[Optimum]]
"""The best fit, its problems, and where every start has led."""


def fit_from_starts(
    flights: Sequence[Flight], horizons: Sequence[float], starts: int, seed: int, *, on_start: Callable[[int], None] = lambda i: None,
    **how: Any
) -> Starts:  # fmt: skip
    """`fit_flights` from the declared values and from `starts` - 1 draws of the prior inside its bounds; the best of them, and all."""
    random = np.random.default_rng([seed, 3])
    found: list[tuple[JointFit, tuple[EstimationProblem, ...]]] = []
    optima: list[Optimum] = []
    for i in range(starts):
        on_start(i)
        start = _drawn(flights[0].problem, random) if i else None
        result, problems = fit_flights(flights, horizons, start=start, **how)
        optima.append(Optimum(_whole_deviance(result, problems), result.solution.outcome, result.solution.x))
        # only the best is kept: a fit is large
        if not found or optima[-1].cost < min(o.cost for o in optima[:-1]):
            found = [(result, problems)]
    (result, problems) = found[0]
    return result, problems, optima


def fit_without_outliers(flights: Sequence[Flight], *args: Any, **how: Any) -> tuple[Starts, list[Flight], dict[str, int]]:
    """(`fit_from_starts` of what is left, the flights without gross outliers, channel -> how many values these are): what a fit that has
    come to its minimum and loses no segment cannot follow, and what drags it along, is left out, and the fit begins anew."""
    many: Counter[str] = Counter()
    flights = list(flights)
    found = fit_from_starts(flights, *args, **how)
    for _ in range(PASSES):
        fit = found[0]
        flies = fit.ended and all(f.flies.all() for f in fit.flights)
        gross = [outliers([f], GROSS) for f in fit.flights] if flies else []
        if not any(gross):
            break
        many.update({name: len(rows) for flight in gross for name, rows in flight.items()})
        flights = [replace(f, problem=f.problem.without_values(rows)) for f, rows in zip(flights, gross, strict=True)]
        found = fit_from_starts(flights, *args, **how)
    return found, flights, dict(many)


def _whole_deviance(result: JointFit, problems: Sequence[EstimationProblem]) -> float:
    """-2 log posterior of parameters, levels and noise."""
    away, _ = result.prior.deviations(result.names, result.solution.x)
    levels = sum(prior_deviance(p.processes) for p in problems)
    return sum(f.deviance for f in result.flights) + float(np.square(away).sum()) + levels


def spread_of(optima: Sequence[Optimum], best: JointFit) -> dict:
    """What several starts say: costs above the best, how many led to the same optimum, and how far apart these and all of them lie, per
    parameter, in standard deviations of the fit."""
    std = np.sqrt(np.diag(best.covariance))
    above = np.array([o.cost for o in optima])
    above -= above.min()
    apart = np.array([np.abs(o.x - best.solution.x) / std for o in optima])
    same = above < SAME_OPTIMUM
    return {
        "starts": len(optima), "same_optimum": int(same.sum()), "cost_above_best": above.tolist(),
        "outcomes": [o.outcome for o in optima], "largest_distance_within_optimum_std": float(apart[same].max(initial=0.0)),
        "largest_distance_std": dict(zip(best.names, apart.max(axis=0).tolist(), strict=True)),
    }  # fmt: skip


def _drawn(problem: EstimationProblem, random: np.random.Generator) -> dict[str, float]:
    """Values of the kite's free parameters, drawn from their priors and moved inside their bounds."""
    rows = [problem.prior[n] for n in problem.names if n not in problem.kite.record]
    return {p.name: float(np.clip(random.normal(p.value, p.prior_std), p.lower, p.upper)) for p in rows}
