"""NETWORK_INPUTS: what the network may see (u_nn of docs/equations.md (28)), each a function of the instant that the physics fills."""

from collections.abc import Callable, Sequence

from awescli.notation.errors import BadInput, did_you_mean
from awescli.notation.frames import dot, rotate_back
from awescli.notation.quantities import SURFACES
from awescli.notation.scalars import asin, cos, sin, sqrt
from awescli.physics.instant import Instant
from awescli.physics.kite import Kite

STILL = 1e-6
"""[m2/s2] added under the root of the wind's speed: the root has no slope at zero."""


def _input(name: str) -> Callable[[Instant], object]:
    return lambda at: at.inputs[name]


def _state(name: str) -> Callable[[Instant], object]:
    return lambda at: getattr(at.z, name)


NETWORK_INPUTS: dict[str, Callable[[Instant], object]] = {
    "elevation": lambda at: asin(-at.p_hat[2]),
    "north": lambda at: at.p_hat[0],
    "east": lambda at: at.p_hat[1],
    **{n: _state(n) for n in ("p_n", "p_e", "p_d", "u", "v", "w", "p", "q", "r")},
    "sin_phi": lambda at: sin(at.z.phi),
    "cos_phi": lambda at: cos(at.z.phi),
    "sin_theta": lambda at: sin(at.z.theta),
    "cos_theta": lambda at: cos(at.z.theta),
    "sin_psi": lambda at: sin(at.z.psi),
    "cos_psi": lambda at: cos(at.z.psi),
    **{n: _state(n) for n in ("phi", "theta", "psi")},
    **{f"wind_{a}": lambda at, a=a: getattr(at.wind, a) for a in "ned"},
    "wind_speed": lambda at: sqrt(at.wind.n * at.wind.n + at.wind.e * at.wind.e + STILL),
    **{f"line_{a}": lambda at, i=i: rotate_back(at.R, at.p_hat)[i] for i, a in enumerate("xyz")},
    "alpha": lambda at: at.alpha,
    "beta": lambda at: at.beta,
    "V_a": lambda at: at.V_a,
    **{n: lambda at, n=n: at.setpoints[n] for n in SURFACES},
    **{f"{n}_rate": _input(f"{n}_rate") for n in SURFACES},
    "tether_length": _input("tether_length"),
    "stretch": lambda at: at.distance - at.inputs["tether_length"],
    "stretch_rate": lambda at: dot(at.p_hat, at.v_ned) - at.inputs["reel_out_speed"],
    "tension": lambda at: at.tension,
}
"""What the network may see, each a function of the same instant that the physics fills: u_nn of Rositani eq. (12) (states, alpha, beta,
V_a, surfaces, line length, wind) and the load. Angles that turn around had better enter as sine and cosine; surface rates tell what a
lagging actuator still has before it."""

DEFAULT_INPUTS = (
    "elevation", "north", "east", "u", "v", "w", "p", "q", "r", "sin_phi", "cos_phi", "sin_theta", "cos_theta", "sin_psi", "cos_psi",
    "line_x", "line_y", "line_z", "alpha", "beta", "V_a", "aileron", "elevator", "rudder", "flaps", "rudder_rate",
    "tether_length", "stretch", "stretch_rate", "tension",
)  # fmt: skip


OF_LINE = ("elevation", "north", "east", "line_x", "line_y", "line_z", "tether_length", "stretch", "stretch_rate", "tension")
"""What only a kite on a line has, or where only its line gives a meaning: the place on the sphere around the winch."""


def inputs_for(kite: Kite, names: Sequence[str] | None) -> tuple[str, ...]:
    """The wanted inputs, or the default ones of a kite on a line, or of one that flies free. Raises BadInput for what the kite lacks."""
    if names is None:
        return DEFAULT_INPUTS if kite.tether else (*(n for n in DEFAULT_INPUTS if n not in OF_LINE), "throttle")
    check_inputs(names)
    if kite.tether is None and (lost := [n for n in names if n in OF_LINE]):
        raise BadInput(f"network inputs {', '.join(lost)} are of a line, and the kite has none", "train-hybrid.inputs", "Leave them out.")
    return tuple(names)


def check_inputs(names: Sequence[str]) -> None:
    """Raise BadInput for a network input that does not exist."""
    for name in names:
        if name not in NETWORK_INPUTS:
            raise BadInput(f"unknown network input '{name}'", do=did_you_mean(name, NETWORK_INPUTS))


def network_inputs(kite: Kite, names: Sequence[str]) -> Callable:
    """(x, u, c) -> the named inputs, from the physics of `kite`: recorded with the derivative, so nothing is computed twice."""
    of_instant = inputs_of_instant(names)
    return lambda x, u, c: of_instant(kite.instant(x, u, c))


def inputs_of_instant(names: Sequence[str]) -> Callable[[Instant], list]:
    """instant -> the named inputs."""
    check_inputs(names)
    functions = [NETWORK_INPUTS[name] for name in names]
    return lambda at: [function(at) for function in functions]
