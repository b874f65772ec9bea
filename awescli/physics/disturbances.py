"""What acts on every kite beside its effects and is not known: gusts, what the model does not say of forces, moments and the line, and
where surfaces are.

Each is an input of a kite, null unless somebody fills it. An estimator integrates it out; for that each comes with two parameters,
through which it is differentiated: between two nodes in time a disturbance runs linearly from its value at one to its value at the other.
Nodes are counted, and `even` and `odd` ones have a parameter each, weighted by an input, `phase`: 0 at even nodes, 1 at odd ones.
"""

from collections.abc import Iterable

from awescli.notation.parameters import Parameter
from awescli.notation.quantities import CONTROL_SURFACES

GUSTS = ("gust_n", "gust_e", "gust_d")
"""Velocity of the air [m/s], NED, added to the wind that the record and the effects say."""
GUST_RATES = ("gust_p", "gust_q", "gust_r")
"""[rad/s] Gradients of the gusts along the kite, which roll, pitch and yaw it (MIL-F-8785C's p_g, q_g, r_g): of the vertical gust along
span and fuselage, of the lateral one along the fuselage."""
FORCES = ("force_x", "force_y", "force_z")
"""Force per mass [m/s2], body axes, beside the aerodynamic one: a tether answers it."""
MOMENTS = ("moment_x", "moment_y", "moment_z")
"""Angular acceleration [rad/s2], body axes, beside that of the moments."""
LINE = "line_length"
"""[m] what the line is longer than the winch says: stretch, sag, slack, slip on the drum."""
RECORDED = {name: f"{name}_error" for name in CONTROL_SURFACES}
"""Control surface -> its disturbance: [rad] by which it is set otherwise than was recorded, where it was read with noise."""
DISTURBANCES = (*GUSTS, *GUST_RATES, *FORCES, *MOMENTS, LINE, *RECORDED.values())
PHASE = "phase"

DISTURBANCE_UNITS = {
    **dict.fromkeys(GUSTS, "m/s"), **dict.fromkeys(GUST_RATES, "rad/s"), **dict.fromkeys(FORCES, "m/s2"),
    **dict.fromkeys(MOMENTS, "rad/s2"), LINE: "m", **dict.fromkeys(RECORDED.values(), "rad"),
}  # fmt: skip


def even(name: str) -> str:
    """The parameter through which a disturbance is differentiated at even nodes, and all the time where there are no nodes."""
    return f"{name}.even"


def odd(name: str) -> str:
    """The same at odd nodes."""
    return f"{name}.odd"


def both(names: Iterable[str]) -> tuple[str, ...]:
    """Parameters of some disturbances: those of even nodes, then those of odd ones."""
    names = tuple(names)
    return (*map(even, names), *map(odd, names))


def parameters() -> list[Parameter]:
    """Both parameters of every disturbance, at null."""
    return [Parameter(which(name), 0.0, DISTURBANCE_UNITS[name], source="nuisance") for which in (even, odd) for name in DISTURBANCES]


def disturbances(inputs: dict, values: dict) -> dict:
    """Every disturbance at an instant, by name."""
    phase = inputs[PHASE]
    return {n: inputs[n] + ((1 - phase) * values[even(n)] + phase * values[odd(n)]) for n in DISTURBANCES}
