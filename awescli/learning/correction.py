"""The network f_nn (docs/equations.md (28)): what it adds to d/dt of (u, v, w, p, q, r), where it is held still, the kite that has it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from awescli.engine.dense import FARTHEST, layer_slices, weight_count
from awescli.flightlog.log import FlightLog
from awescli.learning.network_inputs import check_inputs, inputs_of_instant
from awescli.notation.errors import BadInput
from awescli.notation.parameters import Parameter, ParameterTable
from awescli.notation.quantities import OUTPUTS, STATES
from awescli.notation.scalars import Scalar, exp, maximum, tanh
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.disturbances import DISTURBANCES, both
from awescli.physics.instant import Instant
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator

CORRECTED = ("u", "v", "w", "p", "q", "r")
"""States whose derivatives the network corrects [m/s2, rad/s2]; positions and angles follow from them and need none."""
ROWS = tuple(STATES.index(name) for name in CORRECTED)
ACCELERATIONS = tuple(OUTPUTS.index(name) for name in ("a_x", "a_y", "a_z"))


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

    def __post_init__(self) -> None:
        check_inputs(self.inputs)
        sizes = dict.fromkeys(("mean", "deviation", "middle", "half"), len(self.inputs))
        for name, size in {**sizes, "scale": len(CORRECTED), "weights": weight_count(self.sizes)}.items():
            a = getattr(self, name)
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
            hidden = tuple(int(n) for n in description["hidden"])
            loaded = cls(tuple(description["inputs"]), hidden, width=float(description["width"]), **known)
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


def evaluate(
    inputs: Sequence[Scalar], correction: Correction, weights: Sequence[Scalar] | np.ndarray | None = None
) -> tuple[list[Scalar], Scalar]:
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


@dataclass
class CorrectedInstant(Instant):
    """An instant of the physics with what the network adds: the six corrections, and its fade outside the states it was trained on."""

    fade: Scalar = field(init=False, repr=False)
    correction: tuple = field(init=False, repr=False)

    @classmethod
    def of(cls, at: Instant) -> "CorrectedInstant":
        """The same instant, to be corrected."""
        found = cls.__new__(cls)
        found.__dict__.update(at.__dict__)
        return found


class HybridKite:
    """Physics + f_nn as `derivative`, `outputs`, `initial`; wherever a `Kite` is simulated this can stand.

    The weights are parameters (`network.0`, ...) behind the physical ones, never free: programs compiled for one network serve all of
    the same shape and normalisation. network: what gives the corrections; whoever prints a network as loops gives his own.
    """

    def __init__(self, kite: Kite, correction: Correction, network: Callable = evaluate):
        self.kite, self.correction, self._network = kite, correction, network
        rows = (Parameter(f"network.{i}", float(w), source="network") for i, w in enumerate(correction.weights))
        self.parameters: ParameterTable = kite.parameters.with_rows(rows)
        self.parameter_names = tuple(self.parameters)
        self._inputs = inputs_of_instant(correction.inputs)
        self.declaration, self.heights, self.effects, self.by_place = kite.declaration, kite.heights, kite.effects, kite.by_place
        self.state_names, self.x_names, self.input_names = kite.state_names, kite.x_names, kite.input_names
        self.constraints, self.tether = kite.constraints, kite.tether
        self.record, self.start_spread, self.own_in_phase = kite.record, kite.start_spread, kite.own_in_phase

    def instant(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> CorrectedInstant:
        """The instant of the physics, its derivative corrected; `at.correction` holds the six corrections."""
        own = len(self.kite.parameter_names)
        at = CorrectedInstant.of(self.kite.instant(x, u, c[:own]))
        corrections, at.fade = self._network(self._inputs(at), self.correction, c[own:])
        derivative = list(at.derivative)
        for row, value in zip(ROWS, corrections, strict=True):
            derivative[row] = derivative[row] + value
        at.correction, at.derivative = tuple(corrections), tuple(derivative)
        return at

    def derivative(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> list:
        """d/dt of the 12 states and the effects' states."""
        at = self.instant(x, u, c)
        return [*at.derivative, *(rate for e in self.effects for rate in e.rates(at, e.own(at)))]

    def outputs(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> list:
        """As `Kite.outputs`; the correction of (u, v, w) is an acceleration and shows in a_x, a_y, a_z."""
        reported = self.kite.outputs(x, u, c[: len(self.kite.parameter_names)])
        for place, value in zip(ACCELERATIONS, self.instant(x, u, c).correction[:3], strict=True):
            reported[place] = reported[place] + value
        return reported

    def initial(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> list:
        return self.kite.initial(x, u, c[: len(self.kite.parameter_names)])

    def with_values(self, values: Mapping[str, float]) -> "HybridKite":
        """The same hybrid with other values of physical parameters or weights."""
        return self.with_rows(self.parameters.with_values(values).rows)

    def with_rows(self, rows: Iterable[Parameter]) -> "HybridKite":
        """The same hybrid with other rows of parameters."""
        other = object.__new__(HybridKite)
        other.__dict__.update(self.__dict__)
        other.parameters = self.parameters.with_rows(rows)
        other.kite = self.kite.with_rows(other.parameters[name] for name in self.kite.parameters)
        return other

    def declare(self, keys: Sequence[str], free: Sequence[str] = (), table: ParameterTable | None = None) -> KiteDeclaration:
        """The declaration of the physics; the correction has no place in a kite file."""
        own = self.kite.parameters if table is None else ParameterTable(table[n] for n in self.kite.parameter_names)
        return self.kite.declare(keys, free, own)


def hybrid_from_artifact(
    description: Mapping, arrays: Mapping[str, np.ndarray], declaration: KiteDeclaration, log: FlightLog, law: Callable | None = None
) -> Simulator:
    """The simulator of what train-hybrid left (network.json, network.safetensors) on the kite file beside them; law: as of the physics."""
    kite = kite_from_artifact(description, arrays, declaration, log.recorded_wind.height)
    return Simulator(kite, both(DISTURBANCES), law and of_physics(law, kite))


def of_physics(law: Callable, kite: "Kite | HybridKite") -> Callable:
    """A law for a simulator of `kite`: it is a function of the physical parameters, which stand before the weights."""
    own = len(kite.kite.parameter_names if isinstance(kite, HybridKite) else kite.parameter_names)
    return lambda x, u, c: law(x, u, c[:own])


def kite_from_artifact(
    description: Mapping, arrays: Mapping[str, np.ndarray], declaration: KiteDeclaration, heights: Sequence[float] | np.ndarray
) -> Kite | HybridKite:
    """The kite that train-hybrid left, for a wind known at `heights` [m]; plain physics where nothing was learned."""
    correction, kite = Correction.from_arrays(arrays, description), Kite(declaration, heights)
    return kite if correction.is_zero else HybridKite(kite, correction)
