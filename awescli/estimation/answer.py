"""What a fit says about its own answer: standard deviations, correlations, what the flight does not excite, what sits at a bound."""

from collections.abc import Sequence

import numpy as np

from awescli.estimation.limits import scaling
from awescli.estimation.simulation_error import Fit
from awescli.notation.parameters import ParameterTable

EXCITED = 0.5
"""A parameter whose standard deviation is still more than this share of its prior's was hardly seen by the flight."""
COLLINEAR = 0.95
"""Correlation beyond which two parameters are named as a pair that only their combination is known of."""


def describe(fit: Fit, prior: ParameterTable, record: Sequence[str] = ()) -> dict:
    """Per free parameter: value, std (scaled by the residual's level where that is above the noise), prior, shift, flags, advice.

    std is the Gauss-Newton posterior standard deviation; excited: std < half of the prior's; at_bound: the value sits at an end of
    its range; partners: parameters correlated by more than 0.95. record: names of nuisance parameters, listed apart.
    """
    scale = np.sqrt(max(fit.chi2, 1.0))
    std = np.sqrt(np.diag(fit.covariance)) * scale
    correlation = (
        fit.covariance / np.outer(np.sqrt(np.diag(fit.covariance)), np.sqrt(np.diag(fit.covariance))) if len(std) else np.zeros((0, 0))
    )
    rows, errors = {}, {}
    for i, name in enumerate(fit.names):
        if name in record:
            errors[name] = {"value": fit.parameters[name].value, "std": float(std[i]), "unit": fit.parameters[name].unit}
            continue
        p, before = fit.parameters[name], prior[name]
        width = p.upper - p.lower
        partners = [fit.names[j] for j in np.flatnonzero(np.abs(correlation[i]) > COLLINEAR) if j != i]
        at_bound = bool(np.isfinite(width) and min(p.value - p.lower, p.upper - p.value) < 1e-6 * width)
        excited = bool(std[i] < EXCITED * before.prior_std)
        rows[name] = {
            "value": p.value, "std": float(std[i]), "unit": p.unit,
            "prior": before.value, "prior_std": float(before.prior_std),
            "shift_in_prior_std": float((p.value - before.value) / before.prior_std),
            "excited": excited, "at_bound": at_bound, "partners": partners,
            "advice": _advice(excited, at_bound, partners),
        }  # fmt: skip
    return {
        "parameters": rows,
        "wind_record_error": errors,
        "constraints": _constraints(fit),
        "correlation": {"names": list(fit.names), "matrix": np.round(correlation, 6).tolist()},
        "weakest_direction": _weakest(fit, prior),
    }


def _constraints(fit: Fit) -> list[dict]:
    """Every constraint on a fitted parameter: value of its sum, whether it is active, and what the cost (chi-square) would fall by if
    its limit were moved outwards by one unit."""
    rows = []
    held = [c for c in fit.constraints if any(name in fit.names for name in c.factors)]
    for constraint, multiplier in zip(held, fit.solution.multipliers[len(fit.names) :], strict=True):
        value = constraint.value({name: fit.parameters[name].value for name in constraint.factors})
        cost = abs(float(multiplier)) / scaling(constraint, fit.parameters)
        active = constraint.lower == constraint.upper or cost > 0
        rows.append({"constraint": constraint.text, "value": value, "active": active, "cost_per_unit": cost})
    return rows


def _advice(excited: bool, at_bound: bool, partners: list[str]) -> str:
    if at_bound:
        return "at its bound: the bound is wrong, or the model lacks an effect that this parameter stands in for (see trace-residual)"
    if not excited:
        return "hardly seen by this flight: kept near its prior; a manoeuvre that moves what it multiplies would show it"
    if partners:
        return f"known only together with {', '.join(partners)}"
    return ""


def _weakest(fit: Fit, prior: ParameterTable) -> dict:
    """The direction, in units of prior standard deviations, that the flight tells least of (scaled Jacobian's smallest singular value)."""
    if not fit.names:
        return {}
    scale = np.array([prior[n].prior_std for n in fit.names])
    H = fit.information.H.sum(0) * np.outer(scale, scale)
    values, vectors = np.linalg.eigh(H)
    order = np.argsort(-np.abs(vectors[:, 0]))[:5]
    return {
        "singular_value": float(np.sqrt(max(values[0], 0.0))),
        "condition": float(np.sqrt(max(values[-1], 0.0) / max(values[0], 1e-300))) if values[0] > 0 else None,
        "parameters": {fit.names[i]: float(vectors[i, 0]) for i in order},
    }
