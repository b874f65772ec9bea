"""Screen all candidates at once: score tests from exact sensitivities, orthogonal to what re-fitting can absorb, in the likelihood of the
present model with its processes.

Over a second a model stays near the flight, its model error at work, and what a candidate would do is nearly linear; over five seconds it
is not where the effect is large.

In gusty air a candidate may lower the squared residual by no more than what it makes gusts easier to see: the log determinant rises by as
much (`laplace`). The scores of the likeliest variants are then those of the likelihood in which gusts are integrated out.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import stats

from awescli.estimation.fit import relaxed
from awescli.estimation.laplace import estimates
from awescli.estimation.links import Gram
from awescli.estimation.misfit import Misfit, NuisanceValues
from awescli.estimation.problem import build
from awescli.estimation.smoother import Nuisances
from awescli.notation.parameters import Parameter
from awescli.notation.quantities import OUTPUTS
from awescli.physics.kite import make_effect
from awescli.simulation.rollout import Columns
from awescli.simulation.scores import error
from awescli.tracing.candidates import Variant, variants
from awescli.tracing.criteria import CRITERIA
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.frame import Frame
from awescli.tracing.rest import gusty

SHORT = 1.0
"""[s] of the segments that are screened."""
CLOSER = 4
"""Times that an onset is sought, each time closer: that of an effect in half an hour lies within a segment then."""
PROBES = 4
"""Draws of the gusts that say how the log determinant changes with a candidate ..."""
UNSURE = 3.0
"""... and standard error of what they say, in standard deviations of the candidate, beyond which they say nothing of it: up to that a score
counts as surely as it is known."""


@dataclass(frozen=True)
class Score:
    """What the residual says about one candidate.

    variant: the shape and probe that did best; moving: the strengths that are not absorbed; drop: predicted fall of the deviance; size,
    std: one-step estimate of `moving` (in probes for a secant); p_value: of the likelihood ratio; inflation: least variance inflation of
    its columns; place: of its columns in `Screening.joint`.
    """

    variant: Variant
    moving: tuple[str, ...]
    drop: float
    size: np.ndarray
    std: np.ndarray
    p_value: float
    inflation: float
    place: tuple[int, ...]

    @property
    def key(self) -> str:
        return self.variant.key

    def start(self, rows: Mapping[str, Parameter], share: float = 1.0) -> tuple[dict[str, float], dict[str, float]]:
        """(strengths, shapes): full name -> value to begin a fit from, inside the bounds of the parameters `rows`; share: of the one-step
        estimate."""
        strengths = {}
        for name, size in zip(self.moving, self.size, strict=True):
            p = rows[name]
            # a secant knows how much of its probe, not beyond three of them
            step = self.variant.at[name] * np.clip(size, 0.3, 3.0) if self.variant.secant else size
            strengths[name] = float(np.clip(p.value + share * step, p.lower, p.upper))
        return strengths, {n: v for n, v in self.variant.at.items() if n not in strengths}


@dataclass(frozen=True)
class Screening:
    """All scores, best first; untestable: effects that the free parameters absorb; joint: information of all columns after projection;
    rows: of all candidates' parameters."""

    scores: tuple[Score, ...]
    untestable: tuple[str, ...]
    joint: np.ndarray
    rows: dict[str, Parameter]

    @property
    def detectable(self) -> float:
        return CRITERIA.detectable

    def cosine(self, a: Score, b: Score) -> float:
        """Largest canonical correlation between two candidates: 1 means that the flight cannot tell them apart."""
        A, B = self.joint[np.ix_(a.place, a.place)], self.joint[np.ix_(b.place, b.place)]
        C = self.joint[np.ix_(a.place, b.place)]
        La, Lb = np.linalg.cholesky(firm(A)), np.linalg.cholesky(firm(B))
        middle = np.linalg.solve(La, np.linalg.solve(Lb, C.T).T)
        return float(min(np.linalg.svd(middle, compute_uv=False)[0], 1.0))


def firm(A: np.ndarray) -> np.ndarray:
    """A matrix (n, n) with as much on its diagonal as rounding asks for."""
    return A + 1e-9 * np.diag(np.diag(A)) + 1e-300 * np.eye(len(A))


def screen(frame: Frame, model: FittedModel, keys: Sequence[str]) -> Screening:
    """Score every candidate effect of `keys` at a fitted model: over the whole horizon where it follows the flight by itself."""
    columns, flights, rows, abrupt = _asked(frame, model, keys)
    projected = Projected.of(model, *_informed(model, flights, columns))
    found = _scored(columns, projected, rows, abrupt)
    if not gusty(model):
        return found
    likeliest = CandidateColumns(_likeliest(columns, projected))
    drawn = _drawn(model, flights, likeliest)
    if drawn is None:
        return found
    integrated = projected.of_columns(columns.places(likeliest)).integrated(drawn)
    return replace(_scored(likeliest, integrated, rows, abrupt), untestable=found.untestable)


def screen_apart(frame: Frame, model: FittedModel, keys: Sequence[str]) -> tuple[Screening, ...]:
    """Of every flight, in their order: the scores of candidates as if they acted in that flight alone; free parameters are those of all."""
    columns, flights, rows, abrupt = _asked(frame, model, keys)
    every = _summed(model, flights, columns, [(i,) for i in range(len(flights))])
    return tuple(_scored(columns, Projected.of(model, whole, gradient), rows, abrupt) for whole, gradient in every)


def _asked(
    frame: Frame, model: FittedModel, keys: Sequence[str]
) -> tuple["CandidateColumns", list["_Placed"], dict[str, Parameter], set[str]]:
    """(columns of candidates, flights in segments, all parameters, candidates that are abrupt)."""
    columns = CandidateColumns([v for key in keys for v in variants(make_effect(key, frame.declared), frame.onsets())])
    flights = _flights(frame, model, keys, SHORT if model.rest else frame.horizon)
    rows = {**{p.name: p for k in keys for p in _rows(frame, k)}, **model.problems[0].simulator.kite.parameters}
    return columns, flights, rows, {key for key in keys if make_effect(key, frame.declared).abrupt}


def begun(frame: Frame, model: FittedModel, key: str) -> dict[str, float]:
    """Full name -> value from which an effect that begins in flight is fitted to a model without it: to first order its likeliest onset,
    sought among moments all over the flight, then among such between the neighbours of the best one, until these lie within a segment; and
    its strengths from there. Loops that were not fitted are asked, too: the onset may lie in them. Nothing for an effect that the free
    parameters absorb."""
    effect, rows, onsets, found = make_effect(key, frame.declared), {p.name: p for p in _rows(frame, key)}, frame.onsets(), {}
    horizon = SHORT if model.rest else frame.horizon
    flights = [*_flights(frame, model, [key], horizon), *_flights(frame, model, [key], horizon, unseen=True)]
    for _ in range(CLOSER):
        columns = CandidateColumns(variants(effect, onsets))
        scores = _scored(columns, Projected.of(model, *_informed(model, flights, columns)), rows, ()).scores
        if not scores:
            break
        strengths, shapes = scores[0].start(rows)
        found, place = {**strengths, **shapes}, onsets.index(shapes[f"{key}.{effect.onset}"])
        ends = [-np.inf, *onsets, np.inf]
        if np.ptp(onsets[max(place - 1, 0) : place + 2]) < frame.horizon:
            break
        onsets = frame.onsets((ends[place], ends[place + 2]))
    return found


@dataclass(frozen=True)
class _Placed:
    """One flight's misfit of a model with candidates at null, parameter values x, nuisances at their best, the places of its parameters
    among those of all flights, and the names of the model's own states."""

    misfit: Misfit
    x: np.ndarray
    own: NuisanceValues
    place: np.ndarray
    states: tuple[str, ...]

    def draws(self, gram: Gram, which: np.ndarray) -> Nuisances:
        """Of the nuisances of segments `which`. States that a candidate brings are at rest: at null nothing depends on them, and to first
        order in the candidate the log determinant neither; drawn, they would only be noise."""
        drawn = self.misfit.eliminated(gram, self.own, which).samples(PROBES, seed=0)
        brought = [i for i, name in enumerate(self.misfit.simulator.kite.state_names) if name not in self.states]
        states = drawn.states.copy()
        states[:, 0, brought] = 0.0
        return replace(drawn, states=states)

    def named(self, columns: "CandidateColumns") -> tuple[Misfit, np.ndarray, dict[str, Any]]:
        """(The misfit with the plain tangents of `columns` behind its parameters; their values; how further columns are asked for.)"""
        misfit, rows = replace(self.misfit, names=(*self.misfit.names, *columns.names)), self.misfit.simulator.kite.parameters
        x, count = np.r_[self.x, [rows[n].value for n in columns.names]], len(columns.labels)
        return misfit, x, {"extra": (lambda some, own: columns.further(some, x, own)) if count else None, "columns": count}


@dataclass(frozen=True)
class Projected:
    """What flights say of n columns, what the free parameters absorb taken off. joint: (n, n) their information, b: (n,) gradient; whole:
    (n,) information of each without anything taken off; absorbed: (f, n) what each free parameter takes of them, free: their places;
    noise: (n, n) covariance of what draws made of b."""

    joint: np.ndarray
    b: np.ndarray
    whole: np.ndarray
    absorbed: np.ndarray
    free: np.ndarray
    noise: np.ndarray

    @classmethod
    def of(cls, model: FittedModel, whole: np.ndarray, gradient: np.ndarray) -> "Projected":
        """whole, gradient: of the parameters of a model and of columns behind them (`informed`)."""
        n, held = len(model.fit.names), model.at_bound
        # a parameter at its bound absorbs nothing any more
        free = np.array([i for i, name in enumerate(model.fit.names) if name not in held], int)
        absorbed = np.linalg.solve(whole[np.ix_(free, free)], whole[free, n:])
        joint, b = whole[n:, n:] - whole[n:, free] @ absorbed, gradient[n:] - absorbed.T @ gradient[free]
        return cls(joint, b, np.diag(whole)[n:], absorbed, free, np.zeros_like(joint))

    def of_columns(self, places: Sequence[int]) -> "Projected":
        """Of some of the columns."""
        both = np.ix_(places, places)
        return Projected(self.joint[both], self.b[places], self.whole[places], self.absorbed[:, places], self.free, self.noise[both])

    def integrated(self, drawn: np.ndarray) -> "Projected":
        """With -1/2 of the gradient of the log determinant, of the model's parameters and of the columns, as m draws see it (m, p + n)."""
        first = drawn.shape[1] - len(self.b)
        slopes = drawn[:, first:] - drawn[:, self.free] @ self.absorbed
        noise = np.cov(slopes.T).reshape(self.joint.shape) / len(slopes)
        sure = np.diag(noise) < UNSURE**2 * np.diag(self.joint)
        return replace(self, b=self.b + np.where(sure, slopes.mean(axis=0), 0.0), noise=np.where(np.outer(sure, sure), noise, 0.0))


def informed(
    frame: Frame, model: FittedModel, keys: Sequence[str], columns: "CandidateColumns", horizon: float
) -> tuple[np.ndarray, np.ndarray]:
    """(H, b) of all free parameters of a model, prior included, and behind them of the columns of candidates `keys`, from all flights in
    segments of `horizon` seconds."""
    return _informed(model, _flights(frame, model, keys, horizon), columns)


def _informed(model: FittedModel, flights: Sequence[_Placed], columns: "CandidateColumns") -> tuple[np.ndarray, np.ndarray]:
    (found,) = _summed(model, flights, columns, [range(len(flights))])
    return found


def _summed(
    model: FittedModel, flights: Sequence[_Placed], columns: "CandidateColumns", acting: Sequence[Collection[int]]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """(H, b) of the free parameters by all flights, with columns that act in some of them: once for each of `acting`."""
    names, n_free, n = model.fit.names, len(model.fit.names), len(columns)
    away, slope = model.fit.prior.deviations(names, model.fit.solution.x)
    found = [(np.diag(np.r_[slope**2, np.zeros(n)]), np.r_[-slope * away, np.zeros(n)]) for _ in acting]
    for i, flight in enumerate(flights):
        misfit, x, how = flight.named(columns)
        said = misfit.information(x, flight.own, misfit.names, **how)
        for (whole, gradient), those in zip(found, acting, strict=True):
            own = np.arange(len(said.b)) < len(flight.place) + (n if i in those else 0)
            at = np.r_[flight.place, n_free + np.arange(n)][own]
            whole[np.ix_(at, at)] += said.H[np.ix_(own, own)]
            gradient[at] += said.b[own]
    return found


def _drawn(model: FittedModel, flights: Sequence[_Placed], columns: "CandidateColumns") -> np.ndarray | None:
    """(m, p + n) -1/2 of the gradient of the log determinant, of a model's parameters and of columns of candidates behind them, as m draws
    of the gusts of all flights see it; None where a draw loses a segment or runs away."""
    n_free, n = len(model.fit.names), len(columns)
    drawn = np.zeros((PROBES, n_free + n))
    for flight in flights:
        misfit, x, how = flight.named(columns)
        said = misfit.linear(x, flight.own, **how)
        flies = np.flatnonzero(said.alive > misfit.observed.segments.steps)
        seen = estimates(misfit, x, flight.own, said.gram, flies, flight.draws(said.gram, flies), **how) if len(flies) else None
        if seen is None or not np.isfinite(seen).all():
            return None
        drawn[:, np.r_[flight.place, n_free + np.arange(n)]] += seen
    return drawn


def _rows(frame: Frame, key: str) -> Sequence[Parameter]:
    return make_effect(key, frame.declared).rows()


def _flights(frame: Frame, model: FittedModel, keys: Sequence[str], horizon: float, unseen: bool = False) -> list[_Placed]:
    """All flights in segments of `horizon` seconds, flown by a fitted model with candidates `keys` at null: those that are fitted, or the
    unseen ones that validate."""
    found = []
    for flight, problem, fitted, place in zip(frame.flights, model.problems, model.fit.flights, model.fit.places, strict=True):
        simulator, table = flight.simulator((*model.keys, *keys)), fitted.parameters
        rows = simulator.kite.parameters
        simulator = simulator.holding(rows.with_values({n: table[n].value for n in rows if n in table}))
        short = build(simulator, problem.log, problem.split, min(horizon, problem.horizon), problem.outputs, by_range=problem.by_range)
        short = replace(short.with_factors(problem.factors), processes=problem.processes, names=problem.names)
        misfit, x = short.misfit(), table.vector(problem.names)
        misfit = replace(misfit, observed=short.validation) if unseen else misfit
        found.append(_Placed(misfit, x, relaxed(misfit, x, misfit.own()), np.asarray(place), problem.kite.state_names))
    return found


class CandidateColumns:
    """The columns of all variants. names: of plain tangents at null; labels: of the further columns, in their order."""

    def __init__(self, every: Sequence[Variant]):
        self.names = tuple(dict.fromkeys(m for v in every if not v.at for m in v.moving))
        # tangents at shape values: variants that only set shapes can share a pass, for at null strength a shape changes nothing
        self.passes: list[list[Variant]] = []
        for v in (v for v in every if v.at and not v.secant):
            group = next((g for g in self.passes if all(o.key != v.key for o in g)), None)
            self.passes.append([v]) if group is None else group.append(v)
        self.secants = [v for v in every if v.secant]
        self.every = tuple(every)
        self.labels = (
            *((v.label, m) for group in self.passes for v in group for m in v.moving),
            *((v.label, v.moving[0]) for v in self.secants),
        )
        self._place = {name: i for i, name in enumerate((*self.names, *self.labels))}

    def __len__(self) -> int:
        return len(self.names) + len(self.labels)

    def places(self, other: "CandidateColumns") -> list[int]:
        """Of all columns of `other` among these."""
        return [self._place[name] for name in (*other.names, *other.labels)]

    def place(self, variant: Variant) -> list[int]:
        """Of a variant's columns among all."""
        if variant.secant:
            return [self._place[(variant.label, variant.moving[0])]]
        return [self._place[(variant.label, m) if variant.at else m] for m in variant.moving]

    def further(self, misfit: Misfit, x: np.ndarray, own: NuisanceValues) -> np.ndarray:
        """(K, N+1, n_out, n) the columns behind the plain tangents."""
        segments, outputs, found = misfit.segments(own), misfit.observed.outputs, []
        for group in self.passes:
            values = {**misfit.values(x), **{k: value for v in group for k, value in v.at.items()}}
            moving = tuple(m for v in group for m in v.moving)
            found.append(misfit.simulator.sensitivities(segments, Columns((), moving), outputs, values)[1])
        index = [OUTPUTS.index(n) for n in outputs]
        base = misfit.simulator.rollout(segments, misfit.values(x))
        for v in self.secants:
            there = misfit.simulator.rollout(segments, {**misfit.values(x), **v.at})
            reached = np.arange(segments.steps + 1)[None] < np.minimum(base.alive, there.alive)[:, None]
            moved = (error(there.outputs[:, :, i], base.outputs[:, :, i], n) for i, n in zip(index, outputs, strict=True))
            # in units of the probe: a one-step size of 1 means the probe itself
            found.append(np.where(reached[:, :, None], np.stack(list(moved), axis=-1), 0.0)[..., None])
        return np.concatenate(found, axis=-1) if found else np.zeros((*misfit.observed.measured.shape, 0))


def _likeliest(columns: CandidateColumns, projected: Projected) -> list[Variant]:
    """The variant of every candidate that promises most, whatever its sign."""
    drops: dict[str, tuple[float, Variant]] = {}
    for variant in columns.every:
        where = columns.place(variant)
        drop = float(projected.b[where] @ np.linalg.solve(firm(projected.joint[np.ix_(where, where)]), projected.b[where]))
        if variant.key not in drops or drop > drops[variant.key][0]:
            drops[variant.key] = drop, variant
    return [variant for _, variant in drops.values()]


def _scored(columns: CandidateColumns, projected: Projected, rows: dict[str, Parameter], abrupt: Collection[str]) -> Screening:
    found: dict[str, list[Score]] = {}
    untestable = []
    for variant in columns.every:
        local = columns.place(variant)
        diagonal = np.maximum(np.diag(projected.joint)[local], 1e-300)
        reach = [_reach(rows[m], variant, m) for m in variant.moving][: len(local)]
        kept = [i for i in range(len(local)) if CRITERIA.detectable / np.sqrt(diagonal[i]) < reach[i] and projected.whole[local[i]] > 1e-12]
        if not kept:
            untestable.append(variant.key)
            continue
        where = [local[i] for i in kept]
        A, s = firm(projected.joint[np.ix_(where, where)]), projected.b[where]
        size = np.linalg.solve(A, s)
        drop, std = float(s @ np.linalg.solve(A + projected.noise[np.ix_(where, where)], s)), np.sqrt(np.diag(np.linalg.inv(A)))
        moving = tuple(variant.moving[i] for i in kept)
        p_value = float(stats.chi2.sf(drop, len(where)))
        inflation = float((projected.whole[local] / diagonal)[kept].min())
        score = Score(variant, moving, drop, size, std, p_value, inflation, tuple(where))
        if variant.secant and size[0] <= 0 and variant.key in abrupt:
            # a linear test says nothing of it: it is to be fitted all the same
            score = replace(score, drop=0.0, p_value=1.0)
        if not variant.secant or size[0] > 0 or variant.key in abrupt:
            found.setdefault(variant.key, []).append(score)
    best = [max(group, key=lambda s: s.drop) for group in found.values()]
    untestable = [k for k in dict.fromkeys(untestable) if k not in found]
    return Screening(tuple(sorted(best, key=lambda s: -s.drop)), tuple(untestable), projected.joint, rows)


def _reach(p: Parameter, variant: Variant, name: str) -> float:
    """How far a strength may plausibly go from null (in probes for a secant)."""
    reach = max(p.upper - p.value, p.value - p.lower)
    return reach / abs(variant.at[name]) if variant.secant else reach


def holm(p_values: Sequence[float], level: float) -> np.ndarray:
    """Which hypotheses are rejected when all are tested together (Holm 1979)."""
    p = np.asarray(p_values)
    order = np.argsort(p)
    limit = level / (len(p) - np.arange(len(p)))
    passed = np.cumprod(p[order] <= limit).astype(bool)
    result = np.zeros(len(p), bool)
    result[order] = passed
    return result
