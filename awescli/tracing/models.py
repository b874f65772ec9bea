"""Models that compete: the declared kite with some effects added, fitted to the same flights with levels of processes of its own."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.fit import Fit, JointFit, Share, fit_together, together
from awescli.estimation.levels import prior_deviance
from awescli.estimation.misfit import DIVERGED_COST, Misfit
from awescli.estimation.problem import EstimationProblem, without_record
from awescli.estimation.processes.base import Process
from awescli.estimation.staged_fit import (
    LOOSE,
    MODEL_ERROR,
    ROUNDS,
    SETTLED_ON,
    SLIGHT,
    Flight,
    fit_coarsely_first,
    fit_flights,
    fit_levels,
    wide_open,
    widened,
)
from awescli.notation.parameters import ParameterTable
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.kite import make_effect
from awescli.simulation.rollout import Simulator
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
NEAR = 4.0
"""Shift (its square, in standard deviations) that validation may ask of the parameters before it is judged anew there: the linearisation
holds ..."""
JUDGED = 3
"""... and how often at most. What is promised beyond is not counted: of a stall in gusts, whose fit had ended at a kink, a linearisation
promised 370 that was nowhere."""
NOWHERE = 100.0
"""Times what a model leaves from which on a fit would only come back from afar: a rudder that had no rate limit, fitted from one of half a
degree a second, began at 1800 times and took 20 steps back to where it had been."""
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


def fit_null(
    frame: Frame, start: Mapping[str, float], horizons: Sequence[float], levels: Sequence[Levels] = (),
    on_iteration: Callable = lambda h, i, c: None,
) -> FittedModel:  # fmt: skip
    """The declared model, from parameter values `start`. levels: of every flight, as an identification left them: the fit then begins where
    that one ended; without, it begins with short horizons."""
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
