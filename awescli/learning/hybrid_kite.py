"""HybridKite: a kite with a correction, behind the same door as a kite."""

from collections.abc import Sequence

from awescli.learning.correction import NETWORK_INPUTS, ROWS, Correction, evaluate
from awescli.notation.parameters import Parameter, ParameterTable
from awescli.notation.quantities import OUTPUTS
from awescli.physics.kite import Kite

ACCELERATIONS = tuple(OUTPUTS.index(name) for name in ("a_x", "a_y", "a_z"))


class HybridKite:
    """Physics + f_nn as `derivative`, `outputs`, `initial`; wherever a `Kite` is simulated this can stand.

    The weights are parameters (`network.0`, ...) behind the physical ones, never free: programs compiled for one network serve all of
    the same shape and normalisation.
    """

    def __init__(self, kite: Kite, correction: Correction):
        self.kite, self.correction = kite, correction
        rows = (Parameter(f"network.{i}", float(w), source="network") for i, w in enumerate(correction.weights))
        self.parameters: ParameterTable = kite.parameters.with_rows(rows)
        self.parameter_names = tuple(self.parameters)
        self.declaration, self.heights, self.effects, self.by_place = kite.declaration, kite.heights, kite.effects, kite.by_place
        self.state_names, self.x_names, self.input_names = kite.state_names, kite.x_names, kite.input_names

    def instant(self, x, u, c):
        """The instant of the physics, its derivative corrected; `at.correction` holds the six corrections."""
        own = len(self.kite.parameter_names)
        at = self.kite.instant(x, u, c[:own])
        corrections, at.fade = evaluate([NETWORK_INPUTS[name](at) for name in self.correction.inputs], self.correction, c[own:])
        derivative = list(at.derivative)
        for row, value in zip(ROWS, corrections, strict=True):
            derivative[row] = derivative[row] + value
        at.correction, at.derivative = tuple(corrections), tuple(derivative)
        return at

    def derivative(self, x, u, c) -> list:
        """d/dt of the 12 states and the effects' states."""
        at = self.instant(x, u, c)
        return [*at.derivative, *(rate for e in self.effects for rate in e.rates(at, e.own(at)))]

    def outputs(self, x, u, c) -> list:
        """As `Kite.outputs`; the correction of (u, v, w) is an acceleration and shows in a_x, a_y, a_z."""
        reported = self.kite.outputs(x, u, c[: len(self.kite.parameter_names)])
        for place, value in zip(ACCELERATIONS, self.instant(x, u, c).correction[:3], strict=True):
            reported[place] = reported[place] + value
        return reported

    def initial(self, x, u, c) -> list:
        return self.kite.initial(x, u, c[: len(self.kite.parameter_names)])

    def with_values(self, values: dict[str, float]) -> "HybridKite":
        """The same hybrid with other values of physical parameters or weights."""
        other = object.__new__(HybridKite)
        other.__dict__.update(self.__dict__)
        other.parameters = self.parameters.with_values(values)
        other.kite = self.kite.with_values({k: v for k, v in values.items() if k in self.kite.parameters})
        return other

    def declare(self, keys: Sequence[str], free: Sequence[str] = (), table: ParameterTable | None = None):
        """The declaration of the physics; the correction has no place in a kite file."""
        own = self.kite.parameters if table is None else ParameterTable(table[n] for n in self.kite.parameter_names)
        return self.kite.declare(keys, free, own)
