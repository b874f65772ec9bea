"""Linear constraints between parameters, as a kite file writes them: `Jx + Jz >= Jy`, `2*CYb + 0.1 <= CYp`, `Cl_bias = 0.5*Cn_bias`."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from awescli.notation.errors import BadInput

LONGEST, LONGEST_NUMBER = 500, 40
"""Characters of a constraint, and of a number in it: read by a regular expression, whose time grows faster than the text."""
LARGEST, SMALLEST = 1e12, 1e-12
"""Of the numbers in a constraint, 0 aside: with others the sums of a linear program are not to be trusted."""
SLACK = 1e-7
"""Violation, in units of a constraint's parameters' ranges, below which a linear program counts it as kept."""

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_TERM = re.compile(
    rf"\s*(?P<sign>[+-]?)\s*(?:(?P<factor>{_NUMBER})\s*\*\s*(?=[A-Za-z_]))?(?:(?P<name>[A-Za-z_][\w.:^()*]*)|(?P<number>{_NUMBER}))\s*"
)
_HOW = "Write sums of NUMBER, PARAMETER and NUMBER*PARAMETER on both sides of one <=, >= or =."


@dataclass(frozen=True)
class LinearConstraint:
    """lower <= sum of factor * parameter <= upper, in the parameters' own units; an equality where lower = upper.

    text: as it was written; factors: parameter name -> factor.
    """

    text: str
    factors: Mapping[str, float]
    lower: float
    upper: float

    def value(self, values: Mapping[str, float]) -> float:
        """The sum at parameter values."""
        return sum(factor * values[name] for name, factor in self.factors.items())

    def renamed(self, names: Mapping[str, str]) -> "LinearConstraint":
        """The same constraint between parameters of other names (name -> new name); the text says so where they differ."""
        factors = {names.get(name, name): factor for name, factor in self.factors.items()}
        new = [f"{name} is {names[name]}" for name in self.factors if names.get(name, name) != name]
        return replace(self, text=f"{self.text} ({', '.join(new)})" if new else self.text, factors=factors)


def parse_constraint(text: str) -> LinearConstraint:
    """The constraint that `text` says. Raises BadInput."""
    if len(text) > LONGEST:
        raise BadInput(f"a constraint of {len(text)} characters ('{text[:30]}...'; limit {LONGEST})", do=_HOW)
    if long := re.search(rf"[\d.]{{{LONGEST_NUMBER},}}", text):
        raise BadInput(f"a number of {len(long[0])} digits in a constraint ('{text[:30]}...')", do="Write it as 1.0e20.")
    sides = re.split(r"(<=|>=|==|=)", text)
    if len(sides) != 3:
        raise BadInput(f"'{text}' is not a linear constraint", do=_HOW)
    left, relation, right = sides
    factors, constant = _sum(left, text)
    for name, factor in _sum(right, text)[0].items():
        factors[name] = factors.get(name, 0.0) - factor
    bound = _sum(right, text)[1] - constant
    factors = {name: factor for name, factor in factors.items() if factor != 0}
    if not factors:
        raise BadInput(f"'{text}' says nothing about any parameter", do=_HOW)
    for number in (*factors.values(), bound):
        if not math.isfinite(number) or number and not SMALLEST <= abs(number) <= LARGEST:
            what = f"'{text}' holds, or adds up to, {number:g}"
            raise BadInput(what, do=f"Use numbers between {SMALLEST:g} and {LARGEST:g}; choose other units.")
    infinite = float("inf")
    return LinearConstraint(text, factors, bound if relation != "<=" else -infinite, bound if relation != ">=" else infinite)


def _sum(side: str, text: str) -> tuple[dict[str, float], float]:
    """(name -> factor, constant) of one side."""
    factors, constant, at = {}, 0.0, 0
    while at < len(side) or at == 0:
        term = _TERM.match(side, at)
        if term is None or (at > 0 and not term["sign"]):
            raise BadInput(f"'{text}' is not a linear constraint: cannot read '{side[at:].strip() or side.strip()}'", do=_HOW)
        sign = -1.0 if term["sign"] == "-" else 1.0
        if term["name"]:
            factors[term["name"]] = factors.get(term["name"], 0.0) + sign * _number(term["factor"] or "1", text)
        else:
            constant += sign * _number(term["number"], text)
        at = term.end()
    return factors, constant


def _number(digits: str, text: str) -> float:
    """A number as it stands in a constraint: 1e-320 is not nothing, 1e400 not infinity."""
    value = float(digits)
    if not math.isfinite(value) or (value < SMALLEST and any(c in "123456789" for c in re.split("[eE]", digits)[0])):
        raise BadInput(f"'{text}' holds {digits}", do=f"Use numbers between {SMALLEST:g} and {LARGEST:g}; choose other units.")
    return value


def contradiction(constraints: Sequence[LinearConstraint], ranges: Mapping[str, tuple[float, float]]) -> list[LinearConstraint]:
    """Those of the constraints that no values inside the ranges satisfy together, although without any one of them some would; empty
    where all can hold.

    ranges: parameter name -> (lowest, highest) value, the same twice for one that is fixed; ends may be infinite.
    """
    held = list(constraints)
    if _hold(held, ranges):
        return []
    for constraint in constraints:  # deletion filter
        if not _hold(others := [c for c in held if c is not constraint], ranges):
            held = others
    return held


def _hold(constraints: Sequence[LinearConstraint], ranges: Mapping[str, tuple[float, float]]) -> bool:
    """Can these hold together? A linear program in units of the ranges."""
    if not constraints:
        return True
    import numpy as np
    from scipy.optimize import linprog

    names = sorted({name for c in constraints for name in c.factors})
    ends = np.array([ranges[name] for name in names], dtype=float)
    width = np.where(np.isfinite(ends).all(1), ends[:, 1] - ends[:, 0], np.nan_to_num(np.abs(ends), posinf=0.0, neginf=0.0).max(1))
    width[width == 0] = np.maximum(np.abs(ends[width == 0]).max(1), 1.0)  # fixed
    width[~np.isfinite(width)] = 1.0
    A = np.array([[c.factors.get(name, 0.0) for name in names] for c in constraints]) * width
    unit = np.linalg.norm(A, axis=1)
    both = np.vstack([A, -A]) / np.r_[unit, unit][:, None]
    right = np.r_[[c.upper for c in constraints] / unit, [-c.lower for c in constraints] / unit]
    kept = np.isfinite(right)
    return linprog(np.zeros(len(names)), both[kept], right[kept] + SLACK, bounds=ends / width[:, None], method="highs").status != 2
