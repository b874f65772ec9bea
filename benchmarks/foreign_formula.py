"""Formulas as text (`k * qS * b * sin(2 * psi)`) -> the function elements of JSBSim, and numbers where they name nothing that moves.

Parsed with `ast`, never evaluated as Python. Operators + - * / **, comparisons, `where(condition, a, b)` and the functions below.
"""

import ast
import math
import operator
from collections.abc import Callable, Mapping

from awescli.notation.errors import BadInput, did_you_mean

FUNCTIONS = ("sin", "cos", "tan", "asin", "atan2", "sqrt", "exp", "abs", "min", "max")
_OPERATORS = {ast.Add: "sum", ast.Sub: "difference", ast.Mult: "product", ast.Div: "quotient", ast.Pow: "pow"}
_COMPARISONS = {ast.Lt: "lt", ast.LtE: "le", ast.Gt: "gt", ast.GtE: "ge"}
_ARITHMETIC: dict[str, Callable] = {
    "sum": operator.add, "difference": operator.sub, "product": operator.mul, "quotient": operator.truediv, "pow": operator.pow,
    "lt": operator.lt, "le": operator.le, "gt": operator.gt, "ge": operator.ge, "ifthen": lambda condition, a, b: a if condition else b,
    "abs": abs, "min": min, "max": max, **{name: getattr(math, name) for name in ("sin", "cos", "tan", "asin", "atan2", "sqrt", "exp")},
}  # fmt: skip


def xml(formula: str, signals: Mapping[str, str], values: Mapping[str, float]) -> str:
    """The formula as one element. signals: name -> property; values: name -> number, which comes first. Raises BadInput."""

    def leaf(name: str) -> str:
        if name in values:
            return constant(values[name])
        if name in signals:
            return f"<property>{signals[name]}</property>"
        raise BadInput(f"unknown name '{name}' in the formula '{formula}'", do=did_you_mean(name, [*signals, *values]))

    return _walk(_parsed(formula), formula, leaf, constant, lambda tag, parts: f"<{tag}>{''.join(parts)}</{tag}>")


def number(formula: str, values: Mapping[str, float]) -> float:
    """The value of a formula that names only `values`. Raises BadInput."""

    def leaf(name: str) -> float:
        if name in values:
            return float(values[name])
        raise BadInput(f"unknown name '{name}' in '{formula}'", do=did_you_mean(name, values))

    return float(_walk(_parsed(formula), formula, leaf, float, lambda tag, parts: _ARITHMETIC[tag](*parts)))


def constant(value: float) -> str:
    """A number as JSBSim reads it, to the last bit."""
    return f"<value>{float(value)!r}</value>"


def _parsed(formula: str) -> ast.expr:
    try:
        return ast.parse(str(formula).strip(), mode="eval").body
    except SyntaxError as e:
        raise BadInput(f"cannot read the formula '{formula}'") from e


def _walk(node: ast.expr, formula: str, leaf: Callable, literal: Callable, join: Callable):
    """Fold the formula's tree: leaf(name), literal(number), join(element's tag, parts)."""

    def again(below: ast.expr):
        return _walk(below, formula, leaf, literal, join)

    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int() | float() as value):
            return literal(value)
        case ast.Name(id=name):
            return leaf(name)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return join("product", [literal(-1.0), again(operand)])
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return join(_OPERATORS[type(op)], [again(left), again(right)])
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARISONS:
            return join(_COMPARISONS[type(op)], [again(left), again(right)])
        case ast.Call(func=ast.Name(id="where"), args=[condition, a, b], keywords=[]):
            return join("ifthen", [again(condition), again(a), again(b)])
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in FUNCTIONS:
            return join(name, [again(a) for a in args])
    raise BadInput(f"cannot read '{ast.unparse(node)}' in the formula '{formula}'", do=f"Use + - * / **, where(), {', '.join(FUNCTIONS)}.")
