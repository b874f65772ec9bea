"""Fit of a LinearLaw: ridge regression, the ridge chosen like everything else."""

from collections.abc import Iterable, Iterator

import numpy as np

from awescli.estimation.controller_problem import Problem, fit_on_everything, score_linear

RIDGES = (1e-6, 1e-4, 1e-3, 1e-2)


def affine_design(X: np.ndarray) -> np.ndarray:
    """[1, X], (N, 1 + F)."""
    return np.concatenate([np.ones((X.shape[0], 1)), X], axis=1)


def fit_linear(problem: Problem, config, holds: Iterable) -> Iterator[tuple[dict, dict]]:
    """(fields of the LinearLaw, report) for each hold, which is what is asked beside the samples."""
    return (_fit_held(problem, config, hold) for hold in holds)


def _fit_held(problem: Problem, config, hold) -> tuple[dict, dict]:
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
