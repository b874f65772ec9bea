"""The contract of an effect: one physical idea, at one place, with parameters whose null value means "absent"."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from awescli.notation.parameters import Parameter
from awescli.notation.quantities import UNITS
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.sizes import growth, widened
from awescli.physics.instant import Body, Coefficients, Instant, Line, Load, Wind

PLACES = ("airflow", "actuate", "body", "coefficients", "line", "load", "report")
"""Where an effect may act, in the order in which an instant is filled. An effect fills exactly one of these methods."""


class Effect:
    """One effect. Subclasses are final: they fill one place, and `rates`/`initial` if they have states of their own.

    name: its row in the table; parameters: with null as `value`, plausible range as bounds, listed for a kite of some 50 kg on 3 m2 and
    wider in an instance for a larger one (`sizes.growth`, probes too); targets: where it may act
    (surfaces, axes, clock groups), empty if there is only one such place; always: part of every kite, not a candidate;
    slips: parameter name -> {size: the mistake that leaves it}: sizes that no sensor has, and a unit does;
    states, units: its own states and their units, in which `target` is the unit of what it acts on;
    empirical: a term fitted to a residual, not physics; probes: parameter name -> sizes at which an effect that is flat at null (a lag,
    a threshold) is tried; abrupt: its presence changes the start of a rollout so much that only a re-fit from the probe can judge it;
    shapes: parameters that only give form to another one; refinements: shape -> values tried only once the effect is accepted;
    onset: the shape that is a moment of the flight [s on its clock], when the effect begins;
    start_spread: of its states, standard deviations about `initial`: what is not known of the flight before a rollout;
    last: its load answers the sum of all others, so that it stands behind them; reads: measured signals that it takes from the log, so
    that it cannot be flown without one; requires: rows of the kite file's own table that it reads; inputs: exogenous inputs that it reads
    (`Kite.input_names` has them then); logged: channels that a log must have for a kite with it; gives_line: it puts a line on the kite;
    of_line: it acts on a line, so that some other effect must give one; needs_times: a receiver that is late by a part of a row does the
    same; instrument: the sensor or actuator whose error it is; matters:
    parameter name -> size of an error of an instrument from which it changes what a model learns; those that have one are asked about all
    at once where a flight has no verdict (`tracing.instruments`); weight: its load is that of gravity on the kite's mass.

    Every method receives what stands at its place, the instant `at`, and `own`: the values of its parameters by short name.
    It must give back its input unchanged, to the last bit, when all parameters are null. It writes nothing into the instant (the tether
    alone says its tension there): what it received at its place is kept for its `rates` and `initial`, see `received`.
    """

    name: str = ""
    doc: str = ""
    parameters: tuple[Parameter, ...] = ()
    targets: tuple[str, ...] = ()
    states: tuple[str, ...] = ()
    start_spread: tuple[float, ...] = ()
    slips: dict[str, dict[float, str]] = {}
    units: tuple[str, ...] = ()
    probes: dict[str, tuple[float, ...]] = {}
    shapes: tuple[str, ...] = ()
    refinements: dict[str, tuple[float, ...]] = {}
    onset: str = ""
    abrupt: bool = False
    always: bool = False
    traceable: bool = True
    empirical: bool = False
    last: bool = False
    reads: tuple[str, ...] = ()
    requires: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    logged: tuple[str, ...] = ()
    gives_line: bool = False
    of_line: bool = False
    needs_times: bool = False
    instrument: str = ""
    matters: dict[str, float] = {}
    weight: bool = False

    def __init__(self, target: str = "", declaration: KiteDeclaration | None = None):
        """target: one of `targets`, or empty; declaration: the kite file (`declaration.KiteDeclaration`) it stands in."""
        self.target = target
        if declaration is not None:
            units = {p.name: p.unit for p in self.parameters}
            self.probes = {n: tuple(growth(units[n], declaration) * size for size in sizes) for n, sizes in self.probes.items()}
            self.parameters = tuple(widened(p, declaration) for p in self.parameters)

    @classmethod
    def accepts(cls, target: str) -> bool:
        """May an instance act on `target`?"""
        return target in (cls.targets or ("",))

    @property
    def key(self) -> str:
        """The name under which this instance stands in a kite file: `actuator_lag:rudder`."""
        return f"{self.name}:{self.target}" if self.target else self.name

    @property
    def acts_on(self) -> str:
        return self.target or self.place

    @property
    def place(self) -> str:
        """The one place this effect fills."""
        return next(p for p in PLACES if getattr(type(self), p) is not getattr(Effect, p))

    def rows(self) -> list[Parameter]:
        """Its parameters under their full names: `actuator_lag:rudder.tau`."""
        return [replace(p, name=f"{self.key}.{p.name}") for p in self.parameters]

    def state_names(self) -> list[str]:
        return [f"{self.key}.{s}" for s in self.states]

    def state_units(self) -> list[str]:
        """Units of its states, in their order."""
        of = UNITS.get(self.target, "-")
        return [unit.replace("target", of).replace("-/", "1/") for unit in self.units]

    def own(self, at: Instant) -> SimpleNamespace:
        return SimpleNamespace(**{p.name: at.values[f"{self.key}.{p.name}"] for p in self.parameters})

    def own_states(self, at: Instant) -> tuple:
        return tuple(at.states[s] for s in self.state_names())

    def received(self, at: Instant) -> Any:
        """What stood at its place before it acted (not at `load` and `report`, which come later than states are asked for)."""
        return at.received[self.key]

    def actuate(self, deflections: dict, at: Instant, own: SimpleNamespace) -> dict:
        """Deflections [rad] that the set-points become."""
        return deflections

    def airflow(self, wind: Wind, at: Instant, own: SimpleNamespace) -> Wind:
        """The air at the kite."""
        return wind

    def body(self, body: Body, at: Instant, own: SimpleNamespace) -> Body:
        """Mass, inertia, centre of mass."""
        return body

    def coefficients(self, coefficients: Coefficients, at: Instant, own: SimpleNamespace) -> Coefficients:
        """Aerodynamic coefficients."""
        return coefficients

    def declared_line(self, at: Instant) -> Line:
        """The line as declared, which the effects at the place `line` then change; of the one effect that gives a line."""
        raise TypeError(f"effect '{self.name}' gives no line")

    def line(self, line: Line, at: Instant, own: SimpleNamespace) -> Line:
        """The line and the winch."""
        return line

    def load(self, at: Instant, own: SimpleNamespace) -> Load:
        """A force and moment; `at.applied` holds the sum of the loads before it."""
        raise TypeError(f"effect '{self.name}' acts on {self.place}, it gives no load")

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        """What the sensors say of the true outputs."""
        return reported

    def start_spreads(self, own: SimpleNamespace) -> tuple:
        """`start_spread`, of an effect whose states can only be as far from `initial` as its parameters let them."""
        return self.start_spread

    def rates(self, at: Instant, own: SimpleNamespace) -> tuple:
        """Time derivatives of its states."""
        return ()

    def initial(self, at: Instant, own: SimpleNamespace) -> tuple:
        """Its states at the start of a rollout, as if the flight had gone on before."""
        return ()
