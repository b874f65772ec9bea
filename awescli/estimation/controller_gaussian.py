"""Fit of a GaussianLaw: convex and sparse, then greedy, then least squares on the support.

Relaxed (l1) and greedy steps are combined after Novara, "Sparse identification of nonlinear functions and parametric Set Membership
optimality analysis", ACC 2011. Widths, number of centres and ridge are chosen by score_linear (held-out loops and flight ahead).
"""

import numpy as np

from awescli.control.gaussian_law import design
from awescli.estimation.controller_bounds import estimate_bounds, lipschitz_of_error, neighbour_pairs, small_gain
from awescli.estimation.controller_centres import farthest_points, thin
from awescli.estimation.controller_greedy import greedy_order
from awescli.estimation.controller_hold import Hold
from awescli.estimation.controller_lp import sparse_coefficients
from awescli.estimation.controller_problem import Problem, fit_on_everything, score_linear

RIDGES = (1e-4, 3e-5, 1e-5, 3e-6)
SELECTION_ROWS = 2500


def fit_gaussian(problem: Problem, config, hold: Hold) -> tuple[dict, dict]:
    """(fields of the GaussianLaw, report). config: a ControllerConfig; hold: slopes asked for beside the samples."""
    candidates = problem.X[problem.rows][farthest_points(problem.X[problem.rows], config.candidates)]
    widths = [factor * np.sqrt(len(problem.features)) for factor in config.width_factors]
    nothing = np.array([], dtype=int)
    trials = [trial for w in widths for trial in _trials(problem, candidates, w, nothing, "greedy", config, hold)]
    width = min(trials, key=lambda t: t["score"].value)["width"]
    convex = _convex_step(problem, candidates, width, config)
    trials += _trials(problem, candidates, width, convex["support"], "convex, then greedy", config, hold)
    best = min(t["score"].value for t in trials)
    # the sparsest of those that can hardly be told from the best, and of these the widest: it bends least between and beyond the data
    chosen = min((t for t in trials if t["score"].value <= 1.05 * best), key=lambda t: (t["order"].size, -t["width"], t["score"].value))
    order, ridge, w = chosen["order"], chosen["ridge"], chosen["width"]

    rows = problem.everything if config.refit_with_validation else problem.train

    def solve(order):
        return fit_on_everything(
            problem, lambda X: design(X, candidates[order], w), ridge, rows, hold.rows(problem, candidates[order], w, rows.size)
        )

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
        "chosen_by": {"basis": chosen["basis"], "cv_nrmse": chosen["score"].cv, "ahead_nrmse": chosen["score"].ahead},
        "convex": convex["report"],
        "trials": [_row(t) for t in trials],
        "gain": _gains(problem, design(problem.X[convex["rows"]], centres, w) @ coefficients, convex, config),
    }
    return fields, report


def _row(t: dict) -> dict:
    """A trial as plain numbers for the report."""
    return {"basis": t["basis"], "width": float(t["width"]), "nonzeros": int(t["order"].size), "ridge": t["ridge"],
            "cv_nrmse": t["score"].cv, "ahead_nrmse": t["score"].ahead}  # fmt: skip


def _trials(problem: Problem, candidates, width: float, preferred, basis: str, config, hold: Hold) -> list[dict]:
    """Every number of centres at one width, each with its best ridge."""
    S, M, A = (design(x, candidates, width) for x in (problem.X[problem.rows], problem.M[problem.rows], problem.M[problem.ahead]))
    m = candidates.shape[0]
    always = np.arange(m, S.shape[1])
    pick = thin(np.arange(problem.rows.size), SELECTION_ROWS)
    order = greedy_order(S[pick, :m], S[pick, m:], problem.U[problem.rows[pick]], preferred, config.most_nonzeros, config.condition_limit)
    result = []
    for count in sorted({min(c, order.size) for c in (*config.counts, config.most_nonzeros) if c <= config.most_nonzeros}):
        take = np.concatenate([order[:count], always])
        # the condition that may be had is also a bound on the ridge
        ridges = [r for r in RIDGES if 1.0 / r < config.condition_limit]
        scores = score_linear(
            problem,
            S[:, take],
            M[:, take],
            A[:, take],
            ridges,
            extra=hold.rows(problem, candidates[order[:count]], width, problem.rows.size),
        )
        ridge = min(scores, key=lambda r: scores[r].value)
        result.append({"basis": basis, "width": width, "order": order[:count], "ridge": ridge, "score": scores[ridge]})
    return result


def _convex_step(problem: Problem, candidates, width: float, config) -> dict:
    """The l1 program for each surface on a subsample; the union of the supports, and the bounds it rests on."""
    rows = thin(problem.rows, config.convex_samples)
    pairs = neighbour_pairs(problem.X[rows], problem.loop[rows])
    D = design(problem.X[rows], candidates, width)
    m = candidates.shape[0]
    support, report = np.zeros(m, dtype=bool), []
    bounds = []
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
        bounds.append((eps, gamma))
        report.append({"eps": eps, "gamma": gamma, "alpha": alpha, "support": int(mine.sum()), "l1_norm": float(a.sum()),
                       "samples": int(rows.size), "pairs": int(few.a.size), "worst_slack": answer.worst_slack,
                       "share_beyond_bound": answer.exceeding, "solver": answer.status})  # fmt: skip
    return {"support": np.flatnonzero(support), "report": report, "rows": rows, "pairs": pairs, "bounds": bounds}


def _gains(problem: Problem, fitted: np.ndarray, convex: dict, config) -> list[dict]:
    """The small-gain condition per surface; fitted: (n, S) at convex['rows']."""
    errors = problem.U[convex["rows"]] - fitted
    return [
        small_gain(lipschitz_of_error(errors[:, s], convex["pairs"], eps, config.gain_quantile), config.plant_gain)
        for s, (eps, _) in enumerate(convex["bounds"])
    ]
