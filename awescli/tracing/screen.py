"""Screen all candidates at once: score tests from exact sensitivities, orthogonal to what re-fitting can absorb, in the likelihood of the
present model with its processes.

Over a second a model stays near the flight, its model error at work, and what a candidate would do is nearly linear; over five seconds it
is not where the effect is large.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from awescli.estimation.fit import relaxed
from awescli.estimation.misfit import Misfit, NuisanceValues
from awescli.estimation.problem import EstimationProblem, build
from awescli.notation.parameters import Parameter, ParameterTable
from awescli.notation.quantities import OUTPUTS
from awescli.physics.kite import make_effect
from awescli.simulation.rollout import Columns
from awescli.simulation.scores import error
from awescli.tracing.candidates import Variant, variants
from awescli.tracing.criteria import CRITERIA
from awescli.tracing.frame import Frame, TracedFlight
from awescli.tracing.models import FittedModel

SHORT = 1.0
"""[s] of the segments that are screened."""


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
    horizon = SHORT if model.rest else frame.horizon
    every = [v for key in keys for v in variants(make_effect(key, frame.declared))]
    columns, n_free = CandidateColumns(every), len(model.fit.names)
    whole, gradient = informed(frame, model, keys, columns, horizon)
    # a parameter at its bound absorbs nothing any more
    held = model.at_bound
    free = np.array([i for i, name in enumerate(model.fit.names) if name not in held], int)
    absorbed = np.linalg.solve(whole[np.ix_(free, free)], whole[free, n_free:])
    joint = whole[n_free:, n_free:] - whole[n_free:, free] @ absorbed
    left = gradient[n_free:] - absorbed.T @ gradient[free]
    rows = model.problems[0].simulator.kite.parameters
    rows = {**{p.name: p for k in keys for p in _rows(frame, k)}, **rows}
    abrupt = {key for key in keys if make_effect(key, frame.declared).abrupt}
    return _scored(every, columns, joint, left, np.diag(whole)[n_free:], rows, abrupt)


def informed(
    frame: Frame, model: FittedModel, keys: Sequence[str], columns: "CandidateColumns", horizon: float
) -> tuple[np.ndarray, np.ndarray]:
    """(H, b) of all free parameters of a model, prior included, and behind them of the columns of candidates `keys`, from all flights in
    segments of `horizon` seconds."""
    names, n_free, n = model.fit.names, len(model.fit.names), len(columns)
    away, slope = model.fit.prior.deviations(names, model.fit.solution.x)
    whole, gradient = np.diag(np.r_[slope**2, np.zeros(n)]), np.r_[-slope * away, np.zeros(n)]
    for flight, problem, fitted, place in zip(frame.flights, model.problems, model.fit.flights, model.fit.places, strict=True):
        H, b = _says(flight, problem, fitted.parameters, model.keys, keys, columns, horizon)
        at = np.r_[place, n_free + np.arange(len(H) - len(place))]
        whole[np.ix_(at, at)] += H
        gradient[at] += b
    return whole, gradient


def _rows(frame: Frame, key: str) -> Sequence[Parameter]:
    return make_effect(key, frame.declared).rows()


def _says(
    flight: TracedFlight, problem: EstimationProblem, table: ParameterTable, added: Sequence[str], keys: Sequence[str],
    columns: "CandidateColumns", horizon: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """(H, b) of the model's parameters and all candidates' columns, from one flight in segments of `horizon` seconds."""
    simulator = flight.simulator((*added, *keys))
    rows = simulator.kite.parameters
    simulator = simulator.holding(rows.with_values({n: table[n].value for n in rows if n in table}))
    short = build(simulator, problem.log, problem.split, min(horizon, problem.horizon), problem.outputs, by_range=problem.by_range)
    short = replace(short.with_factors(problem.factors), processes=problem.processes, names=problem.names)
    misfit, x = short.misfit(), table.vector(problem.names)
    own = relaxed(misfit, x, misfit.own())
    names = (*misfit.names, *columns.names)
    info = misfit.information(x, own, names, lambda some, own: columns.further(some, x, own), len(columns.labels))
    return info.H, info.b


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
        self.labels = (
            *((v.label, m) for group in self.passes for v in group for m in v.moving),
            *((v.label, v.moving[0]) for v in self.secants),
        )
        self._place = {name: i for i, name in enumerate((*self.names, *self.labels))}

    def __len__(self) -> int:
        return len(self.names) + len(self.labels)

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


def _scored(
    every: Sequence[Variant], columns: CandidateColumns, joint: np.ndarray, gradient: np.ndarray, whole: np.ndarray,
    rows: dict[str, Parameter], abrupt: Collection[str],
) -> Screening:  # fmt: skip
    found: dict[str, list[Score]] = {}
    untestable = []
    for variant in every:
        local = columns.place(variant)
        diagonal = np.maximum(np.diag(joint)[local], 1e-300)
        reach = [_reach(rows[m], variant, m) for m in variant.moving][: len(local)]
        kept = [i for i in range(len(local)) if CRITERIA.detectable / np.sqrt(diagonal[i]) < reach[i] and whole[local[i]] > 1e-12]
        if not kept:
            untestable.append(variant.key)
            continue
        where = [local[i] for i in kept]
        A, s = firm(joint[np.ix_(where, where)]), gradient[where]
        size = np.linalg.solve(A, s)
        drop, std = float(s @ size), np.sqrt(np.diag(np.linalg.inv(A)))
        moving = tuple(variant.moving[i] for i in kept)
        p_value = float(stats.chi2.sf(drop, len(where)))
        score = Score(variant, moving, drop, size, std, p_value, float((whole[local] / diagonal)[kept].min()), tuple(where))
        if variant.secant and size[0] <= 0 and variant.key in abrupt:
            # a linear test says nothing of it: it is to be fitted all the same
            score = replace(score, drop=0.0, p_value=1.0)
        if not variant.secant or size[0] > 0 or variant.key in abrupt:
            found.setdefault(variant.key, []).append(score)
    best = [max(group, key=lambda s: s.drop) for group in found.values()]
    untestable = [k for k in dict.fromkeys(untestable) if k not in found]
    return Screening(tuple(sorted(best, key=lambda s: -s.drop)), tuple(untestable), joint, rows)


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
