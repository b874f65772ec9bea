"""A whole identification: from short horizons to the whole one, of one or several flights, from one or several starts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import numpy as np

from awescli.estimation.coloured import coloured_information
from awescli.estimation.fit import Fit, JointFit, Share, fit_together, settled
from awescli.estimation.question import GUSTY, GUSTY_TOLERANCE, Question, ask
from awescli.estimation.record_error import mid_times, record_influence
from awescli.estimation.simulation_error import SimulationError
from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import Split
from awescli.notation.parameters import ParameterTable

SETTLINGS = 2
"""How often gusts are settled: their nodes move together first, then the fit that knows them says how long gusts are."""
SAME_OPTIMUM = 1.0
"""Difference in cost (chi-square) below which two starts have led to the same optimum."""

OnIteration = Callable[[float, int, float], None]
"""horizon [s], iteration, cost"""


@dataclass(frozen=True)
class Flown:
    """One flight of a fit. label: its own parameters are called `dl@label` in the fit; the first flight of a fit needs none."""

    question: Question
    log: FlightLog
    split: Split
    label: str = ""

    @property
    def length(self) -> float:
        """[s] of a segment."""
        segments = self.question.fitted.segments
        return segments.steps * segments.dt


@dataclass(frozen=True)
class Optimum:
    """Where one start of several led."""

    cost: float
    outcome: str
    x: np.ndarray


def own_names(question: Question, patterns: Sequence[str]) -> tuple[str, ...]:
    """Fitted parameters that belong to the flight and not to the kite: those that a pattern names, and the errors of its wind record."""
    return tuple(n for n in question.names if n in question.kite.record or any(fnmatchcase(n, p) for p in patterns))


def fit_flights(
    flights: Sequence[Flown],
    horizons: Sequence[float],
    *,
    per_flight: Sequence[str] = (),
    prior: bool = True,
    start: dict[str, float] | None = None,
    on_iteration: OnIteration = lambda h, i, c: None,
) -> tuple[JointFit, tuple[Question, ...]]:
    """Fit from short horizons to the whole one (a poor guess cannot follow five seconds), then settle the noise in gusty air.

    per_flight: patterns of the parameters that every flight has for itself; start: name -> value to start from where that differs from
    the declared one. Returns the fit and the questions with the noise as finally used.
    """
    questions = [f.question for f in flights]
    if not prior:
        # without priors nothing keeps the wind record near what was recorded
        questions = [replace(q, names=tuple(n for n in q.names if n not in q.kite.record)) for q in questions]
    tables = [q.simulator.kite.parameters.with_values(start or {}) for q in questions]

    def fitted(asked: Sequence[Question], length: float, tolerance: float, starts: Sequence[Fit | None]) -> JointFit:
        shares = [
            _share(flight, question, cut, table, per_flight, begin)
            for flight, question, cut, table, begin in zip(flights, questions, asked, tables, starts, strict=True)
        ]
        return fit_together(shares, prior=prior, tolerance=tolerance, on_iteration=lambda i, c: on_iteration(length, i, c))

    none = [None] * len(flights)
    for horizon in horizons:
        short = [_shorter(flight, table, horizon) for flight, table in zip(flights, tables, strict=True)]
        tables = [f.parameters for f in fitted(short, horizon, 1.0, none).flights]
    length, gusty = max(f.length for f in flights), any(q.gust > GUSTY for q in questions)
    result = fitted(questions, length, 1.0 if gusty else 0.01, none)
    for _ in range(SETTLINGS if gusty else 0):
        tables, before = [f.parameters for f in result.flights], questions
        questions = [_settled(q, f) for q, f in zip(questions, result.flights, strict=True)]
        if all(q is b for q, b in zip(questions, before, strict=True)):
            break
        same = all(q.gusts.window == b.gusts.window for q, b in zip(questions, before, strict=True))
        result = fitted(questions, length, GUSTY_TOLERANCE, result.flights if same else none)
    return _widened(result, flights, questions), tuple(questions)


def fit_in_stages(question: Question, log: FlightLog, split: Split, horizons: Sequence[float], **how) -> tuple[Fit, Question]:
    """`fit_flights` of one flight."""
    result, questions = fit_flights([Flown(question, log, split)], horizons, **how)
    return result.flights[0], questions[0]


def fit_from_starts(
    flights: Sequence[Flown], horizons: Sequence[float], starts: int, seed: int, *, on_start: Callable[[int], None] = lambda i: None, **how
) -> tuple[JointFit, tuple[Question, ...], list[Optimum]]:
    """`fit_flights` from the declared values and from `starts` - 1 draws of the prior inside its bounds; the best of them, and all."""
    random = np.random.default_rng([seed, 3])
    best, optima = None, []
    for i in range(starts):
        on_start(i)
        start = _drawn(flights[0].question, random) if i else None
        result, questions = fit_flights(flights, horizons, start=start, **how)
        optima.append(Optimum(result.solution.cost, result.solution.outcome, result.solution.x))
        if best is None or result.solution.cost < best[0].solution.cost:
            best = result, questions
    return *best, optima


def spread_of(optima: Sequence[Optimum], best: JointFit) -> dict:
    """What several starts say: costs above the best, how many led to the same optimum, and how far apart these and all of them lie, per
    parameter, in standard deviations of the fit."""
    std = np.sqrt(np.diag(best.covariance))
    above = np.array([o.cost for o in optima]) - best.solution.cost
    apart = np.array([np.abs(o.x - best.solution.x) / std for o in optima])
    same = above < SAME_OPTIMUM
    return {
        "starts": len(optima), "same_optimum": int(same.sum()), "cost_above_best": above.tolist(),
        "outcomes": [o.outcome for o in optima], "largest_distance_within_optimum_std": float(apart[same].max(initial=0.0)),
        "largest_distance_std": dict(zip(best.names, apart.max(axis=0).tolist(), strict=True)),
    }  # fmt: skip


def _drawn(question: Question, random: np.random.Generator) -> dict[str, float]:
    """Values of the kite's free parameters, drawn from their priors and moved inside their bounds."""
    rows = [question.prior[n] for n in question.names if n not in question.kite.record]
    return {p.name: float(np.clip(random.normal(p.value, p.prior_std), p.lower, p.upper)) for p in rows}


def _share(flight: Flown, question: Question, cut: Question, table: ParameterTable, per_flight, start: Fit | None) -> Share:
    """A flight's part of a fit to the segments of `cut`."""
    mine = own_names(question, per_flight) if flight.label else ()
    unknowns = tuple(f"{n}@{flight.label}" if n in mine else n for n in question.names)
    simulator = question.simulator.holding(table)
    return Share(simulator, cut.fitted, question.gusts, question.names, table, question.prior, unknowns, start)


def _shorter(flight: Flown, table: ParameterTable, horizon: float) -> Question:
    """The question of a flight cut into shorter segments."""
    q = flight.question
    how = {"parts": ("train",), "seed_weights": q.seed_weights}
    return ask(q.simulator.holding(table), flight.log, flight.split, horizon, q.fitted.outputs, **how)


def _settled(question: Question, fit: Fit) -> Question:
    """The question with the gusts and the noise that a fit tells, where the air is gusty."""
    gusts, (fitted, choice) = settled(question.simulator, fit, question.gusts, question.fitted, question.choice)
    if gusts is question.gusts:
        return question
    return replace(question, gusts=gusts, fitted=fitted, choice=choice)


def _widened(result: JointFit, flights: Sequence[Flown], questions: Sequence[Question]) -> JointFit:
    """The fit with what coloured residuals and the errors of the wind records add to its covariance."""
    C = result.covariance
    grown = C.copy()
    for flight, question, fit, place in zip(flights, questions, result.flights, result.places, strict=True):
        problem = SimulationError(question.simulator.holding(fit.parameters), question.fitted, fit.names, question.gusts)
        problem.own = fit.own
        flies = fit.alive > question.fitted.segments.steps
        grown += C[:, place] @ coloured_information(problem, fit.parameters.vector(fit.names), fit.information, flies) @ C[place]
        if flight.log.wind is not None:
            times = mid_times(question.fitted.segments, flight.log)
            influence = C[:, place] @ record_influence(fit, question.kite.record, flight.log.wind.time, times)
            grown += influence @ influence.T
    return result.with_covariance(grown)
