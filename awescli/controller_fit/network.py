"""Fit of a NetworkLaw: the affine law first, then a tanh network on what it leaves; full-batch L-BFGS in double precision.

Deterministic: seeded start, full batch, one thread's order of sums. The weight decay is chosen on the validation part.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from awescli.controller_fit.centres import thin
from awescli.controller_fit.config import ControllerConfig
from awescli.controller_fit.hold import Hold
from awescli.controller_fit.problem import Problem
from awescli.controller_fit.ridge import affine_design

DECAYS = (1e-6, 1e-5, 1e-4)


def fit_network(problem: Problem, config: ControllerConfig, holds: Iterable) -> Iterator[tuple[dict, dict]]:
    """(fields of the NetworkLaw, report) for each hold, which is what is asked beside the samples."""
    return (_fit_held(problem, config, hold) for hold in holds)


def _fit_held(problem: Problem, config: ControllerConfig, hold: Hold) -> tuple[dict, dict]:
    train = thin(problem.rows, 2500)
    trials = []
    ahead_rows = problem.ahead[problem.unseen]
    if ahead_rows.size:
        for decay in DECAYS:
            fields = _train(problem, train, decay, config, hold, config.network_iterations // 2)
            error = _forward(fields, problem.M[ahead_rows]) - problem.U[ahead_rows]
            trials.append((float(np.mean(np.sqrt((error**2).mean(axis=0)) / problem.span)), decay))
        ahead, decay = min(trials)
    else:
        ahead, decay = None, DECAYS[1]
    final = thin(problem.everything, 4000) if config.refit_with_validation else train
    fields = _train(problem, final, decay, config, hold, config.network_iterations)
    weights = sum(a.size for a in fields.values())
    report = {"nonzeros": int(weights), "condition": None, "decay": decay, "samples": int(final.size),
              "chosen_by": {"score": ahead, "cv_nrmse": None, "ahead_nrmse": ahead, "far_nrmse": None},
              "trials": [{"decay": d, "ahead_nrmse": e} for e, d in trials]}  # fmt: skip
    return fields, report


def _forward(fields: dict, X: np.ndarray) -> np.ndarray:
    h = np.tanh(np.tanh(X @ fields["weights_1"].T + fields["bias_1"]) @ fields["weights_2"].T + fields["bias_2"])
    return h @ fields["weights_3"].T + affine_design(X) @ fields["affine"].T


def _train(
    problem: Problem, rows: np.ndarray, decay: float, config: ControllerConfig, hold: Hold, iterations: int
) -> dict[str, np.ndarray]:
    """Weights from the rows' smoothed states and the hold's displaced ones, in rad."""
    import torch

    unit = problem.U[rows].std(axis=0)
    X, U = np.concatenate([problem.X[rows], hold.X]), np.concatenate([problem.U[rows], hold.U])
    share = hold.strength**2 * rows.size / max(hold.X.shape[0], 1)
    weight = np.concatenate([np.ones(rows.size), np.full(hold.X.shape[0], share)])[:, None]
    A = affine_design(X)
    # of several surfaces a transpose is not contiguous, which LBFGS does not take
    start = np.ascontiguousarray(np.linalg.lstsq(np.sqrt(weight) * A, np.sqrt(weight) * U / unit, rcond=None)[0].T)
    random = np.random.default_rng(config.seed)
    f, s, h = X.shape[1], U.shape[1], config.network_width
    shapes = {"weights_1": (h, f), "bias_1": (h,), "weights_2": (h, h), "bias_2": (h,), "weights_3": (s, h)}
    # the last layer starts at zero: the network begins as the affine law and can only improve on it
    values = {k: np.zeros(n) if k in ("weights_3", "bias_2") else random.normal(size=n) / np.sqrt(n[-1]) for k, n in shapes.items()}
    p = {k: torch.tensor(v, dtype=torch.float64, requires_grad=True) for k, v in (values | {"affine": start}).items()}
    Xt, At, Ut, Wt = (torch.tensor(a, dtype=torch.float64) for a in (X, A, U / unit, weight / rows.size / U.shape[1]))

    def loss():
        hidden = torch.tanh(torch.tanh(Xt @ p["weights_1"].T + p["bias_1"]) @ p["weights_2"].T + p["bias_2"])
        misfit = (Wt * (hidden @ p["weights_3"].T + At @ p["affine"].T - Ut) ** 2).sum()
        return misfit + decay * sum((p[k] ** 2).sum() for k in ("weights_1", "weights_2", "weights_3")) / h

    solver = torch.optim.LBFGS(p.values(), max_iter=iterations, history_size=50, line_search_fn="strong_wolfe", tolerance_change=1e-12)

    def closure():
        solver.zero_grad()
        value = loss()
        value.backward()
        return value

    # a second thread gains nothing on matrices this small, changes the order of sums, and waits for cores that others use
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        solver.step(closure)
    finally:
        torch.set_num_threads(threads)
    fields = {k: v.detach().numpy().copy() for k, v in p.items()}
    for name in ("weights_3", "affine"):
        fields[name] = fields[name] * unit[:, None]
    return fields
