"""Fit of a GaussianLaw by linear programmes alone: the law is a vertex of `controller_lp`, nothing is fitted after it.

Width of the Gaussians and bound of the error are chosen as everything else is, by unseen flight (`controller_problem.Score`). See
`controller_bounds` for what of Fagiano & Novara's setting could be verified.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from awescli.control.gaussian_law import design
from awescli.controller_fit.bounds import Pairs, error_bounds, estimate_bounds, neighbour_pairs
from awescli.controller_fit.centres import farthest_points, thin
from awescli.controller_fit.config import ControllerConfig
from awescli.controller_fit.hold import Hold
from awescli.controller_fit.lp import PENALTY, SparseSolution, sparse_coefficients
from awescli.controller_fit.problem import Problem, Score, span_error

BOUNDS = (0.25, 0.5, 1.0)
"""Bounds of the error that are tried, in units of eps. Below 1 some samples must lie beyond theirs: the slack then is the error that is
made small, and the bound what is not counted."""
FINAL = 2
"""Times as many samples as for a choice are used for the law itself."""
HELD = 100
"""Samples that were never flown (`controller_hold`), of those that are asked."""
NONE = 1e-6
"""Share of the largest coefficient below which one is zero."""


def fit_convex(problem: Problem, config: ControllerConfig, holds: Iterable[Hold]) -> Iterator[tuple[dict, dict]]:
    """(fields of the GaussianLaw, report) for each hold. config: a ControllerConfig."""
    widths = [factor * np.sqrt(len(problem.features)) for factor in config.width_factors]
    # first how wide, then how tight: one of each is wrong for none of the others
    trials = [_trial(problem, config, width, BOUNDS[1]) for width in widths]
    width = min(trials, key=lambda t: (t["score"].value, t["nonzeros"]))["width"]
    trials += [_trial(problem, config, width, alpha) for alpha in BOUNDS if alpha != BOUNDS[1]]
    usable = [t for t in trials if t["nonzeros"] <= config.most_nonzeros] or [min(trials, key=lambda t: t["nonzeros"])]
    chosen = min(usable, key=lambda t: (t["score"].value, t["nonzeros"]))
    rows = thin(problem.everything if config.refit_with_validation else problem.train, FINAL * config.convex_samples)
    final = _Programme.of(problem, rows, chosen["width"], config)
    for hold in holds:
        yield _fields(problem, final, final.solved(problem, chosen["alpha"], config, hold), chosen, trials)


@dataclass(frozen=True)
class _Programme:
    """What the programmes of one width are made from. D: (n, M + A) regressors at `rows`; M: candidates; bounds: (eps, gamma) of each
    surface."""

    rows: np.ndarray
    candidates: np.ndarray
    width: float
    D: np.ndarray
    pairs: Pairs
    bounds: tuple[tuple[float, float], ...]

    @classmethod
    def of(cls, problem: Problem, rows: np.ndarray, width: float, config: ControllerConfig) -> "_Programme":
        candidates = problem.X[rows][farthest_points(problem.X[rows], min(config.candidates, rows.size))]
        D, m = design(problem.X[rows], candidates, width), len(candidates)
        U, pairs = problem.U[rows], neighbour_pairs(problem.X[rows], problem.loop[rows])
        # neighbours differ by the law's own slope too: what the affine law explains of it is no noise
        left = U - D[:, m:] @ np.linalg.lstsq(D[:, m:], U, rcond=None)[0]
        return cls(rows, candidates, width, D, pairs, tuple(estimate_bounds(e, pairs) for e in left.T))

    def solved(self, problem: Problem, alpha: float, config: ControllerConfig, hold: Hold | None = None) -> list[SparseSolution]:
        """The solution for each surface."""
        m, D, U, price = len(self.candidates), self.D, problem.U[self.rows], np.full(len(self.D), PENALTY)
        if hold is not None and hold.strength > 0 and len(hold.X):
            asked = thin(np.arange(len(hold.X)), HELD)
            price = np.r_[price, np.full(len(asked), PENALTY * hold.strength * len(D) / len(asked))]
            D, U = np.concatenate([D, design(hold.X[asked], self.candidates, self.width)]), np.concatenate([U, hold.U[asked]])
        found = []
        for s, (eps, gamma) in enumerate(self.bounds):
            slope = config.gamma_share * gamma
            near = slope * self.pairs.distance < 2 * (alpha - 1.0) * eps
            few = Pairs(*(thin(x[near], config.convex_pairs) for x in (self.pairs.a, self.pairs.b, self.pairs.distance)))
            found.append(sparse_coefficients(D[:, :m], D[:, m:], U[:, s], alpha * eps, few, slope, eps, price))
        return found

    def predicted(self, X: np.ndarray, solutions: list[SparseSolution]) -> np.ndarray:
        return design(X, self.candidates, self.width) @ _weights(solutions)


def _weights(solutions: list[SparseSolution]) -> np.ndarray:
    """(M + A, S)"""
    return np.stack([np.r_[s.coefficients, s.affine] for s in solutions], axis=1)


def _support(solutions: list[SparseSolution]) -> np.ndarray:
    """(M,) which Gaussians any surface uses."""
    a = np.abs(np.stack([s.coefficients for s in solutions]))
    return (a > NONE * np.maximum(a.max(axis=1, keepdims=True), 1e-300)).any(axis=0)


def _trial(problem: Problem, config: ControllerConfig, width: float, alpha: float) -> dict:
    """One width and one bound, scored on held-out loops and ahead, each time by a programme that has not seen them."""
    n = config.convex_samples

    def missed(train: np.ndarray, unseen: np.ndarray) -> np.ndarray:
        programme = _Programme.of(problem, thin(train, n), width, config)
        return programme.predicted(problem.M[unseen], programme.solved(problem, alpha, config)) - problem.U[unseen]

    folds = [problem.fold == f for f in np.unique(problem.fold)]
    cv = np.concatenate([missed(problem.rows[~f], thin(problem.rows[f], n)) for f in folds])
    whole = _Programme.of(problem, thin(problem.rows, n), width, config)
    solutions = whole.solved(problem, alpha, config)
    unseen, late = problem.ahead[problem.unseen], problem.ahead[problem.late]
    ahead = whole.predicted(problem.M[unseen], solutions) - problem.U[unseen] if unseen.size else None
    far = missed(problem.rows[problem.early], late) if late.size and problem.early.any() else None
    score = Score(span_error(cv, problem.span), *(None if e is None else span_error(e, problem.span) for e in (ahead, far)))
    return {"width": width, "alpha": alpha, "nonzeros": int(_support(solutions).sum()), "score": score}


def _fields(problem: Problem, final: _Programme, solutions: list[SparseSolution], chosen: dict, trials: list[dict]) -> tuple[dict, dict]:
    """(fields of the law, report)."""
    used, weights, m = _support(solutions), _weights(solutions), len(final.candidates)
    kept = np.r_[used, np.ones(len(weights) - m, bool)]
    columns = final.D[:, kept]
    s = np.linalg.svd(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), compute_uv=False)
    condition = float(s[0] / s[-1]) if s[-1] > 0 else float("inf")
    fields = {
        "centres": final.candidates[used], "width": float(final.width), "coefficients": weights[:m][used].T, "affine": weights[m:].T,
    }  # fmt: skip
    errors = problem.U[final.rows] - columns @ weights[kept]
    report = {
        "nonzeros": int(used.sum()), "width": float(final.width), "condition": condition, "condition_raw": condition,
        "largest_coefficient_deg": float(np.degrees(np.abs(fields["coefficients"]).max(initial=0.0))),
        "chosen_by": {"basis": "convex", **chosen["score"].row()},
        "convex": [
            {"eps": eps, "gamma": gamma, "alpha": chosen["alpha"], "samples": int(final.rows.size), "solver": s.status,
             "l1_norm": float(np.abs(s.coefficients).sum()), "worst_slack": s.worst_slack if s.solved else None,
             "share_beyond_bound": s.exceeding if s.solved else None}
            for s, (eps, gamma) in zip(solutions, final.bounds, strict=True)
        ],
        "trials": [{"basis": "convex", "width": float(t["width"]), "alpha": t["alpha"], "nonzeros": t["nonzeros"], **t["score"].row()}
                   for t in trials],
        "gain": error_bounds(errors, final.pairs),
    }  # fmt: skip
    return fields, report
