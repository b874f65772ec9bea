"""From a parameter table and a kite file's constraints to the `Limits` of a fit; constraints that cannot hold together are named."""

from collections.abc import Sequence

import numpy as np

from awescli.estimation.quadratic_program import Limits
from awescli.notation.constraints import LinearConstraint, contradiction
from awescli.notation.errors import BadInput
from awescli.notation.parameters import ParameterTable


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
    rows = {name: table[name] for c in held for name in c.factors}
    if clash := contradiction(held, {n: (p.lower, p.upper) if n in place else (p.value, p.value) for n, p in rows.items()}):
        raise BadInput(
            f"no parameter values inside their bounds satisfy {' and '.join(repr(c.text) for c in clash)}",
            "constraints", "Widen the bounds of the parameters, or drop a constraint.",
        )  # fmt: skip
    lower, upper = (np.array([getattr(table[n], end) for n in names]) for end in ("lower", "upper"))
    return Limits(lower, upper, A, low, high)
