"""The network f_nn (seed section 5): what it sees, what it adds to d/dt of (u, v, w, p, q, r), and where it must keep still."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.engine.dense import FARTHEST, layer_slices, weight_count
from awescli.notation.errors import BadInput, did_you_mean
from awescli.notation.frames import dot
from awescli.notation.quantities import STATES, SURFACES
from awescli.notation.scalars import asin, cos, exp, maximum, sin, tanh
from awescli.physics.instant import Instant

CORRECTED = ("u", "v", "w", "p", "q", "r")
"""States whose derivatives the network corrects [m/s2, rad/s2]; positions and angles follow from them and need none."""
ROWS = tuple(STATES.index(name) for name in CORRECTED)


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
"""What the network may see, each a function of the same instant that the physics fills: u_nn of the seed (states, alpha, beta, V_a,
surfaces, line length and load). Angles that turn around enter as sine and cosine; surface rates tell what a lagging actuator still has
before it."""

DEFAULT_INPUTS = (
    "elevation", "north", "east", "u", "v", "w", "p", "q", "r", "sin_phi", "cos_phi", "sin_theta", "cos_theta", "sin_psi", "cos_psi",
    "alpha", "beta", "V_a", "aileron", "elevator", "rudder", "flaps", "rudder_rate", "tether_length", "stretch", "stretch_rate", "tension",
)  # fmt: skip


def check_inputs(names: Sequence[str]) -> None:
    """Raise BadInput for a network input that does not exist."""
    for name in names:
        if name not in NETWORK_INPUTS:
            raise BadInput(f"unknown network input '{name}'", do=did_you_mean(name, NETWORK_INPUTS))


def network_inputs(kite, names: Sequence[str]) -> Callable:
    """(x, u, c) -> the named inputs, from the physics of `kite`: recorded with the derivative, so nothing is computed twice."""
    check_inputs(names)

    def function(x, u, c):
        at = kite.instant(x, u, c)
        return [NETWORK_INPUTS[name](at) for name in names]

    return function


@dataclass(frozen=True)
class Correction:
    """A trained network with its normalisation and its box.

    inputs: names in `NETWORK_INPUTS`; hidden: widths of the tanh layers; weights: (n,) as `engine.dense` lays them out;
    mean, deviation, middle, half: (n_in,) normalisation, and the box of normalised training inputs; scale: (6,) size of the output
    [m/s2, rad/s2]; width: how far outside the box (in half ranges) the correction has fallen to 1/e.
    """

    inputs: tuple[str, ...]
    hidden: tuple[int, ...]
    weights: np.ndarray
    mean: np.ndarray
    deviation: np.ndarray
    middle: np.ndarray
    half: np.ndarray
    scale: np.ndarray
    width: float = 0.3

    def __post_init__(self):
        n, arrays = len(self.inputs), {"mean": self.mean, "deviation": self.deviation, "middle": self.middle, "half": self.half}
        check_inputs(self.inputs)
        for name, a, size in (*((k, v, n) for k, v in arrays.items()), ("scale", self.scale, 6), ("weights", self.weights, weight_count(self.sizes))):
            if np.shape(a) != (size,) or not np.isfinite(a).all():
                raise BadInput(f"network: '{name}' is not {size} finite numbers (shape {np.shape(a)})", do="Train it again.")
        if (self.deviation <= 0).any() or (self.half <= 0).any() or self.width <= 0:
            raise BadInput("network: normalisation with a range that is not positive", do="Train it again.")

    @property
    def sizes(self) -> tuple[int, ...]:
        """Widths of all layers."""
        return (len(self.inputs), *self.hidden, len(CORRECTED))

    @property
    def constants(self) -> np.ndarray:
        """What `engine.dense` wants besides the weights."""
        return np.concatenate([self.mean, 1 / self.deviation, self.middle, 1 / self.half, self.scale, [1 / self.width]])

    @property
    def is_zero(self) -> bool:
        """True where the last layer is null: pure physics."""
        W, b = layer_slices(self.sizes)[-1]
        return not (self.weights[W].any() or self.weights[b].any())

    def with_weights(self, weights: np.ndarray) -> "Correction":
        return replace(self, weights=np.asarray(weights, dtype=float).copy())

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Named arrays, for safetensors."""
        return {k: np.asarray(getattr(self, k)) for k in ("weights", "mean", "deviation", "middle", "half", "scale")}

    def description(self) -> dict:
        """What the arrays mean, for the JSON beside them; `fingerprint` ties the two files together."""
        return {
            "format": "awes correction 1", "inputs": list(self.inputs), "hidden": list(self.hidden), "width": self.width,
            "outputs": [f"d{n}/dt" for n in CORRECTED], "fingerprint": self.fingerprint(),
        }  # fmt: skip

    def fingerprint(self) -> str:
        """sha256 over all arrays and names."""
        import hashlib

        total = hashlib.sha256(repr((self.inputs, self.hidden, float(self.width))).encode())
        for name, array in sorted(self.to_arrays().items()):
            total.update(name.encode() + np.ascontiguousarray(array, dtype="<f8").tobytes())
        return total.hexdigest()

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], description: Mapping, where: str = "network.safetensors") -> "Correction":
        """What `to_arrays` and `description` gave. Raises BadInput where the two do not belong together or were changed."""
        again = "Make it again: awes train-hybrid --force."
        missing = [k for k in ("weights", "mean", "deviation", "middle", "half", "scale") if k not in arrays]
        if missing or description.get("format") != "awes correction 1":
            raise BadInput(f"not a correction network{f' (lacks {missing})' if missing else ''}", where, again)
        try:
            known = {k: np.asarray(arrays[k], dtype=float) for k in ("weights", "mean", "deviation", "middle", "half", "scale")}
            loaded = cls(tuple(description["inputs"]), tuple(int(n) for n in description["hidden"]), width=float(description["width"]), **known)
        except (KeyError, TypeError, ValueError) as e:
            raise BadInput(f"its description is damaged: {e}", where, again) from None
        except BadInput as e:
            raise BadInput(e.what, where, again) from None
        if loaded.fingerprint() != description.get("fingerprint"):
            raise BadInput("weights and description do not belong together (the fingerprint differs)", where, again)
        return loaded


def initial_weights(sizes: Sequence[int], seed: int) -> np.ndarray:
    """Glorot-uniform hidden layers, zero biases, zero last layer: the network starts as pure physics."""
    rng = np.random.default_rng([seed, 0])
    weights = np.zeros(weight_count(sizes))
    for (W, _), a, b in list(zip(layer_slices(sizes), sizes, sizes[1:], strict=False))[:-1]:
        weights[W] = rng.uniform(-1, 1, a * b) * np.sqrt(6 / (a + b))
    return weights


def evaluate(inputs, correction: Correction, weights=None):
    """Corrections of the six derivatives for a list of inputs, of any kind of scalar. Returns (list of 6, fade).

    weights: (n,) scalars that stand in for the correction's own (recorded parameters).
    """
    weights = correction.weights if weights is None else weights
    c, outside, layer = correction, 0.0, []
    for i, s in enumerate(inputs):
        z = (s - float(c.mean[i])) * float(1 / c.deviation[i])
        layer.append(z)
        d = z - float(c.middle[i])
        e = (maximum(d, -d) * float(1 / c.half[i]) - 1.0) * float(1 / c.width)
        e = maximum(e, 0.0 * e)
        outside = outside + e * e
    fade = exp(maximum(-outside, -FARTHEST + 0.0 * outside))
    places = layer_slices(c.sizes)
    for number, (W, b) in enumerate(places):
        n = len(layer)
        sums = []
        for i in range(c.sizes[number + 1]):
            total = weights[b.start + i] + 0.0 * layer[0]
            for j, a in enumerate(layer):
                total = total + weights[W.start + i * n + j] * a
            sums.append(total)
        layer = [tanh(s) for s in sums] if number < len(places) - 1 else sums
    return [float(c.scale[k]) * fade * y for k, y in enumerate(layer)], fade
