"""Fit of a GaussianLaw: convex and sparse, then greedy, then least squares on the support.

Relaxed (l1) and greedy steps are combined after Novara, "Sparse identification of nonlinear functions and parametric Set Membership
optimality analysis", ACC 2011. Widths, number of centres and ridge are chosen by score_linear (held-out loops and flight ahead).
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from awescli.control.gaussian_law import design
from awescli.controller_fit.bounds import error_bounds, estimate_bounds, neighbour_pairs
from awescli.controller_fit.centres import farthest_points, thin
from awescli.controller_fit.config import ControllerConfig
from awescli.controller_fit.greedy import greedy_order
from awescli.controller_fit.hold import Hold
from awescli.controller_fit.lp import sparse_coefficients
from awescli.controller_fit.problem import Problem, fit_on_everything, score_linear
from awescli.controller_fit.ridge import well_conditioned

RIDGES = (1e-4, 3e-5, 1e-5, 3e-6)
CONDITION_SHARE = 0.7
"""Terms are counted up to this share of the condition that may be had: the last fit, on more samples, finds it a little different."""


def fit_gaussian(problem: Problem, config: ControllerConfig, holds: Iterable[Hold]) -> Iterator[tuple[dict, dict]]:
    """(fields of the GaussianLaw, report) for each hold, which is what is asked beside the samples. config: a ControllerConfig."""
    chosen_on = _Bases(problem, config, problem.rows)
    final = _Bases(problem, config, thin(problem.everything, problem.rows.size)) if config.refit_with_validation else chosen_on
    for hold in holds:
        yield _fit_held(problem, chosen_on, final, config, hold)


class _Bases:
    """What no hold changes: candidates among the states at `rows`, their regressors, the order they are taken in, and the convex step; each
    computed once. Choices are made with a basis from the train part; the law itself takes its own from the validation part too."""

    def __init__(self, problem: Problem, config: ControllerConfig, rows: np.ndarray):
        self.problem, self.config, self.rows = problem, config, rows
        self.candidates = problem.X[rows][farthest_points(problem.X[rows], config.candidates)]
        self.widths = [factor * np.sqrt(len(problem.features)) for factor in config.width_factors]
        self._kept: dict = {}

    def _once(self, key: tuple, make: Callable) -> Any:
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]

    def regressors(self, width: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(smoothed, measured, ahead)."""
        p = self.problem
        parts = (p.X[p.rows], p.M[p.rows], p.M[p.ahead])
        return self._once(("regressors", width), lambda: tuple(design(x, self.candidates, width) for x in parts))

    def convex(self, width: float) -> dict:
        return self._once(("convex", width), lambda: _convex_step(self.problem, self.rows, self.candidates, width, self.config))

    def order(self, width: float, relaxed: bool) -> np.ndarray:
        """Candidates, best first; relaxed: those of the convex step before the others."""
        return self._once(("order", width, relaxed), lambda: self._order(width, relaxed))

    def _order(self, width: float, relaxed: bool) -> np.ndarray:
        p, m, rows = self.problem, self.candidates.shape[0], thin(self.rows, self.config.selection_samples // 2)
        S = design(p.X[rows], self.candidates, width)
        preferred = self.convex(width)["support"] if relaxed else np.array([], dtype=int)
        order = greedy_order(S[:, :m], S[:, m:], p.U[rows], preferred, self.config.most_nonzeros, self.config.condition_limit)
        return order[: well_conditioned(S[:, m:], S[:, order], CONDITION_SHARE * self.config.condition_limit)]


def _fit_held(problem: Problem, bases: _Bases, final: _Bases, config: ControllerConfig, hold: Hold) -> tuple[dict, dict]:
    """(fields of the GaussianLaw, report): chosen with `bases`, taken from `final`."""
    candidates = final.candidates
    trials = [trial for w in bases.widths for trial in _trials(problem, bases, w, False, config, hold)]
    width = min(trials, key=lambda t: t["score"].value)["width"]
    if config.method != "greedy":
        trials += _trials(problem, bases, width, True, config, hold)
    chosen = min(trials, key=lambda t: (t["score"].value, t["order"].size))
    ridge, w = chosen["ridge"], chosen["width"]
    order, convex = final.order(w, chosen["relaxed"])[: chosen["order"].size], final.convex(w)

    rows = problem.everything if config.refit_with_validation else problem.train

    def solve(order):
        def regressors(X):
            return design(X, candidates[order], w)

        return fit_on_everything(problem, regressors, ridge, rows, hold.rows(regressors, rows.size))

    coefficients, conditioning = solve(order)
    while conditioning["condition_raw"] > config.condition_limit and order.size > 1:
        order = order[:-1]
        coefficients, conditioning = solve(order)
    centres = candidates[order]
    fields = {"centres": centres, "width": float(w), "coefficients": coefficients[: order.size].T, "affine": coefficients[order.size :].T}
    report = {
        "nonzeros": int(order.size),
        "width": float(w),
        **conditioning,
        "largest_coefficient_deg": float(np.degrees(np.abs(fields["coefficients"]).max())) if order.size else 0.0,
        "chosen_by": {"basis": _basis(chosen), **chosen["score"].row()},
        "convex": convex["report"],
        "trials": [_row(t) for t in trials],
        "gain": error_bounds(problem.U[convex["rows"]] - design(problem.X[convex["rows"]], centres, w) @ coefficients, convex["pairs"]),
    }
    return fields, report


def _basis(t: dict) -> str:
    return "convex, then greedy" if t["relaxed"] else "greedy"


def _row(t: dict) -> dict:
    """A trial as plain numbers for the report."""
    return {"basis": _basis(t), "width": float(t["width"]), "nonzeros": int(t["order"].size), "ridge": t["ridge"],
            **t["score"].row()}  # fmt: skip


def _trials(problem: Problem, bases: _Bases, width: float, relaxed: bool, config: ControllerConfig, hold: Hold) -> list[dict]:
    """Every number of centres at one width, each with its best ridge."""
    (S, M, A), order = bases.regressors(width), bases.order(width, relaxed)
    m = bases.candidates.shape[0]
    always = np.arange(m, S.shape[1])
    # the condition that may be had is also a bound on the ridge
    ridges = [r for r in RIDGES if 1.0 / r < config.condition_limit]
    asked = hold.rows(lambda X: design(X, bases.candidates, width), problem.rows.size)
    result = []
    for count in sorted({min(c, order.size) for c in (*config.counts, config.most_nonzeros) if c <= config.most_nonzeros}):
        take = np.concatenate([order[:count], always])
        extra = None if asked is None else (asked[0][:, take], asked[1])
        scores = score_linear(problem, S[:, take], M[:, take], A[:, take], ridges, extra=extra)
        ridge = min(scores, key=lambda r: scores[r].value)
        result.append({"relaxed": relaxed, "width": width, "order": order[:count], "ridge": ridge, "score": scores[ridge]})
    return result


def _convex_step(problem: Problem, rows: np.ndarray, candidates: np.ndarray, width: float, config: ControllerConfig) -> dict:
    """The l1 program for each surface on a subsample of `rows`; the union of the supports, and the bounds it rests on."""
    rows = thin(rows, config.convex_samples)
    pairs = neighbour_pairs(problem.X[rows], problem.loop[rows])
    D = design(problem.X[rows], candidates, width)
    m = candidates.shape[0]
    support, report = np.zeros(m, dtype=bool), []
    for s in range(problem.U.shape[1]):
        u = problem.U[rows, s]
        # neighbours differ by the law's own slope too: what the affine law explains of it is no noise
        residual = u - D[:, m:] @ np.linalg.lstsq(D[:, m:], u, rcond=None)[0]
        eps, gamma = estimate_bounds(residual, pairs)
        for alpha in config.alphas:
            # at alpha = 1 the sample bounds imply every pair's; above it those closer than this are needed
            near = config.gamma_share * gamma * pairs.distance < 2 * (alpha - 1.0) * eps
            few = type(pairs)(*(thin(x[near], config.convex_pairs) for x in (pairs.a, pairs.b, pairs.distance)))
            answer = sparse_coefficients(D[:, :m], D[:, m:], u, alpha * eps, few, config.gamma_share * gamma, eps)
            if answer.exceeding <= config.outliers:
                break
        a = np.abs(answer.coefficients)
        mine = a > 1e-6 * max(a.max(), 1e-300)
        support |= mine
        report.append({"eps": eps, "gamma": gamma, "alpha": alpha, "support": int(mine.sum()), "l1_norm": float(a.sum()),
                       "samples": int(rows.size), "pairs": int(few.a.size), "worst_slack": answer.worst_slack,
                       "share_beyond_bound": answer.exceeding, "solver": answer.status})  # fmt: skip
    return {"support": np.flatnonzero(support), "report": report, "rows": rows, "pairs": pairs}
