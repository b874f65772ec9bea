"""Fit of a LinearLaw: ridge regression, the ridge chosen like everything else."""

from collections.abc import Iterable, Iterator

from awescli.controller_fit.config import ControllerConfig
from awescli.controller_fit.hold import Hold
from awescli.controller_fit.problem import Problem, fit_on_everything, score_linear
from awescli.controller_fit.ridge import affine_design

RIDGES = (1e-6, 1e-4, 1e-3, 1e-2)


def fit_linear(problem: Problem, config: ControllerConfig, holds: Iterable) -> Iterator[tuple[dict, dict]]:
    """(fields of the LinearLaw, report) for each hold, which is what is asked beside the samples."""
    return (_fit_held(problem, config, hold) for hold in holds)


def _fit_held(problem: Problem, config: ControllerConfig, hold: Hold) -> tuple[dict, dict]:
    scores = score_linear(
        problem,
        affine_design(problem.X[problem.rows]),
        affine_design(problem.M[problem.rows]),
        affine_design(problem.M[problem.ahead]),
        RIDGES,
        extra=hold.rows(affine_design, problem.rows.size),
    )
    ridge = min(scores, key=lambda r: scores[r].value)
    rows = problem.everything if config.refit_with_validation else problem.train
    coefficients, conditioning = fit_on_everything(problem, affine_design, ridge, rows, hold.rows(affine_design, rows.size))
    return {"affine": coefficients.T}, {"nonzeros": int(coefficients.shape[0]), **conditioning, "chosen_by": scores[ridge].row()}
