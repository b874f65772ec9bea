"""Linear constraints between parameters, as a kite file writes them: `Jx + Jz >= Jy`, `2*CYb + 0.1 <= CYp`, `Cl_bias = 0.5*Cn_bias`."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

from awescli.notation.errors import BadInput

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
            factors[term["name"]] = factors.get(term["name"], 0.0) + sign * float(term["factor"] or 1.0)
        else:
            constant += sign * float(term["number"])
        at = term.end()
    return factors, constant
