"""What a fit says about its own answer: standard deviations, correlations, what the flights do not excite, what sits at a limit."""

from collections.abc import Collection, Mapping
from itertools import product

import numpy as np
from scipy.linalg import qr

from awescli.estimation.fitted import JointFit
from awescli.estimation.limits import scaling

EXCITED = 0.5
"""A parameter whose standard deviation is still more than this share of its prior's was hardly seen by the flight."""
MOVED = 1.0
"""Prior standard deviations beyond which a parameter is not near its prior any more."""
COLLINEAR = 0.95
"""Correlation beyond which two parameters are named as a pair that only their combination is known of."""


UNSEEN = 1.0
"""Singular value of the Jacobian, scaled to the prior's standard deviations and the noise, below which the prior says more about a
direction than the flights do."""
SAME_SHARE = 0.1
"""Relative difference up to which the changes of parameters along a direction count as one common factor."""
UNSEEN_SHARE = 1.0
"""Information on a relative change below which not even a change of 100 % would be seen."""
MOST_DIRECTIONS = 12
"""Largest null space whose combinations are searched for common factors."""


INTERVAL = 1.959964
"""Standard deviations to either side that hold 95 % of a normal distribution."""


def interval(value: float, std: float) -> list[float]:
    """[low, high] of the 95 % interval."""
    return [value - INTERVAL * std, value + INTERVAL * std]


def describe(
    fit: JointFit, record: Collection[str] = (), flight_of: Mapping[str, str] | None = None, phase_of: Mapping[str, str] | None = None
) -> dict:
    """Per free parameter: value, std, prior, shift, flags, advice, and `determined`: "well" (excited), "hardly" (near its prior still), or
    "poorly" (it moved by more than MOVED, or to a bound, though the flight does not say where it is).

    std is that of the fit's covariance (`staged_fit` has added what coloured residuals do); excited: std < half of the prior's;
    interval: 95 %; at_bound: it sits at an end of its range; partners: parameters correlated by more than 0.95. record: names of nuisance
    parameters, listed apart. flight_of: name -> the flight that it belongs to, where it belongs to one alone; phase_of: the same of phases.
    """
    belongs = {"flight": flight_of or {}, "phase": phase_of or {}}
    std = np.sqrt(np.diag(fit.covariance))
    correlation = _correlation(fit.covariance)
    rows, errors = {}, {}
    for i, name in enumerate(fit.names):
        whose = {what: of[name] for what, of in belongs.items() if name in of}
        if name in record:
            errors[name] = {"value": fit.parameters[name].value, "std": float(std[i]), "unit": fit.parameters[name].unit, **whose}
            continue
        p, before = fit.parameters[name], fit.prior[name]
        width = p.upper - p.lower
        partners = [fit.names[j] for j in np.flatnonzero(np.abs(correlation[i]) > COLLINEAR) if j != i]
        at_bound = bool(np.isfinite(width) and min(p.value - p.lower, p.upper - p.value) < 1e-6 * width)
        excited = bool(std[i] < EXCITED * before.prior_std)
        shift = float((p.value - before.value) / before.prior_std)
        determined = "well" if excited else "poorly" if at_bound or abs(shift) > MOVED else "hardly"
        rows[name] = {
            "value": p.value, "std": float(std[i]), "interval": interval(p.value, float(std[i])), "unit": p.unit,
            "prior": before.value, "prior_std": float(before.prior_std),
            "shift_in_prior_std": shift,
            "excited": excited, "at_bound": at_bound, "determined": determined, "partners": partners,
            "advice": _advice(determined, at_bound, partners), **whose,
        }  # fmt: skip
    return {
        "parameters": rows,
        "wind_record_error": errors,
        "constraints": _constraints(fit),
        "correlation": {"names": list(fit.names), "matrix": np.round(correlation, 6).tolist()},
        **_directions(fit, record),
    }


def _correlation(covariance: np.ndarray) -> np.ndarray:
    """Correlations; of a parameter that equalities leave no freedom none with any other."""
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    both = np.outer(std, std)
    correlation = np.divide(covariance, both, out=np.zeros_like(both), where=both > 0)
    np.fill_diagonal(correlation, 1.0)
    return correlation


def _constraints(fit: JointFit) -> list[dict]:
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


def _advice(determined: str, at_bound: bool, partners: list[str]) -> str:
    if at_bound:
        poorly = ", though this flight hardly sees it" if determined == "poorly" else ""
        return f"at its bound{poorly}: the bound is wrong, or the model lacks an effect that it stands in for (see trace-residual)"
    if determined == "poorly":
        moved = "more than one prior standard deviation off, though this flight hardly sees it"
        return f"{moved}: it follows other parameters or stands in for a missing effect, and says little by itself"
    if determined == "hardly":
        return "hardly seen by this flight: kept near its prior; a manoeuvre that moves what it multiplies would show it"
    if partners:
        return f"known only together with {', '.join(partners)}"
    return ""


def _directions(fit: JointFit, record: Collection[str]) -> dict:
    """The directions, in units of prior standard deviations, that the flights tell least of: right singular vectors of the scaled Jacobian.

    weakest_direction: that of the smallest singular value; unseen_directions: all that the prior knows better than the flights.
    """
    kept = np.array([i for i, n in enumerate(fit.names) if n not in record], dtype=int)
    if not len(kept):
        return {"weakest_direction": {}, "unseen_directions": [], "common_factors": []}
    scale = np.array([fit.prior[fit.names[i]].prior_std for i in kept])
    values, vectors = np.linalg.eigh(fit.known[np.ix_(kept, kept)] * np.outer(scale, scale))
    singular = np.sqrt(np.maximum(values, 0.0))
    found = [
        {
            "singular_value": float(singular[i]),
            "parameters": {fit.names[kept[j]]: float(v[j]) for j in np.argsort(-np.abs(v))[:5] if abs(v[j]) > 0.1},
        }
        for i, v in enumerate(vectors.T)
    ]
    condition = float(singular[-1] / singular[0]) if singular[0] > 0 else None
    return {
        "weakest_direction": {**found[0], "condition": condition},
        "unseen_directions": [d for d in found if d["singular_value"] < UNSEEN],
        "common_factors": [
            {"parameters": names, "says": f"a common factor of {', '.join(names)} cannot be determined: only their ratios are known"}
            for names in common_factors(fit, kept)
        ],
    }


def common_factors(fit: JointFit, kept: np.ndarray) -> list[list[str]]:
    """Groups of parameters that may all be multiplied by one factor without any change that the flights show.

    Such a factor multiplies both sides of an equation: inertias, moment coefficients and attachment arm in the moment equation. It is a
    vector of ones and zeros in the null space of the Jacobian with respect to relative changes; that space holds other directions too
    (a constant deflection's derivative and the trim coefficient), so their combinations are tried. kept: places of the parameters.
    """
    value = fit.parameters.vector([fit.names[i] for i in kept])
    known = fit.known[np.ix_(kept, kept)] * np.outer(value, value)
    # a parameter that is not seen by itself belongs to every group and to none
    seen = np.flatnonzero(np.diag(known) > UNSEEN_SHARE)
    values, vectors = np.linalg.eigh(known[np.ix_(seen, seen)])
    N = vectors[:, values < UNSEEN_SHARE]
    if not 0 < N.shape[1] <= MOST_DIRECTIONS:
        return []
    *_, order = qr(N.T, pivoting=True, mode="r")
    pivots = np.asarray(order)[: N.shape[1]]
    basis = N @ np.linalg.inv(N[pivots])
    groups: list[frozenset[int]] = []
    for pattern in sorted(product((0, 1), repeat=len(pivots)), key=sum)[1:]:
        v = basis @ pattern
        group = frozenset(np.flatnonzero(v > 0.5).tolist())
        binary = np.abs(v - (v > 0.5)).max() < SAME_SHARE
        if binary and not any(smaller < group for smaller in groups):
            groups.append(group)
    return [[fit.names[kept[seen[i]]] for i in sorted(group)] for group in groups if len(group) > 2]
