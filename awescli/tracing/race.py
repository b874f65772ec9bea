"""Race: the best candidates are re-fitted together with all free parameters and judged on loops they were not fitted to."""

from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.fit import Fit, fit
from awescli.estimation.fit import settled as fit_settled
from awescli.estimation.nuisance_wind import RecordError
from awescli.estimation.question import GUSTY, GUSTY_TOLERANCE, Question
from awescli.notation.parameters import ParameterTable
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed
from awescli.tracing.screen import Score, Screening

MATERIAL = 0.002
"""Least relative fall of the choice cost that counts as a gain: 0.2 % is 50 units of chi-square on 30 s of flight, and below it no
prediction error changes in its third digit ..."""
GUSTY_MATERIAL = 0.0005
"""... and in gusty air, where estimated gusts take up most of what an effect does, so that little of it is left to be gained."""
FLOOR_ERROR = 0.02
"""Relative error of the noise floor itself: a chi-square per degree of freedom within 1 +- this is at the floor ..."""
GUSTY_FLOOR_ERROR = 0.04
"""... and in gusty air, where the floor rests on what gusts are taken for: clean flights come to 1.03 (`benchmarks/README.md`)."""
TOLERANCE = 0.1
"""[chi-square] what a fit in calm air need not gain any more."""


@dataclass(frozen=True)
class Contest:
    """Everything a re-fit needs: the compiled library simulator, segments to fit and to choose on, nuisance wind, prior; material: the
    least relative gain that counts; floor_error: relative error of the noise floor; tolerance: what a fit need not gain."""

    simulator: Simulator
    fitted: Observed
    choice: Observed
    gusts: RecordError
    prior: ParameterTable
    material: float
    floor_error: float
    tolerance: float
    iterations: int = 25


def contest_of(question: Question) -> Contest:
    """The contest that answers a question."""
    calm, gusty = (MATERIAL, FLOOR_ERROR, TOLERANCE), (GUSTY_MATERIAL, GUSTY_FLOOR_ERROR, GUSTY_TOLERANCE)
    limits = gusty if question.gust > GUSTY else calm
    return Contest(question.simulator, question.fitted, question.choice, question.gusts, question.prior, *limits)


@dataclass(frozen=True, eq=False)
class Runner:
    """A model in the race: parameters, which are free, its fit, what it makes of the choice segments, and its cost and deviance there."""

    keys: tuple[str, ...]
    names: tuple[str, ...]
    fit: Fit
    judged: Fit
    choice_cost: np.ndarray
    choice_deviance: np.ndarray
    choice_dof: float
    prior: ParameterTable

    @property
    def table(self) -> ParameterTable:
        return self.fit.parameters

    @property
    def train_cost(self) -> np.ndarray:
        return self.fit.information.cost

    @property
    def train_deviance(self) -> np.ndarray:
        return self.fit.information.deviance

    @property
    def choice_chi2(self) -> float:
        return float(self.choice_cost.sum() / max(self.choice_dof, 1))


def above_floor(r: Runner) -> float:
    """Distance of the chi-square per degree of freedom from its floor, fit and choice segments together."""
    cost = r.train_cost.sum() + r.choice_cost.sum()
    return float(cost / (r.fit.information.dof.sum() + r.choice_dof) - 1)


HEAT = (15, 2.0)
"""Iterations and tolerance [chi-square] of a heat: enough to tell candidates apart; the winner is fitted on to the end."""


def run(
    contest: Contest, table: ParameterTable, keys, names, start=None, iterations=None, tolerance=None, judged: Fit | None = None
) -> Runner:
    """Fit one model on the fit segments, then let it explain the choice segments (only their own starts and wind are fitted there).

    start, judged: an earlier fit to the fit segments and one to the choice segments, to begin from.
    """
    fitted = fit(
        contest.simulator.holding(table), contest.fitted, table, names, gusts=contest.gusts, prior_table=contest.prior,
        iterations=iterations or contest.iterations, tolerance=tolerance or contest.tolerance, start=start,
    )  # fmt: skip
    judged = fit(
        contest.simulator.holding(fitted.parameters), contest.choice, fitted.parameters, (), gusts=contest.gusts, prior=False,
        iterations=6, tolerance=1.0, start=judged,
    )  # fmt: skip
    diverged = judged.alive <= contest.choice.segments.steps
    cost = np.where(diverged, 25.0 * contest.choice.measured[0].size, judged.information.cost)
    deviance = cost + judged.information.volume
    return Runner(tuple(keys), tuple(names), fitted, judged, cost, deviance, float(judged.information.dof.sum()), contest.prior)


def enter(contest: Contest, null: Runner, screening: Screening, score: Score) -> Runner:
    """The null model with one candidate added, started from the one-step estimate of its score test. Shapes stay where they were probed:
    while a strength is small they are all but free, and a fit of both goes astray."""
    rows = null.table
    own = list(score.moving)
    start, size = {}, np.zeros(len(score.moving))
    for i, name in enumerate(score.moving):
        p = rows[name]
        unit = score.variant.at[name] if score.variant.secant else 1.0
        step = np.clip(score.size[i], 0.3, 3.0) if score.variant.secant else score.size[i]
        start[name] = float(np.clip(p.value + unit * step, p.lower, p.upper))
        size[i] = (start[name] - p.value) / unit
    for name, value in score.variant.at.items():
        start.setdefault(name, value)
    change, along = screening.step(score, size)
    free = {n: float(np.clip(rows[n].value + d, rows[n].lower, rows[n].upper)) for n, d in zip(null.names, change, strict=True)}
    table, begin = rows.with_values({**free, **start}), replace(null.fit, own=null.fit.own + along)
    table = table.with_rows(replace(table[n], free=True) for n in own)
    names = tuple(dict.fromkeys((*null.names, *own)))
    return run(contest, table, (*null.keys, score.key), names, begin, *HEAT, null.judged)


def finish(contest: Contest, best: Runner) -> Runner:
    """The winner of a heat, fitted on until it has converged."""
    return run(contest, best.table, best.keys, best.names, best.fit, judged=best.judged)


def settled(contest: Contest, winner: Runner) -> tuple[Contest, Runner]:
    """The contest with the gusts that its winner tells, and the winner fitted to it: what was missing before stood in the gusts."""
    gusts, (fitted, choice) = fit_settled(contest.simulator, winner.fit, contest.gusts, contest.fitted, contest.choice)
    if gusts is contest.gusts:
        return contest, winner
    same = gusts.window == contest.gusts.window
    contest = replace(contest, gusts=gusts, fitted=fitted, choice=choice)
    begin = {"start": winner.fit, "judged": winner.judged} if same else {}
    return contest, run(contest, winner.table, winner.keys, winner.names, **begin)
