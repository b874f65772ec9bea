"""What the record of a winch says before and after now, for a winch whose clock is not the kite's.

The record stands in a kite's inputs as differences from now, at AROUND. Between two of these moments runs the cubic that has their
values and their rates (Hermite's): the length of a winch that swings by 0.4 m/s with a period of 8 s comes out right to 0.01 mm within two
seconds and to 1 mm beyond (`tests/physics/test_around.py`).
"""

from collections.abc import Mapping

import numpy as np

from awescli.notation.scalars import Scalar, select

AROUND = tuple(round(float(t), 9) for t in (
    *np.arange(-10.0, -4.0), *np.arange(-4.0, -2.0, 0.5), *np.arange(-2.0, 2.0, 0.25), *np.arange(2.0, 4.0, 0.5), *np.arange(4.0, 10.5),
))  # fmt: skip
"""[s] beside now at which the record is looked at, closely within two seconds; 0 is one of them, and the last ones are the farthest."""
LOOKED_AT = ("tether_length", "reel_out_speed", "reel_out_acceleration")
"""Inputs that are looked at, each the rate of the one before."""


def around(signal: str) -> tuple[str, ...]:
    """Inputs that hold by how much a signal, one of LOOKED_AT, will differ from that of now, at AROUND."""
    return tuple(f"{signal}_around_{k}" for k in range(len(AROUND)))


def ahead(inputs: Mapping[str, Scalar], tau: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """By how much (length, speed, acceleration) of the record `tau` seconds ahead differ from those of now."""
    nodes = [(t, *(inputs[around(name)[k]] for name in LOOKED_AT)) for k, t in enumerate(AROUND)]
    (t_0, *before), (t_1, *after) = nodes[0], nodes[1]
    for (earlier, *left), (later, *right) in zip(nodes[1:], nodes[2:], strict=False):
        t_0, *before = (select(tau - earlier, new, old) for new, old in zip((earlier, *left), (t_0, *before), strict=True))
        t_1, *after = (select(tau - earlier, new, old) for new, old in zip((later, *right), (t_1, *after), strict=True))
    _, speed, acceleration = (inputs[name] for name in LOOKED_AT)
    step, x = t_1 - t_0, (tau - t_0) / (t_1 - t_0)
    length, _ = _cubic(x, step, before[0], after[0], speed + before[1], speed + after[1])
    return length, *_cubic(x, step, before[1], after[1], acceleration + before[2], acceleration + after[2], acceleration)


def _cubic(
    x: Scalar, step: Scalar, y_0: Scalar, y_1: Scalar, rate_0: Scalar, rate_1: Scalar, rate: Scalar = 0.0
) -> tuple[Scalar, Scalar]:
    """(value, its rate less `rate`) of the cubic with values y and rates at both ends of a step, at the share x of it."""
    value = y_1 * x * x * (3 - 2 * x) + (1 - x) * (1 - x) * (y_0 * (1 + 2 * x) + step * rate_0 * x) - step * rate_1 * x * x * (1 - x)
    slope = 6 * x * (1 - x) * (y_1 - y_0) / step + (1 - x) * (1 - 3 * x) * rate_0 - x * (2 - 3 * x) * rate_1
    return value, slope - rate
