"""A model as an aircraft of JSBSim: its own loads as external forces, its sensors and actuators as flight-control components.

JSBSim integrates, gives gravity, density, wind and turbulence; what acts on the kite is the recorded program, computed from the states
of the frame, effect by effect. States of effects are stepped by Adams-Bashforth of second order. Everything of the model is a property
below awes/, in SI units. JSBSim counts in ft, lbf and slug; its unit METER is 3.2808399 ft, so that only ft, lbf and slug stand here.

The planet is a ball that neither turns nor curves, with the winch at longitude and latitude 0: north, east and up are its z, y and x.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence

from awescli.engine.record import Scalar, Tape, record
from awescli.export.jsbsim_functions import component, components, element, read, value
from awescli.export.model import ExportedModel
from awescli.export.programs import Program, known_quantities, needed, values_of
from awescli.notation.errors import BadInput
from awescli.notation.quantities import OUTPUTS, STATES, SURFACES
from awescli.physics.disturbances import DISTURBANCES, GUST_RATES, GUSTS
from awescli.physics.instant import Body, Load

FT = 1 / 0.3048
"""Feet in a metre."""
LBF = 0.45359237 * 9.80665
"""Newtons in a pound-force."""
SLUG = LBF * FT
"""Kilograms in a slug."""
RADIUS = 1e10
"""[ft] of the planet: its surface is flat to 1e-5 m within a line's length, and a position is still known to 1e-6 m."""
JSBSIM_GRAVITY = 32.174049
"""ft/s2: what JSBSim divides an empty weight by to have a mass."""
WITH_KITE = "moves-with-kite"
"""The load of what moves with the kite without being part of its mass: air (added_mass), line (Load.mass_across)."""
FRAMES = 1600
"""[Hz] at which JSBSim is run, as the README has it. Where a flight magnifies errors, the steps of a controller cost its integrators
1e-2 of a range at 400 Hz, 2e-3 at 800 and 5e-4 at 1600."""

_FROM_FT = value(1 / FT)
_STATES = {
    "p_n": element("product", read("position/ecef-z-ft"), _FROM_FT), "p_e": element("product", read("position/ecef-y-ft"), _FROM_FT),
    "p_d": element("product", element("difference", value(RADIUS), read("position/ecef-x-ft")), _FROM_FT),
    **{n: element("product", read(f"velocities/{n}-fps"), _FROM_FT) for n in "uvw"},
    **{n: read(f"attitude/{n}-rad") for n in ("phi", "theta", "psi")}, **{n: read(f"velocities/{n}-rad_sec") for n in "pqr"},
}  # fmt: skip
_ATMOSPHERE = {
    "density": element("product", read("atmosphere/rho-slugs_ft3"), value(SLUG * FT**3)),
    **{
        gust: element("product", read(f"atmosphere/total-wind-{way}-fps"), _FROM_FT)
        for gust, way in zip(GUSTS, ("north", "east", "down"), strict=True)
    },
    **{rate: read(f"atmosphere/{axis}-turb-rad_sec") for rate, axis in zip(GUST_RATES, "pqr", strict=True)},
}  # fmt: skip
"""Inputs that JSBSim's atmosphere gives: its wind comes on top of the model's own."""
_AFTER_FIRST = element("sum", value(1e-9), element("product", value(1.5), read("simulation/dt")))
_FIRST_FRAMES = element("lt", read("simulation/sim-time-sec"), _AFTER_FIRST)
"""While time stands, where dt is null too, and in the first frame: nothing has been before."""


def jsbsim_files(model: ExportedModel) -> dict[str, str]:
    """`aircraft/NAME/NAME.xml`, a planet, a start. Raises BadInput for what has no counterpart in JSBSim."""
    body = _rigid_body(model)
    name = model.identifier
    weighs = any(e.weight for e in model.kite.effects)
    return {
        f"aircraft/{name}/{name}.xml": _aircraft(model, body),
        f"aircraft/{name}/start.xml": _start(model),
        "planet.xml": planet_xml(model.kite.parameters["g"].value if weighs else 1e-12),
    }


def planet_xml(gravity: float) -> str:
    """A ball that does not turn, so large that gravity [m/s2] is the same everywhere."""
    radius, g_m = repr(RADIUS), repr(gravity * FT * RADIUS * RADIUS)
    return (
        f'<planet name="large"><semimajor_axis unit="FT">{radius}</semimajor_axis><semiminor_axis unit="FT">{radius}</semiminor_axis>'
        f'<rotation_rate unit="RAD/SEC">0.0</rotation_rate><GM unit="FT3/SEC2">{g_m}</GM><J2>0.0</J2></planet>\n'
    )


def property_name(kind: str, name: str) -> str:
    """`awes/state/actuator_lag-rudder-deflection`: what a signal of the model is called in JSBSim."""
    return f"awes/{kind}/{''.join(c if c.isalnum() or c == '_' else '-' for c in name)}"


def _refused(what: str, do: str) -> BadInput:
    return BadInput(what, "--to jsbsim", do)


def _rigid_body(model: ExportedModel) -> Body:
    """Mass, inertia and centre of mass as JSBSim wants them: numbers. Raises BadInput naming what it has no counterpart for."""
    if model.correction is not None:
        what = "the network has no counterpart in JSBSim: its corrections are rates of change, not forces"
        raise _refused(what, "Export a model without it: --model with_effects, or --to c, fmu, casadi.")
    tape, outputs = _recorded(model, lambda at: [at.body.mass, *at.body[2:6], *at.body.cg])
    if any(tape.nodes[i][:2] in (("input", "x"), ("input", "u")) for i in needed(Program("body", tape, tuple(outputs), (), {}))):
        raise _refused("a mass, inertia or centre of mass that changes in flight has no counterpart in JSBSim", "Leave the effect out.")
    numbers = {"x": [0.0] * len(model.kite.x_names), "u": [0.0] * len(model.inputs), "c": [*model.values.values()]}
    m, Jx, Jy, Jz, Jxz, x, y, z = values_of(tape, outputs, **numbers)
    return Body(m, 0.0, Jx, Jy, Jz, Jxz, (x, y, z))


def _recorded(model: ExportedModel, of: Callable, names: dict[int, str] | None = None) -> tuple[Tape, list[int]]:
    """Something of an instant, recorded on the model's inputs and parameters."""
    kite, inputs, parameters = model.kite, model.programs.inputs, model.programs.parameters

    def function(x, u, c):
        at_u, at_c = dict(zip(inputs, u, strict=True)), dict(zip(parameters, c, strict=True))
        full = [at_u.get(n, 0.0) for n in kite.input_names], [at_c.get(n, 0.0) for n in kite.parameter_names]
        at = kite.instant(x, *full)
        if names is not None:
            names.update(known_quantities(at))
        return of(at) if names is None else [*of(at), *kite.derivative(x, *full)[12:], *kite.outputs(x, *full)]

    return record(function, x=len(kite.x_names), u=len(inputs), c=len(parameters))


def _loads(model: ExportedModel) -> tuple[list[str], Program]:
    """(keys of the loads, program of all of them, of the rates of the effects' states, and of the sensors). JSBSim gives the weight.

    Its mass is the same in all directions; what air and line that move with the kite take of the force is one more load: m a - f.
    """
    keys: list[str] = []
    heavy = {e.key for e in model.kite.effects if e.weight}

    def of(at):
        loads = {key: load for key, load in at.loads.items() if key not in heavy}
        if any(isinstance(mass, Scalar) for mass in (at.body.added_z, at.applied.mass_across)):
            taken = tuple(at.body.mass * a - f for a, f in zip(at.acceleration, at.applied.force, strict=True))
            loads[WITH_KITE] = Load(taken, (0.0 * taken[0],) * 3)
        keys[:] = loads
        return [component for load in loads.values() for component in (*load.force, *load.moment)]

    names: dict[int, str] = {}
    tape, outputs = _recorded(model, of, names)
    return keys, Program("loads", tape, tuple(outputs), (), names)


def _aircraft(model: ExportedModel, body: Body) -> str:
    keys, program = _loads(model)
    values = model.values
    beside = {name for name in DISTURBANCES if name not in _ATMOSPHERE}
    inputs = [n for n in model.programs.inputs if n not in _ATMOSPHERE and n not in beside]
    leaves = {
        "x": [read(property_name("state", n)) for n in model.kite.state_names] + [read(property_name("held", n)) for n in SURFACES],
        "u": [value(0.0) if n in beside else read(property_name("input", n)) for n in model.programs.inputs],
        "c": [value(v) for v in values.values()],
    }  # fmt: skip
    own = [s.name for s in model.states[12:]]
    load = [property_name("load", f"{key}-{c}") for key in keys for c in ("f_x", "f_y", "f_z", "m_x", "m_y", "m_z")]
    results = [*load, *(property_name("rate", n) for n in own), *(property_name("sensor", n) for n in OUTPUTS)]
    declared = [f'<property value="{s.value!r}">{property_name("set_point", s.name)}</property>' for s in model.set_points]
    declared += [f'<property value="{s.value!r}">{property_name("input", s.name)}</property>' for s in model.inputs if s.name in inputs]
    initial = list(components(model.programs.initial, leaves, "awes/start", [property_name("start", n) for n in own])) if own else []
    surfaces = "by the fitted controller" if model.programs.law else "are awes/set_point/"
    parts = [
        f"<!-- {_plain(model.declaration.name)}, {model.label}; made by awes {model.provenance.get('awes', '')}. Set-points {surfaces}.",
        *(f"     {_plain(f'{key}: {text}')}" for key, text in model.provenance.items() if not isinstance(text, Mapping)), "-->",
        f'<fdm_config name="{model.identifier}" version="2.0" release="ALPHA"><fileheader/>',
        _metrics(model), _mass_balance(body), "<ground_reactions/><propulsion/>",
        f'<flight_control name="{model.identifier}">', *declared,
        '<channel name="state">', *(component(property_name("state", n), _STATES[n]) for n in STATES),
        *(component(property_name("input", n), _ATMOSPHERE[n]) for n in model.programs.inputs if n in _ATMOSPHERE), "</channel>",
        *_flown(model, leaves),
        '<channel name="effects">', *initial, *_stepped(own), "</channel>",
        '<channel name="loads">', *components(program, leaves, "awes/now", results), "</channel>", "</flight_control>",
        "<aerodynamics/>", "<external_reactions>", *(_reactions(key, body) for key in keys), "</external_reactions>", "</fdm_config>", "",
    ]  # fmt: skip
    return "\n".join(parts)


def _plain(text: str) -> str:
    """Text inside a comment."""
    return " ".join(text.split()).replace("--", "- -").replace("<", "&lt;")


def _flown(model: ExportedModel, leaves: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """awes/held/SURFACE: what is flown of awes/set_point/SURFACE, or of what a law says at the rate at which it sets them.

    A multistep rule takes a step of its input half a frame early: half of the step is taken back for one frame, one frame later.
    """
    asked = "set_point"
    if model.programs.law:
        asked = "commanded"
        # what the law does not drive is what it is given
        known = {**leaves, "x": [*leaves["x"][: len(model.states)], *(read(property_name("set_point", n)) for n in SURFACES)]}
        yield '<channel name="controller">'
        yield from components(model.programs.law, known, "awes/law", [property_name("law", n) for n in SURFACES])
        yield from _once_a_period(model.declaration.set_point_rate, asked)
        yield "</channel>"
    yield '<channel name="set_points">'
    for name in SURFACES:
        now, last, before = (read(property_name(kind, name)) for kind in (asked, "last", "before_last"))
        later = element("difference", now, element("product", value(0.5), element("difference", last, before)))
        yield component(property_name("held", name), element("ifthen", _FIRST_FRAMES, now, later))
        yield component(property_name("before_last", name), last)
        yield component(property_name("last", name), now)
    yield "</channel>"


def _once_a_period(rate: float, kept: str) -> Iterator[str]:
    """awes/`kept`/SURFACE: what the law said when the last period of the controller began, whatever the frames of JSBSim are."""
    now, last, begins = (f"awes/controller/{name}" for name in ("period", "last_period", "period_begins"))
    periods = element("sum", element("product", read("simulation/sim-time-sec"), value(rate)), value(1e-6))
    yield component(now, element("floor", periods))
    stands = element("lt", read("simulation/sim-time-sec"), value(1e-9))
    yield component(begins, element("ifthen", stands, value(1.0), element("difference", read(now), read(last))))
    for name in SURFACES:
        new, old = read(property_name("law", name)), read(property_name(kept, name))
        yield component(property_name(kept, name), element("ifthen", element("gt", read(begins), value(0.5)), new, old))
    yield component(last, read(now))


def _stepped(own: Sequence[str]) -> Iterator[str]:
    """States of effects: their start while time stands, then Adams-Bashforth steps on the rates of the frames before."""
    for name in own:
        state, rate, before = (property_name(kind, name) for kind in ("state", "rate", "before"))
        second_order = element("difference", element("product", value(1.5), read(rate)), element("product", value(0.5), read(before)))
        step = element("product", read("simulation/dt"), element("ifthen", _FIRST_FRAMES, read(rate), second_order))
        stands = element("lt", read("simulation/sim-time-sec"), value(1e-9))
        yield component(state, element("ifthen", stands, read(property_name("start", name)), element("sum", read(state), step)))
        yield component(before, read(rate))


def _metrics(model: ExportedModel) -> str:
    area, span, chord = (model.kite.parameters[name].value for name in ("S", "b", "c"))
    return (
        f'<metrics><wingarea unit="FT2">{area * FT * FT!r}</wingarea><wingspan unit="FT">{span * FT!r}</wingspan>'
        f'<chord unit="FT">{chord * FT!r}</chord><location name="AERORP" unit="IN">{_place((0, 0, 0))}</location></metrics>'
    )


def _mass_balance(body: Body) -> str:
    """Inertia about the centre of mass, with -Jxz off the diagonal as in the kite file, which is JSBSim's way where cross products are
    not to be negated."""
    inertia = {"xx": body.Jx, "yy": body.Jy, "zz": body.Jz, "xz": body.Jxz}
    moments = "".join(f'<i{axes} unit="SLUG*FT2">{j * FT * FT / SLUG!r}</i{axes}>' for axes, j in inertia.items())
    return (
        f'<mass_balance negated_crossproduct_inertia="false">{moments}<emptywt unit="LBS">{body.mass / SLUG * JSBSIM_GRAVITY!r}</emptywt>'
        f'<location name="CG" unit="IN">{_place(body.cg)}</location></mass_balance>'
    )


def _place(arm: Sequence[float]) -> str:
    """A place (x, y, z) [m, FRD] in JSBSim's structural frame: inches, x aft, y right, z up."""
    x, y, z = (12 * FT * float(a) for a in arm)
    return f"<x>{-x!r}</x><y>{y!r}</y><z>{-z!r}</z>"


def _reactions(key: str, body: Body) -> str:
    """Force and moment of one load, at the reference point; what resists the acceleration of the centre of mass acts there."""
    rows = []
    place = body.cg if key == WITH_KITE else (0, 0, 0)
    for kind, letter, unit in (("force", "f", 1 / LBF), ("moment", "m", FT / LBF)):
        for axis in "xyz":
            size = element("product", read(property_name("load", f"{key}-{letter}_{axis}")), value(unit))
            location = f'<location unit="IN">{_place(place)}</location>' if kind == "force" else ""
            direction = "".join(f"<{a}>{float(a == axis)}</{a}>" for a in "xyz")
            name = property_name("", f"{key}-{letter}_{axis}").rpartition("/")[2]
            rows.append(
                f'<{kind} name="{name}" frame="BODY"><function>{size}</function>{location}<direction>{direction}</direction></{kind}>'
            )
    return "\n".join(rows)


def _start(model: ExportedModel) -> str:
    """The start as a file of initial conditions, in the one of JSBSim's two forms that knows body rates."""
    at = {s.name: s.value or 0.0 for s in model.states[:12]}
    rows = {
        'position frame="ECEF" unit="FT"': (("x", RADIUS - at["p_d"] * FT), ("y", at["p_e"] * FT), ("z", at["p_n"] * FT)),
        'orientation frame="LOCAL" unit="RAD"': (("roll", at["phi"]), ("pitch", at["theta"]), ("yaw", at["psi"])),
        'velocity frame="BODY" unit="FT/SEC"': tuple(zip("xyz", (at[n] * FT for n in "uvw"), strict=True)),
        'attitude_rate frame="BODY" unit="RAD/SEC"': tuple(zip(("roll", "pitch", "yaw"), (at[n] for n in "pqr"), strict=True)),
    }  # fmt: skip
    lines = "\n".join(
        f"  <{head}>{''.join(f'<{axis}>{number!r}</{axis}>' for axis, number in own)}</{head.split()[0]}>" for head, own in rows.items()
    )
    return f'<!-- {_plain(model.start.origin)} -->\n<initialize name="start" version="2.0">\n{lines}\n</initialize>\n'
