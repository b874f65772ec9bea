"""Screen all candidates at once: score tests from exact sensitivities, orthogonal to what re-fitting can absorb."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from awescli.estimation.information import Information
from awescli.estimation.simulation_error import SimulationError
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Columns
from awescli.simulation.scores import error
from awescli.tracing.candidates import Variant, outputs_at, variants

DETECTABLE = 3.5
"""A strength is detectable from this many standard deviations on; one that is not detectable inside its range is not testable."""


@dataclass(frozen=True)
class Score:
    """What the null model's residual says about one candidate.

    variant: the shape and probe that did best; moving: the strengths that are not absorbed; drop: predicted fall of the cost;
    size: one-step estimate of `moving`; p_value: of the likelihood ratio; agreement: p-value of a t-test on what the segments contribute;
    std: of `size`;
    inflation: least variance inflation of its columns; direction: whitened column space, for the angle between candidates.
    """

    variant: Variant
    moving: tuple[str, ...]
    drop: float
    size: np.ndarray
    std: np.ndarray
    p_value: float
    agreement: float
    inflation: float
    gradient: np.ndarray
    information: np.ndarray
    place: tuple[int, ...]

    @property
    def key(self) -> str:
        return self.variant.key


@dataclass(frozen=True)
class Screening:
    """All scores, best first; untestable: effects that the free parameters absorb; joint: information of all columns after projection;
    absorbed: (n_free, n) what the free parameters do of each column; information: of the free parameters and all columns."""

    scores: tuple[Score, ...]
    untestable: tuple[str, ...]
    joint: np.ndarray
    absorbed: np.ndarray
    information: Information

    def step(self, score: Score, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Changes of the free parameters (n_free,) and the own unknowns (K, n_own) that go with a candidate at `size`, to first order."""
        place, n_free = list(score.place), len(self.absorbed)
        change = np.zeros(n_free + len(self.joint))
        change[:n_free] = -self.absorbed[:, place] @ size
        change[n_free + np.array(place)] = size
        return change[:n_free], np.stack([self.information.own(k, change) for k in range(len(self.information.back))])

    def cosine(self, a: Score, b: Score) -> float:
        """Largest canonical correlation between two candidates: 1 means that the flight cannot tell them apart."""
        A, B = self.joint[np.ix_(a.place, a.place)], self.joint[np.ix_(b.place, b.place)]
        C = self.joint[np.ix_(a.place, b.place)]
        La, Lb = np.linalg.cholesky(_safe(A)), np.linalg.cholesky(_safe(B))
        middle = np.linalg.solve(La, np.linalg.solve(Lb, C.T).T)
        return float(min(np.linalg.svd(middle, compute_uv=False)[0], 1.0))


def _reach(problem, variant: Variant, name: str) -> float:
    """How far a strength may plausibly go from null (in probes for a secant)."""
    p = problem.simulator.kite.parameters[name]
    reach = max(p.upper - p.value, p.value - p.lower)
    return reach / abs(variant.at[name]) if variant.secant else reach


def _safe(A: np.ndarray) -> np.ndarray:
    return A + 1e-9 * np.diag(np.diag(A)) + 1e-300 * np.eye(len(A))


def screen(
    problem: SimulationError, x: np.ndarray, precision: np.ndarray, centre: np.ndarray, kite: Kite, keys: Sequence[str]
) -> Screening:
    """Score every candidate effect of `keys` at the null fit (parameters x, own unknowns in `problem`).

    precision, centre: prior of the free parameters. The columns of a candidate are projected on the complement of the free
    parameters, so that what a re-fit would absorb does not count.
    """
    every = [v for e in kite.effects if e.key in keys for v in variants(e)]
    names, secants, further = _columns(problem, x, every)
    info, _ = problem.information(x, parameters=(*problem.names, *names), extra=further, integrate=True)
    n_free = len(problem.names)
    place = {name: n_free + i for i, name in enumerate(names)}
    place.update({label: n_free + len(names) + i for i, label in enumerate(secants)})
    per_segment = info.b + np.nan_to_num(info.tilt)
    H, b = info.H.sum(0), per_segment.sum(0)
    H[:n_free, :n_free] += np.diag(precision)
    b = b.copy()
    b[:n_free] += precision * (centre - x)
    absorbed = np.linalg.solve(H[:n_free, :n_free], H[:n_free, n_free:])
    joint = H[n_free:, n_free:] - H[n_free:, :n_free] @ absorbed
    gradient = b[n_free:] - absorbed.T @ b[:n_free]
    per_segment = per_segment[:, n_free:] - per_segment[:, :n_free] @ absorbed
    scale = max(1.0, float(info.cost.sum() / max(info.dof.sum() - n_free, 1)))
    whole = np.diag(H)[n_free:]
    found: dict[str, list[Score]] = {}
    untestable = []
    for variant in every:
        columns = [place[(variant.label, m)] if variant.secant or variant.at else place[m] for m in variant.moving]
        local = [c - n_free for c in columns]
        inflation = whole[local] / np.maximum(np.diag(joint)[local], 1e-300)
        least = DETECTABLE * np.sqrt(scale / np.maximum(np.diag(joint)[local], 1e-300))
        reach = [_reach(problem, variant, m) for m in variant.moving]
        kept = [i for i in range(len(local)) if least[i] < reach[i] and whole[local[i]] > 1e-12]
        if not kept:
            untestable.append(variant.key)
            continue
        where = [local[i] for i in kept]
        A, s = _safe(joint[np.ix_(where, where)]), gradient[where]
        size = np.linalg.solve(A, s)
        drop = float(s @ size)
        p, agreement = _p_values(drop, len(where), scale, per_segment[:, where] @ size)
        std = np.sqrt(np.diag(np.linalg.inv(A)) * scale)
        moving = tuple(variant.moving[i] for i in kept)
        score = Score(variant, moving, drop, size, std, p, agreement, float(inflation[kept].min()), s, A, tuple(where))
        if not variant.secant or size[0] > 0:
            found.setdefault(variant.key, []).append(score)
    best = [max(group, key=lambda s: s.drop) for group in found.values()]
    untestable = [k for k in dict.fromkeys(untestable) if k not in found]
    return Screening(tuple(sorted(best, key=lambda s: -s.drop)), tuple(untestable), joint, absorbed, info)


def _columns(problem, x, every: Sequence[Variant]):
    """(names of plain tangents at null, labels of the further columns, own unknowns -> further columns (K, N+1, n_out, n))."""
    names = list(dict.fromkeys(m for v in every if not v.at for m in v.moving))
    # tangents at shape values: variants that only set shapes can share a pass, for at null strength a shape changes nothing
    passes: list[list[Variant]] = []
    for v in (v for v in every if v.at and not v.secant):
        group = next((g for g in passes if all(o.key != v.key for o in g)), None)
        passes.append([v]) if group is None else group.append(v)
    secants = [v for v in every if v.secant]
    labels = [*((v.label, m) for group in passes for v in group for m in v.moving), *((v.label, v.moving[0]) for v in secants)]

    def further(own: np.ndarray) -> np.ndarray:
        segments, columns = problem.segments(own), []
        for group in passes:
            values = {**problem.values(x), **{k: value for v in group for k, value in v.at.items()}}
            moving = tuple(m for v in group for m in v.moving)
            columns.append(problem.simulator.sensitivities(segments, Columns((), moving), problem.observed.outputs, values)[1])
        base, alive = outputs_at(problem, segments, x, {})
        for v in secants:
            there, there_alive = outputs_at(problem, segments, x, v.at)
            reached = np.arange(base.shape[1])[None] < np.minimum(alive, there_alive)[:, None]
            difference = np.stack([error(there[:, :, i], base[:, :, i], n) for i, n in enumerate(problem.observed.outputs)], axis=-1)
            # in units of the probe: a one-step size of 1 means the probe itself
            columns.append(np.where(reached[:, :, None], difference, 0.0)[..., None])
        return np.concatenate(columns, axis=-1)

    return names, labels, further if labels else None


def _p_values(drop: float, count: int, scale: float, contributions: np.ndarray) -> tuple[float, float]:
    """Likelihood ratio with the residual's own level, and a t-test on the segments' contributions."""
    ratio = float(stats.chi2.sf(drop / scale, count))
    K = len(contributions)
    spread = contributions.std(ddof=1) / np.sqrt(K) if K > 2 else np.inf
    t = contributions.mean() / spread if spread > 0 else 0.0
    return ratio, float(stats.t.sf(t, K - 1))


def holm(p_values: Sequence[float], level: float = 0.01) -> np.ndarray:
    """Which hypotheses are rejected when all are tested together (Holm 1979)."""
    p = np.asarray(p_values)
    order = np.argsort(p)
    limit = level / (len(p) - np.arange(len(p)))
    passed = np.cumprod(p[order] <= limit).astype(bool)
    result = np.zeros(len(p), bool)
    result[order] = passed
    return result
