"""Elementary functions that work alike on floats, numpy arrays, torch tensors and the engine's recorded scalars.

The physics is written once in these; whoever calls it decides what the letters hold. A type takes part by having the
methods (torch and the engine do); everything else goes to numpy.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

Scalar = Any
"""A float, an array, a torch tensor, or a scalar that the engine records."""


def _method_or_numpy(method: str, numpy_name: str | None = None) -> Callable[[Scalar], Scalar]:
    of_array = getattr(np, numpy_name or method)
    of_float = getattr(math, method, None)

    def function(x):
        if isinstance(x, (float, int)) and of_float is not None:
            return of_float(x)
        return getattr(x, method)() if hasattr(x, method) else of_array(x)

    function.__name__ = method
    return function


sin = _method_or_numpy("sin")
cos = _method_or_numpy("cos")
tan = _method_or_numpy("tan")
exp = _method_or_numpy("exp")
log = _method_or_numpy("log")
sqrt = _method_or_numpy("sqrt")
tanh = _method_or_numpy("tanh")
asin = _method_or_numpy("asin", "arcsin")


def atan2(y: Scalar, x: Scalar) -> Scalar:
    """Angle of the point (x, y) [rad]."""
    if hasattr(y, "atan2"):
        return y.atan2(x)
    return math.atan2(y, x) if isinstance(y, (float, int)) and isinstance(x, (float, int)) else np.arctan2(y, x)


def select(positive: Scalar, then: Scalar, otherwise: Scalar) -> Scalar:
    """`then` where `positive` > 0, else `otherwise`. The derivative is that of the chosen side."""
    if hasattr(positive, "select"):
        # a torch.Tensor has a method of this name that means something else
        if type(positive).__module__ != "torch":
            return positive.select(then, otherwise)
        import torch

        like = positive
        return torch.where(positive > 0, torch.as_tensor(then, dtype=like.dtype), torch.as_tensor(otherwise, dtype=like.dtype))
    for other in (then, otherwise):
        if type(other).__module__ == "torch" or hasattr(other, "select"):
            return then if positive > 0 else otherwise
    if isinstance(positive, (float, int)):
        return then if positive > 0 else otherwise
    return np.where(positive > 0, then, otherwise)


def maximum(a: Scalar, b: Scalar) -> Scalar:
    """The larger of a and b; at a tie, b."""
    return select(a - b, a, b)


def absolute(x: Scalar) -> Scalar:
    """|x| with derivative sign(x), -1 at 0."""
    return select(x, x, -x)
