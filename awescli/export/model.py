"""What is exported: a model of any stage, and everything that a file about it should say of its numbers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from awescli.control.law import Law
from awescli.export.programs import Programs, record_programs
from awescli.export.words import Signal, input_signal, output_signal, set_point_signal, state_signal
from awescli.learning.correction import Correction, HybridKite
from awescli.notation.quantities import OUTPUTS, STATES, SURFACES, UNITS
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.kite import Kite


@dataclass(frozen=True)
class Start:
    """An instant at which the model is alive: state -> value, set-point -> value, exogenous input -> value; origin: where it comes from."""

    states: Mapping[str, float]
    set_points: Mapping[str, float]
    inputs: Mapping[str, float]
    origin: str


@dataclass(frozen=True)
class ExportedModel:
    """A model with its controller or without.

    label: which of the nested models it is (`identified`); kite: what flies, delay and limiter of the law included; law: function
    (x, u, c) -> set-points, made for this kite, of the `controller`, or both None: set-points are inputs; dt: [s] between samples;
    longest: [s] longest step of RK4; fitted: parameter -> {"std", "interval"} where a flight gives them; ranges: flown range of alpha, beta
    [rad], V_a [m/s]; provenance: what it was made from.
    """

    label: str
    kite: Kite | HybridKite
    start: Start
    dt: float
    longest: float
    law: Callable | None = None
    controller: Law | None = None
    fitted: Mapping[str, Mapping] = field(default_factory=dict)
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    provenance: Mapping = field(default_factory=dict)

    @property
    def declaration(self) -> KiteDeclaration:
        """The kite file of what flies."""
        return self.kite.declaration

    @property
    def identifier(self) -> str:
        """The kite's name as a name in a program: `km1_initial`."""
        letters = "".join(c.lower() if c.isascii() and c.isalnum() else "_" for c in self.declaration.name)
        name = "_".join(part for part in letters.split("_") if part) or "kite"
        return name if name[0].isalpha() else f"kite_{name}"

    @property
    def values(self) -> dict[str, float]:
        """Every parameter's value, in the order of `parameters`."""
        return {n: self.kite.parameters[n].value for n in self.programs.parameters}

    @property
    def physics(self) -> Kite:
        """The kite without a network."""
        return self.kite.kite if isinstance(self.kite, HybridKite) else self.kite

    @property
    def correction(self) -> Correction | None:
        """The network, where there is one."""
        return self.kite.correction if isinstance(self.kite, HybridKite) else None

    @cached_property
    def programs(self) -> Programs:
        """The equations, recorded."""
        return record_programs(self.kite, self.law)

    @cached_property
    def states(self) -> tuple[Signal, ...]:
        """The 12 states, then those of the effects."""
        units = {n: UNITS[n] for n in STATES}
        units |= {n: u for e in self.kite.effects for n, u in zip(e.state_names(), e.state_units(), strict=True)}
        return tuple(state_signal(name, unit, self.start.states.get(name)) for name, unit in units.items())

    @cached_property
    def inputs(self) -> tuple[Signal, ...]:
        """Exogenous inputs that the model reads."""
        heights = self.kite.heights
        return tuple(input_signal(name, heights, self.start.inputs.get(name, 0.0)) for name in self.programs.inputs)

    @cached_property
    def set_points(self) -> tuple[Signal, ...]:
        """All of SURFACES; those that a law drives are overwritten by it."""
        return tuple(set_point_signal(name, self.start.set_points.get(name, 0.0)) for name in SURFACES)

    @cached_property
    def outputs(self) -> tuple[Signal, ...]:
        return tuple(output_signal(name) for name in OUTPUTS)

    @cached_property
    def parameters(self) -> tuple[Signal, ...]:
        """Every parameter of the model with its value, where it comes from, and the interval where a flight gives one."""
        rows = self.kite.parameters
        fitted = {name: self.fitted.get(name, {}) for name in self.programs.parameters}
        return tuple(
            Signal(n, rows[n].unit, "", rows[n].value, rows[n].source, fitted[n].get("std"), fitted[n].get("interval"))
            for n in self.programs.parameters
        )
