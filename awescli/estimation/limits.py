"""From a parameter table and a kite file's constraints to the `Limits` of a fit; constraints that cannot hold together are named."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linprog

from awescli.estimation.quadratic_program import Limits
from awescli.notation.constraints import LinearConstraint
from awescli.notation.errors import BadInput
from awescli.notation.parameters import ParameterTable

SLACK = 1e-7
"""Violation, in prior standard deviations, below which a linear program counts a constraint as kept."""


def scaling(constraint: LinearConstraint, table: ParameterTable) -> float:
    """What one unit of a row of `Limits` is in the constraint's own unit: how far a prior standard deviation of each parameter moves it."""
    return float(np.linalg.norm([factor * table[name].prior_std for name, factor in constraint.factors.items()]))


def limits_of(table: ParameterTable, names: Sequence[str], constraints: Sequence[LinearConstraint]) -> Limits:
    """Bounds of the parameters `names`, and a row per constraint on any of them, in units of `scaling`; others count at their values.

    Raises BadInput where no values satisfy all of them.
    """
    held = [c for c in constraints if any(name in names for name in c.factors)]
    place = {name: i for i, name in enumerate(names)}
    A, low, high = np.zeros((len(held), len(names))), np.zeros(len(held)), np.zeros(len(held))
    for row, constraint in enumerate(held):
        unit = scaling(constraint, table)
        fixed = sum(factor * table[name].value for name, factor in constraint.factors.items() if name not in place)
        for name, factor in constraint.factors.items():
            if name in place:
                A[row, place[name]] = factor / unit
        low[row], high[row] = (constraint.lower - fixed) / unit, (constraint.upper - fixed) / unit
    limits = Limits(*(np.array([getattr(table[n], end) for n in names]) for end in ("lower", "upper")), A, low, high)
    if held and not _together(limits, range(len(held))):
        raise BadInput(
            f"no parameter values inside their bounds satisfy {_named([held[i].text for i in _conflict(limits)])}",
            "constraints", "Widen the bounds of the parameters, or drop a constraint.",
        )  # fmt: skip
    return limits


def _together(limits: Limits, rows: Sequence[int]) -> bool:
    """Can these rows hold together, inside the bounds?"""
    rows = list(rows)
    A, upper, lower = limits.A[rows], limits.high[rows] + SLACK, limits.low[rows] - SLACK
    both = np.vstack([A, -A])
    right = np.r_[upper, -lower]
    kept = np.isfinite(right)
    bounds = list(zip(limits.lower, limits.upper, strict=True))
    return linprog(np.zeros(A.shape[1]), both[kept], right[kept], bounds=bounds, method="highs").status != 2


def _conflict(limits: Limits) -> list[int]:
    """Rows that cannot hold together although all but any one of them can (deletion filter)."""
    rows = list(range(len(limits.low)))
    for row in list(rows):
        if not _together(limits, others := [r for r in rows if r != row]):
            rows = others
    return rows


def _named(texts: Sequence[str]) -> str:
    return " and ".join(f"'{text}'" for text in texts)
