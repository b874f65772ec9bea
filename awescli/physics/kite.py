"""Kite: an ordered list of effects on a rigid body. The only place where an instant is filled and loads are summed."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from awescli.notation.constraints import parse_constraint
from awescli.notation.errors import BadInput, BadInputs, did_you_mean
from awescli.notation.frames import add, cross, dot, rotate, rotate_back, rotation_body_to_ned, scale
from awescli.notation.parameters import Parameter, ParameterTable
from awescli.notation.phases import input_of
from awescli.notation.quantities import MEASURED, STATES, SURFACES
from awescli.notation.scalars import Scalar, sqrt
from awescli.physics.airflow import air_data, declared_wind, wind_vector
from awescli.physics.declaration import KiteDeclaration, parameter_of
from awescli.physics.disturbances import DISTURBANCES, FORCES, GUST_RATES, GUSTS, LINE, MOMENTS, PHASE, RECORDED, disturbances
from awescli.physics.disturbances import parameters as nuisance_parameters
from awescli.physics.effects import EFFECTS
from awescli.physics.effects.aerodynamics import COEFFICIENTS, body_axes, parse_monomial
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Body, Coefficients, Instant, Load
from awescli.physics.phase_values import own_values, with_those_of_now, wrong_phases
from awescli.physics.rigid_body import acceleration, state_derivative

REQUIRED = ("m", "g", "S", "b", "c", "Jx", "Jy", "Jz", "Jxz")
"""Parameters of every kite file: mass, gravity, geometry, inertia. Effects require more (`Effect.requires`): the tether its line's."""
_SIGNALS = (
    "density", "turbulence_n", "turbulence_e", "turbulence_d", "turbulence_p", *DISTURBANCES, PHASE, "time",
)  # fmt: skip
"""Exogenous inputs of every kite; `Effect.inputs` are those of the effects that are there."""


def record_errors(declaration: KiteDeclaration, stations: int) -> list[Parameter]:
    """Nuisance parameters: the error of the recorded speed [m/s] and direction [rad] of every station, lasting the whole flight.

    The kite meets the same stations' errors in every loop, so they bias parameters unless they are estimated with them. They belong to a
    flight, not to a kite: never written into a kite file. Three standard deviations at most: more is not an error of the record but
    an effect on the wind, which is traced.
    """
    law = declaration.wind
    stds = {"speed": ("m/s", max(law.std, 1e-6)), "direction": ("rad", max(law.direction_std, 1e-6))}
    return [
        Parameter(f"record.{kind}_{i}", 0.0, unit, -3 * std, 3 * std, std=std, source="nuisance")
        for kind, (unit, std) in stds.items()
        for i in range(stations)
    ]


def make_effect(key: str, declaration: KiteDeclaration) -> Effect:
    """The effect that a kite file names as `name` or `name:target`. Raises BadInput with the nearest known name."""
    name, _, target = key.partition(":")
    if name not in EFFECTS:
        raise BadInput(f"unknown effect '{name}'", where="effects", do=did_you_mean(name, EFFECTS))
    if not EFFECTS[name].accepts(target):
        known = [f"{name}:{t}" for t in EFFECTS[name].targets] or [name]
        raise BadInput(f"effect '{name}' cannot act on '{target}'", where="effects", do=did_you_mean(key, known))
    return EFFECTS[name](target, declaration)


def has_line(declaration: KiteDeclaration) -> bool:
    """Whether a kite is declared on a line; one that is not flies free."""
    return any(name in EFFECTS and EFFECTS[name].gives_line for name in (key.partition(":")[0] for key in declaration.effects))


def can_act(key: str, declaration: KiteDeclaration) -> bool:
    """Whether a kite has what the effect `key` acts on: a line, a surface that moves something."""
    effect = make_effect(key, declaration)
    if effect.of_line and not has_line(declaration):
        return False
    return effect.target not in SURFACES or effect.target in surfaces_used(declaration)


def surfaces_used(declaration: KiteDeclaration) -> set[str]:
    """Set-points that the declared kite answers to: those in its aerodynamic table, and those that its effects drive something with."""
    table = {variable for terms in declaration.aerodynamics.terms.values() for text in terms for variable, *_ in parse_monomial(text)}
    driving = {name for key in declaration.effects for name in make_effect(key, declaration).logged}
    return {name for name in SURFACES if name in table | driving}


def needed_by(declaration: KiteDeclaration) -> tuple[str, ...]:
    """Channels that a log must have to fly this kite, beside those of every model, in the order of the effects that ask for them."""
    effects = [make_effect(key, declaration) for key in declaration.effects]
    return tuple(dict.fromkeys(name for e in effects for name in (*e.logged, *e.reads)))


def with_new(known: Sequence[str], new: Sequence[str]) -> tuple[str, ...]:
    """Keys of effects with new ones added before those whose load answers the sum of all others (the tether, docs/equations.md (12)).

    New ones stand in the order of the table: a kite is the same, also to the compiler, in whatever order its effects were found."""
    at = next((i for i, key in enumerate(known) if EFFECTS[key.partition(":")[0]].last), len(known))
    return (*known[:at], *sorted(new, key=_place), *known[at:])


def _place(key: str) -> tuple[int, str]:
    """Where an effect stands among all."""
    name, _, target = key.partition(":")
    return list(EFFECTS).index(name) if name in EFFECTS else len(EFFECTS), target


def check_declaration(declaration: KiteDeclaration, where: Callable[..., str]) -> None:
    """Everything that the schema cannot see: effects, targets, monomials, parameters that are missing. Raises BadInputs.

    where: names the place of a key in the file (`kite.yaml:12: aerodynamics.terms.CL`).
    """
    errors = []
    wanted: dict[str, tuple[str, ...]] = {name: ("parameters",) for name in REQUIRED}
    for i, key in enumerate(declaration.effects):
        try:
            effect = make_effect(key, declaration)
        except BadInput as e:
            errors.append(BadInput(e.what, where("effects", i), e.do))
            continue
        wanted |= {name: ("parameters",) for name in effect.requires}
        if effect.of_line and not has_line(declaration):
            what = f"effect '{key}' acts on a line, and no effect gives the kite one"
            errors.append(BadInput(what, where("effects", i), "Add `tether` to the effects, or leave this one out."))
    known = COEFFICIENTS[declaration.aerodynamics.frame]
    for coefficient, terms in declaration.aerodynamics.terms.items():
        place = ("aerodynamics", "terms", coefficient)
        if coefficient not in known:
            errors.append(BadInput(f"unknown coefficient '{coefficient}'", where(*place), did_you_mean(coefficient, known)))
        for monomial, parameter in terms.items():
            wanted[parameter] = (*place, monomial)
            try:
                parse_monomial(str(monomial))
            except BadInput as e:
                errors.append(BadInput(e.what, where(*place, monomial), e.do))
    for name, place in wanted.items():
        if name not in declaration.parameters:
            errors.append(
                BadInput(f"parameter '{name}' is not declared", where(*place), f"Add it under parameters: {name}: {{value: ...}}")
            )
    for name, row in declaration.parameters.items():
        try:
            parameter_of(name, row)
        except BadInput as e:
            errors.append(BadInput(e.what, where("parameters", name), e.do))
    errors += [*wrong_phases(tuple(declaration.parameters), declaration.effects, where), *_wrong_constraints(declaration, where)]
    if errors:
        raise errors[0] if len(errors) == 1 else BadInputs(errors)


def _wrong_constraints(declaration: KiteDeclaration, where: Callable[..., str]) -> list[BadInput]:
    """What cannot be read in the constraints, or names no parameter of the file."""
    errors = []
    for i, text in enumerate(declaration.constraints):
        try:
            named = parse_constraint(text).factors
        except BadInput as e:
            errors.append(BadInput(e.what, where("constraints", i), e.do))
            continue
        for name in named:
            if name not in declaration.parameters:
                do = did_you_mean(name, declaration.parameters)
                errors.append(BadInput(f"'{text}' names the unknown parameter '{name}'", where("constraints", i), do))
    return errors


STATION = (10.0,)
"""[m] height of the one station of a wind record of which nothing else is known: where weather services measure."""


class Kite:
    """A declared kite as three functions of vectors: `derivative`, `outputs`, `initial`.

    x = 12 states (`quantities.STATES`), then the states of the effects, then the held set-points (`quantities.SURFACES`);
    u = exogenous inputs, names in `input_names`; c = parameters in table order, names in `parameter_names`.
    extra: keys of effects beside the declared ones (candidates at their null value).
    heights: heights of the wind record [m].
    """

    def __init__(self, declaration: KiteDeclaration, heights: Iterable[float] = STATION, extra: Sequence[str] = ()):
        self.declaration = declaration
        self.heights = tuple(float(h) for h in heights)
        keys = [k for k in declaration.effects if k not in extra]
        self.effects = [make_effect(k, declaration) for k in with_new(keys, extra)]
        if not has_line(declaration) and (lost := [e.key for e in self.effects if e.of_line]):
            raise BadInput(f"{', '.join(lost)} act on a line, and the kite file declares none", "effects", "Leave them out.")
        table = declaration.table()
        own = [p for effect in self.effects for p in effect.rows() if p.name not in table]
        record = record_errors(declaration, len(self.heights))
        self.record = tuple(p.name for p in record)
        self.parameters: ParameterTable = table.with_rows([*own, *nuisance_parameters(), *record])
        self.parameter_names = tuple(self.parameters)
        self.own_in_phase = own_values(self.parameter_names)
        self.constraints = tuple(parse_constraint(text) for text in declaration.constraints)
        self.state_names = (*STATES, *(s for e in self.effects for s in e.state_names()))
        self.x_names = (*self.state_names, *SURFACES)
        wind = (f"wind_{kind}_{i}" for kind in ("speed", "direction", "down") for i in range(len(self.heights)))
        read = dict.fromkeys(name for e in self.effects for name in e.inputs)
        phases = dict.fromkeys(input_of(phase) for _, _, phase in self.own_in_phase)
        self.input_names = (*_SIGNALS, *read, *(f"{s}_rate" for s in SURFACES), *wind, *phases)
        self.tether = next((e for e in self.effects if e.gives_line), None)
        self.by_place: dict[str, list[Effect]] = {
            place: [e for e in self.effects if e.place == place] for place in {e.place for e in self.effects}
        }

    @property
    def start_spread(self) -> np.ndarray:
        """(n_e,) standard deviations of the effects' states about `initial`, where a rollout begins."""
        values = {p.name: p.value for p in self.parameters.rows}
        owns = (SimpleNamespace(**{p.name: values[f"{e.key}.{p.name}"] for p in e.parameters}) for e in self.effects)
        return np.array([s for e, own in zip(self.effects, owns, strict=True) for s in e.start_spreads(own)])

    def _at(self, place: str) -> Sequence[Effect]:
        return self.by_place.get(place, ())

    def _through(self, place: str, value: Any, at: Instant) -> Any:
        """What the effects at a place make of what stands there, one after the other; each keeps what it received."""
        for e in self._at(place):
            at.received[e.key] = value
            value = getattr(e, place)(value, at, e.own(at))
        return value

    def instant(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> Instant:
        """Fill one instant, from the state down to the loads' sum about the reference point."""
        inputs = dict(zip(self.input_names, u, strict=True))
        values = with_those_of_now(dict(zip(self.parameter_names, c, strict=True)), self.own_in_phase, inputs)
        z = SimpleNamespace(**dict(zip(STATES, x, strict=False)))
        setpoints = dict(zip(SURFACES, x[len(self.state_names) :], strict=True))
        states = dict(zip(self.state_names[12:], x[12:], strict=False))
        R = rotation_body_to_ned(z.phi, z.theta, z.psi)
        position = (z.p_n, z.p_e, z.p_d)
        distance = sqrt(dot(position, position))
        at = Instant(z, R, rotate(R, (z.u, z.v, z.w)), inputs, values, setpoints, distance, scale(1 / distance, position), states)
        # air
        stations = inputs | {
            f"wind_{n.removeprefix('record.')}": inputs[f"wind_{n.removeprefix('record.')}"] + values[n] for n in self.record
        }
        wind = wind_vector(*declared_wind(self.declaration.wind, self.heights, -z.p_d, stations), inputs["density"])
        wind = self._through("airflow", wind, at)
        # gusts last, so that no effect scales them
        beside = disturbances(inputs, values)
        axes = zip(("n", "e", "d", "roll", "pitch", "yaw"), (*GUSTS, *GUST_RATES), strict=True)
        wind = wind._replace(**{axis: getattr(wind, axis) + beside[gust] for axis, gust in axes})
        at.wind = wind
        at.air_velocity, at.V_a, at.alpha, at.beta = air_data(R, at.v_ned, wind)
        at.dynamic_pressure = wind.density * at.V_a * at.V_a / 2
        # surfaces
        meant = {**setpoints, **{s: setpoints[s] + beside[axis] for s, axis in RECORDED.items()}}
        at.deflections = self._through("actuate", meant, at)
        # kite
        v = values
        body = Body(v["m"], 0.0, v["Jx"], v["Jy"], v["Jz"], v["Jxz"], (0.0, 0.0, 0.0))
        at.body = self._through("body", body, at)
        at.coefficients = self._through("coefficients", Coefficients(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), at)
        # line, where there is one
        if self.tether is not None:
            line = self._through("line", self.tether.declared_line(at), at)
            at.line = line._replace(length=line.length + beside[LINE])
        # loads, each seeing the sum of those before it
        at.applied = at.loads["aerodynamics"] = aerodynamic_load(at)
        at.applied = at.applied._replace(force=add(at.applied.force, scale(at.body.mass, tuple(beside[f] for f in FORCES))))
        for e in self._at("load"):
            load = at.loads[e.key] = e.load(at, e.own(at))
            force, moment = add(at.applied.force, load.force), add(at.applied.moment, load.moment)
            at.applied = Load(force, moment, at.applied.mass_across + load.mass_across)
        at.acceleration = acceleration(at.body, at.applied, rotate_back(R, at.p_hat))
        derivative = state_derivative(z, R, at.body, at.acceleration, self._about_centre_of_mass(at))
        at.derivative = (*derivative[:9], *(rate + beside[m] for rate, m in zip(derivative[9:], MOMENTS, strict=True)))
        return at

    @staticmethod
    def _about_centre_of_mass(at: Instant) -> tuple:
        """Moment about the centre of mass: M - cg x F (weight, which acts there, contributes nothing by itself)."""
        x, _, z = at.body.cg
        if isinstance(x, float) and isinstance(z, float) and x == z == 0.0:
            return at.applied.moment
        weight = scale(at.body.mass * at.values["g"], (at.R[2][0], at.R[2][1], at.R[2][2]))
        surface = tuple(f - w for f, w in zip(at.applied.force, weight, strict=True))
        arm = cross(at.body.cg, surface)
        return tuple(m - a for m, a in zip(at.applied.moment, arm, strict=True))

    def derivative(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> list:
        """d/dt of the 12 states and the effects' states (the set-points are held)."""
        at = self.instant(x, u, c)
        return [*at.derivative, *(rate for e in self.effects for rate in e.rates(at, e.own(at)))]

    def initial(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> list:
        """The effects' states at the start of a rollout, given the 12 states, set-points and inputs there."""
        at = self.instant(x, u, c)
        return [value for e in self.effects for value in e.initial(at, e.own(at))]

    def outputs(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> list:
        """What the sensors report and what was commanded, in the order of `quantities.OUTPUTS`."""
        at = self.instant(x, u, c)
        z, a = at.z, at.acceleration
        reported = {
            "p_n": z.p_n, "p_e": z.p_e, "p_d": z.p_d,
            "v_n": at.v_ned[0], "v_e": at.v_ned[1], "v_d": at.v_ned[2],
            "phi": z.phi, "theta": z.theta, "psi": z.psi, "p": z.p, "q": z.q, "r": z.r,
            "a_x": a[0], "a_y": a[1], "a_z": a[2],
            "V_a": at.V_a, "alpha": at.alpha, "beta": at.beta, "tension": at.tension,
        }  # fmt: skip
        reported = self._through("report", reported, at)
        return [*(reported[name] for name in MEASURED), *at.setpoints.values()]

    def with_values(self, values: Mapping[str, float]) -> "Kite":
        """The same kite with other parameter values."""
        return self.with_rows(self.parameters.with_values(values).rows)

    def with_rows(self, rows: Iterable[Parameter]) -> "Kite":
        """The same kite with other rows of parameters."""
        other = object.__new__(Kite)
        other.__dict__.update(self.__dict__)
        other.parameters = self.parameters.with_rows(rows)
        return other

    def declare(self, keys: Sequence[str], free: Sequence[str] = (), table: ParameterTable | None = None) -> KiteDeclaration:
        """The declaration with the effects `keys` added and the parameters of `table` (default: own) written in."""
        table = table or self.parameters
        known = list(self.declaration.effects)
        names = [n for e in self.effects if e.key in (*known, *keys) for n in (p.name for p in e.rows())]
        rows = [replace(table[n], free=True) if n in free else table[n] for n in dict.fromkeys((*self.declaration.parameters, *names))]
        declared = self.declaration.with_parameters(ParameterTable(rows))
        return declared.model_copy(update={"effects": with_new(known, [k for k in keys if k not in known])})


def aerodynamic_load(at: Instant) -> Load:
    """f_a and m_a (docs/equations.md (10), (11); Beard & McLain eqs. 4.6-4.16): qbar S C, moments with span and chord."""
    C, v = at.coefficients, at.values
    pressure_area = at.dynamic_pressure * v["S"]
    force = scale(pressure_area, body_axes(C.CD, C.CY, C.CL, at.alpha, at.beta))
    return Load(force, (pressure_area * v["b"] * C.Cl, pressure_area * v["c"] * C.Cm, pressure_area * v["b"] * C.Cn))


def candidates(declaration: KiteDeclaration, measured: Sequence[str], moving: Sequence[str]) -> list[str]:
    """Keys of all traceable effects that are not declared and could show in a flight that measures `measured` and moves `moving`."""
    keys = []
    for name, effect in EFFECTS.items():
        if effect.always or not effect.traceable:
            continue
        for target in effect.targets or ("",):
            if target in SURFACES and target not in moving:
                continue
            if target in MEASURED and target not in measured:
                continue
            key = f"{name}:{target}" if target else name
            if key not in declaration.effects and can_act(key, declaration):
                keys.append(key)
    return keys
