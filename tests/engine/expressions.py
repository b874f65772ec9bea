"""Random expression graphs over the operations that physics uses, well inside every domain."""

from collections.abc import Callable

import numpy as np

from awescli.notation.scalars import atan2, cos, exp, log, select, sin, sqrt

ARITHMETIC = ("add", "sub", "mul", "div", "neg", "sqrt")
SMOOTH = (*ARITHMETIC, "sin", "cos", "exp", "log")
ALL = (*SMOOTH, "atan2", "select")


def random_function(seed: int, ops: int = 40, allowed=ALL, outputs: int = 5) -> Callable:
    """f(x, u, c) -> list: a random straight-line program of `ops` operations; values stay of order one for inputs in [0.2, 2]."""
    random = np.random.default_rng(seed)
    plan = [(str(random.choice(allowed)), random.random(3), float(random.uniform(0.5, 1.5))) for _ in range(ops)]

    def f(x, u, c):
        pool = [*x, *u, *c]
        for op, where, number in plan:
            a, b, d = (pool[int(w * len(pool))] for w in where)
            pool.append(_apply(op, a, b, d, number))
        return pool[-outputs:]

    return f


def _apply(op, a, b, d, number):
    bounded = a / (1.0 + a * a)  # |.| <= 1/2
    if op == "add":
        return bounded + number * b / (1.0 + b * b)
    if op == "sub":
        return bounded - b / (number + b * b)
    if op == "mul":
        return bounded * b / (1.0 + b * b) + number
    if op == "div":
        return a / (number + b * b)
    if op == "neg":
        return -bounded
    if op == "sqrt":
        return sqrt(number + b * b)
    if op == "sin":
        return sin(number * a + b)
    if op == "cos":
        return cos(number * b - d)
    if op == "exp":
        return exp(bounded - number)
    if op == "log":
        return log(number + a * a)
    if op == "atan2":
        return atan2(bounded - 0.3, number - b / (1.0 + b * b))
    return select(bounded - 0.25 * number, a, number * b)
