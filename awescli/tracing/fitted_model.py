"""A model fitted to flights: what it makes of the loops that it was fitted to, and of those that judge it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.fit import fit_together, together
from awescli.estimation.fitted import Fit, JointFit, Share
from awescli.estimation.levels import prior_deviance
from awescli.estimation.misfit import DIVERGED_COST, Misfit
from awescli.estimation.problem import EstimationProblem, without_record
from awescli.estimation.staged_fit import MODEL_ERROR, widened
from awescli.notation.parameters import ParameterTable
from awescli.physics.declaration import KiteDeclaration
from awescli.simulation.rollout import Simulator

NEAR = 4.0
"""Shift (its square, in standard deviations) that validation may ask of the parameters before it is judged anew there: the linearisation
holds ..."""
JUDGED = 3
"""... and how often at most. What is promised beyond is not counted: of a stall in gusts, whose fit had ended at a kink, a linearisation
promised 370 that was nowhere."""
AT_END = 1e-6
"""Share of its range by which a parameter at an end of it may be away from the end."""


@dataclass(frozen=True)
class FittedModel:
    """keys: of the added effects; strengths: full names of their parameters that are fitted; fit: to the train loops of all flights;
    problems: with levels and noise as fitted; judged: what it makes of the validation loops, where only nuisances are fitted.

    train, validation: deviance of every segment of all flights, parameters held; judged: on validation, near where all loops together want
    the parameters, bounds kept; shift: (n,) from the fit to that place, step: its last part, to first order; unseen: deviance of validation
    with what train leaves unknown of the parameters integrated out; deviance: of all segments, the priors of parameters and levels and what
    integrating the parameters out adds (Laplace) included: -2 log evidence but for a constant.
    """

    keys: tuple[str, ...]
    strengths: tuple[str, ...]
    fit: JointFit
    problems: tuple[EstimationProblem, ...]
    judged: tuple[Fit, ...]
    train: np.ndarray
    validation: np.ndarray
    shift: np.ndarray
    step: np.ndarray
    unseen: float
    deviance: float

    @classmethod
    def of(
        cls, keys: Sequence[str], strengths: Sequence[str], fitted: JointFit, problems: Sequence[EstimationProblem],
        before: Sequence[Fit | None] = (),
    ) -> "FittedModel":  # fmt: skip
        """The model with its validation loops judged. before: what a model near to it made of them."""
        begun = before or [None] * len(problems)
        judged = tuple(judge(p, f.parameters, b) for p, f, b in zip(problems, fitted.flights, begun, strict=True))
        train, validation = (np.concatenate([by_segment(f) for f in fits]) for fits in (fitted.flights, judged))
        judged, shift, step, unseen = _unseen(fitted, problems, judged)
        s, table = fitted.solution, fitted.prior
        away, slope = table.deviations(fitted.names, s.x)
        prior = float((away**2).sum())
        occam = float(np.linalg.slogdet(s.H / np.outer(slope, slope))[1])
        levels = sum(prior_deviance(p.processes) for p in problems)
        deviance = float(train.sum()) + unseen + prior + occam + levels
        return cls(tuple(keys), tuple(strengths), fitted, tuple(problems), judged, train, validation, shift, step, unseen, deviance)

    @property
    def table(self) -> ParameterTable:
        """Parameters of the first flight."""
        return self.fit.flights[0].parameters

    @property
    def simulator(self) -> Simulator:
        """Of the first flight, at the fit, the wind record's error taken out: what predicts."""
        problem = self.problems[0]
        return problem.simulator.holding(without_record(problem.kite, self.table))

    @property
    def rest(self) -> dict[str, float]:
        """Axis of the model error -> its level, the largest of all flights; none where the model follows the flights by itself."""
        levels = [(g.name, g.level) for p in self.problems for q in p.processes if q.name == MODEL_ERROR for g in q.groups if g.level > 0]
        return {name: max(level for n, level in levels if n == name) for name, _ in levels}

    @property
    def levels(self) -> dict[str, float]:
        """Group of a process -> its level, of the first flight."""
        return {g.name: g.level for p in self.problems[0].processes for g in p.groups if g.level > 0}

    @property
    def chi2(self) -> float:
        """Of the validation loops per degree of freedom, with the parameters where all loops together want them: 1 is noise alone.
        Segments that diverged count with their price."""
        more, b, cost, dof = *_validation(self.fit, self.judged), 0.0, 0.0
        for f in self.judged:
            lost = np.count_nonzero(~f.flies)
            cost += float(f.information.cost.sum()) + DIVERGED_COST * f.misfit.observed.measured[0].size * lost
            dof += float(f.information.dof.sum()) + f.misfit.observed.measured[0].size * lost
        known = np.trace(np.linalg.solve(self.fit.solution.H + more, more))
        return float((cost - 2 * b @ self.step + self.step @ more @ self.step) / max(dof - known, 1.0))

    @property
    def at_bound(self) -> list[str]:
        """Unknowns of the fit that sit at an end of their range, strengths aside."""
        return [n for n in bounded(self.fit) if n not in self.strengths]

    @property
    def towards_zero(self) -> list[str]:
        """Those of `at_bound` that sit at the end next to zero, beyond which their sign would change."""
        rows = {n: self.fit.parameters[n] for n in self.at_bound}
        return [n for n, p in rows.items() if p.lower * p.upper > 0 and abs(p.value) < (abs(p.lower) + abs(p.upper)) / 2]

    @property
    def flies(self) -> int:
        """Segments that did not diverge, of all flights."""
        return sum(int(f.flies.sum()) for f in (*self.fit.flights, *self.judged))

    @property
    def segments(self) -> int:
        return len(self.train) + len(self.validation)

    def declaration(self) -> KiteDeclaration:
        """The kite file of the model: declared effects, added ones, fitted values; strengths are free."""
        return self.problems[0].kite.declare(self.keys, free=self.strengths, table=without_record(self.problems[0].kite, self.table))

    def widened(self) -> "FittedModel":
        """The model with what coloured residuals add to its covariance."""
        return replace(self, fit=widened(self.fit))

    def light(self) -> "FittedModel":
        """The model without its sensitivities: what is kept of the many that are fitted."""

        def thin(f: Fit) -> Fit:
            at = replace(f.solution.at, known=None, inner=None)
            return replace(f, gram=None, information=replace(f.information, _back=None), solution=replace(f.solution, at=at))

        flights = tuple(map(thin, self.fit.flights))
        return replace(self, fit=replace(self.fit, flights=flights, solution=flights[0].solution), judged=tuple(map(thin, self.judged)))


def bounded(fitted: JointFit) -> list[str]:
    """Unknowns that sit at an end of their range."""
    rows = (fitted.parameters[n] for n in fitted.names)
    return [p.name for p in rows if min(p.value - p.lower, p.upper - p.value) < AT_END * min(p.upper - p.lower, 1e12)]


def _unseen(
    fitted: JointFit, problems: Sequence[EstimationProblem], judged: tuple[Fit, ...]
) -> tuple[tuple[Fit, ...], np.ndarray, np.ndarray, float]:
    """(validation judged near where all loops together want the parameters; the whole way there (n,) and the last step of it; deviance of
    validation with the parameters integrated out): loops that took no part in a fit differ from it by what the fit does not know of the
    parameters, too. Gauss-Newton steps from the fit, to the likeliest place that they come to: a quick fit may be far from its end, and a
    step from there lead away."""
    lower, upper = (np.array([getattr(fitted.parameters[n], end) for n in fitted.names]) for end in ("lower", "upper"))
    x, moved = fitted.solution.x, np.zeros(len(fitted.names))
    places: list[tuple[float, tuple[Fit, ...], np.ndarray, np.ndarray]] = []
    for left in reversed(range(JUDGED + 1)):
        step, gained, wider = _asked_of(fitted, judged, moved)
        near = step @ fitted.solution.H @ step <= NEAR
        deviance = sum(float(by_segment(f).sum()) for f in judged) + float(moved @ fitted.solution.H @ moved) + wider
        places.append((deviance - gained if near else deviance, judged, moved, step if near or not left else np.zeros(len(step))))
        if near or not left:
            break
        target = np.clip(x + moved + step, lower, upper)
        there, moved = dict(zip(fitted.names, target, strict=True)), target - x
        judged = tuple(
            judge(p, f.parameters.with_values({own: there[fitted.names[i]] for own, i in zip(f.names, place, strict=True)}), j)
            for p, f, place, j in zip(problems, fitted.flights, fitted.places, judged, strict=True)
        )
    deviance, judged, moved, step = min(places, key=lambda place: place[0])
    return judged, moved + step, step, deviance


def _asked_of(fitted: JointFit, judged: Sequence[Fit], moved: np.ndarray) -> tuple[np.ndarray, float, float]:
    """(further change of the parameters (n,) that all loops ask for where validation was judged with the parameters `moved` (n,) from the
    fit, what they gain by it, log determinant of what validation adds). With H the information of train, x + s costs s' H s there; a
    parameter of which train says nothing stays where it is."""
    H, held = fitted.solution.H, bounded(fitted)
    more, b = _validation(fitted, judged)
    free = np.array([i for i, name in enumerate(fitted.names) if name not in held and H[i, i] > 0], int)
    both, asked, step = np.ix_(free, free), b - H @ moved, np.zeros(len(moved))
    step[free] = np.linalg.solve(H[both] + more[both], asked[free])
    wider = np.linalg.slogdet(H[both] + more[both])[1] - np.linalg.slogdet(H[both])[1]
    return step, float(asked @ step), float(wider)


def _validation(fitted: JointFit, judged: Sequence[Fit]) -> tuple[np.ndarray, np.ndarray]:
    """(H (n, n), b (n,)): what the validation loops of all flights say of the parameters, what integrating the nuisances out adds to it as
    large for a segment as on train. Nothing those on which a model runs away, whose information is a difference of numbers that are too
    large to have one."""
    n = len(fitted.names)
    H, b = np.zeros((n, n)), np.zeros(n)
    for f, train, place in zip(judged, fitted.flights, fitted.places, strict=True):
        if not (np.diag(f.information.H) >= 0).all():
            continue
        H[np.ix_(place, place)] += f.information.H
        b[place] += f.information.b + len(f.counted) / max(len(train.counted), 1) * train.slope
    return H, b


def by_segment(f: Fit) -> np.ndarray:
    """Deviance of every segment; that of one that diverged is its price."""
    found = np.full(len(f.alive), DIVERGED_COST * float(f.misfit.observed.measured[0].size))
    found[f.counted] = (f.information.deviance + f.misfit.log_noise)[f.counted]
    found[~f.flies] = DIVERGED_COST * float(f.misfit.observed.measured[0].size)
    return found


def judge(problem: EstimationProblem, table: ParameterTable, before: Fit | None = None) -> Fit:
    """What parameters make of the validation loops: only nuisances are fitted, from those of another fit that lost no segment, or anew. Its
    information is that on the parameters."""
    simulator = problem.simulator.holding(table)
    alone = Misfit(simulator, problem.validation, (), problem.processes)
    own = alone.carried(before.own, before.misfit) if before and before.flies.all() else None
    found = fit_together([Share(alone, table, table, (), own)], prior=False, iterations=6, tolerance=1.0).flights[0]
    misfit = Misfit(simulator, problem.validation, problem.names, problem.processes)
    said = misfit.linear(table.vector(problem.names), found.own)
    alive, information = together(misfit, found.own, said)
    counted = np.flatnonzero(alive > misfit.observed.segments.steps)
    return replace(found, misfit=misfit, gram=said.gram, information=information, counted=counted, alive=alive)
