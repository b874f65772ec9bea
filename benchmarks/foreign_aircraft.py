"""A kite file and a World -> the XML of a JSBSim aircraft, and of the planet it flies on.

From the kite file: mass, inertia, geometry, and the aerodynamic table, term by term, as JSBSim functions. The rest is JSBSim's: actuators
and sensors are its flight-control components, the air its wind and turbulence model, the motion its quaternion and integrators. Alpha-dot,
ground effect and compressibility stand in no function. The line is `foreign_line.py`, the sensors are `foreign_sensors.py`.

What the flight control computes in a frame sees this frame's states, but air data and loads of the frame before; what stands in
`coefficients` and `loads` of a World sees this frame's.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np
from foreign_kinds import Actuator, Signal, World
from foreign_line import line
from foreign_names import FT, RADIUS, SLUG, Names, Scene, computed, delayed, names_of, place
from foreign_sensors import Sensors

from awescli.flightlog.log import WindRecord
from awescli.notation.quantities import SURFACES
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.aerodynamics import parse_monomial

JSBSIM_GRAVITY = 32.174049
"""ft/s2: what JSBSim divides an empty weight by to have a mass."""
SLOWEST = 1.0
"""[m/s] airspeed is never taken smaller: the first frame has none."""

_RAW = {
    "x_ft": "position/ecef-x-ft", "y_ft": "position/ecef-y-ft", "z_ft": "position/ecef-z-ft", "air_fps": "velocities/vt-fps",
    "u_fps": "velocities/u-fps", "v_fps": "velocities/v-fps", "w_fps": "velocities/w-fps", "v_n_fps": "velocities/v-north-fps",
    "v_e_fps": "velocities/v-east-fps", "v_d_fps": "velocities/v-down-fps", "pressure_area": "aero/qbar-area",
    "rho_slug": "atmosphere/rho-slugs_ft3", "seconds": "simulation/sim-time-sec",
    **{f"wind_{axis[0]}_fps": f"atmosphere/total-wind-{axis}-fps" for axis in ("north", "east", "down")},
}  # fmt: skip
_AIR = {"V_a": f"max({SLOWEST}, air_fps / metre)", "qS": "lbf * pressure_area"}
_STATES = {
    "t": "seconds - lead",
    # near longitude and latitude 0 of the large planet, north, east and up are its z, y and x
    "p_n": "z_ft / metre", "p_e": "y_ft / metre", "p_d": "(planet - x_ft) / metre",
    **{name: f"{name}_fps / metre" for name in ("u", "v", "w", "v_n", "v_e", "v_d", "wind_n", "wind_e", "wind_d")},
    **_AIR, "rho": "slug_ft3 * rho_slug",
    "height": "-p_d", "distance": "sqrt(p_n * p_n + p_e * p_e + p_d * p_d)", "elevation": "height / distance",
    "R11": "cos(theta) * cos(psi)", "R21": "cos(theta) * sin(psi)", "R31": "-sin(theta)",
    "R12": "sin(phi) * sin(theta) * cos(psi) - cos(phi) * sin(psi)", "R22": "sin(phi) * sin(theta) * sin(psi) + cos(phi) * cos(psi)",
    "R32": "sin(phi) * cos(theta)",
    "R13": "cos(phi) * sin(theta) * cos(psi) + sin(phi) * sin(psi)", "R23": "cos(phi) * sin(theta) * sin(psi) - sin(phi) * cos(psi)",
    "R33": "cos(phi) * cos(theta)",
    "phase": "atan2(p_e * cos_a - p_n * sin_a, -sin_e * (p_n * cos_a + p_e * sin_a) - cos_e * p_d)",
    "heading": "psi - downwind",
    # a function is computed when it is read, unless it has been in this frame: held here, an acceleration may depend on the last one
    **{f"last_a_{axis}": f"a_{axis}" for axis in "xyz"},
}  # fmt: skip
_AXES = {"CD": ("DRAG", ""), "CY": ("SIDE", ""), "CL": ("LIFT", ""), "Cl": ("ROLL", "b"), "Cm": ("PITCH", "c"), "Cn": ("YAW", "b")}
"""Coefficient -> JSBSim's axis, and the length that makes a moment of it."""


def planet_xml(gravity: float) -> str:
    """A ball that does not turn, so large that gravity [m/s2] is the same everywhere."""
    radius, g_m = repr(RADIUS), repr(gravity * FT * RADIUS * RADIUS)
    return (
        f'<planet name="large"><semimajor_axis unit="FT">{radius}</semimajor_axis><semiminor_axis unit="FT">{radius}</semiminor_axis>'
        f'<rotation_rate unit="RAD/SEC">0.0</rotation_rate><GM unit="FT3/SEC2">{g_m}</GM><J2>0.0</J2></planet>'
    )


def aircraft_xml(kite: KiteDeclaration, world: World, values: Mapping[str, float], scene: Scene, sensors: Sensors) -> str:
    """The aircraft. values: the kind's numbers. Raises BadInput for a formula that cannot be read, or a kite of another frame."""
    parameters = {name: row.value for name, row in kite.parameters.items()}
    names = names_of(parameters, values, scene, tuple(world.signals))
    parts = [
        '<fdm_config name="kite" version="2.0" release="ALPHA"><fileheader/>',
        _metrics(parameters), _mass_balance(parameters, world, names), "<ground_reactions/><propulsion/>",
        '<flight_control name="kite">', *(f"<property>setpoint/{s}</property>" for s in SURFACES), "<property>drift/still</property>",
        '<channel name="states">', *_states(names), "</channel>",
        '<channel name="air">', *_air(names, world, scene.wind), "</channel>",
        '<channel name="winch">', *_winch(names, world, scene), "</channel>",
        '<channel name="actuators">', *_actuators(names, world), "</channel>",
        '<channel name="own">', *(_signal(names, name, s) for name, s in world.signals.items()), "</channel>",
        '<channel name="deflections">', *_deflections(names, world), "</channel>",
        '<channel name="sensors">', *sensors.components(names, world), "</channel>", "</flight_control>",
        "<aerodynamics>", *_aerodynamics(kite, names, world), "</aerodynamics>",
        "<external_reactions>", *line(kite, names.also({"V_a": "now/V_a", "qS": "now/qS"}), world), "</external_reactions>",
        "</fdm_config>",
    ]  # fmt: skip
    return "\n".join(parts)


def _metrics(parameters: Mapping[str, float]) -> str:
    area, span, chord = (parameters[name] for name in ("S", "b", "c"))
    return (
        f'<metrics><wingarea unit="FT2">{area * FT * FT!r}</wingarea><wingspan unit="FT">{span * FT!r}</wingspan>'
        f'<chord unit="FT">{chord * FT!r}</chord><location name="AERORP" unit="IN">{place((0, 0, 0))}</location></metrics>'
    )


def _mass_balance(parameters: Mapping[str, float], world: World, names: Names) -> str:
    """Inertia about the centre of mass, with -Jxz off the diagonal as in the kite file, which is JSBSim's way where cross products are
    not to be negated."""
    inertia = {axis: parameters[f"J{axis}"] * FT * FT / SLUG for axis in ("x", "y", "z", "xz")}
    mass = parameters["m"] + names.number(world.mass)
    moments = "".join(f'<i{a}{a} unit="SLUG*FT2">{inertia[a]!r}</i{a}{a}>' for a in "xyz")
    return (
        f'<mass_balance negated_crossproduct_inertia="false">{moments}<ixz unit="SLUG*FT2">{inertia["xz"]!r}</ixz>'
        f'<emptywt unit="LBS">{mass / SLUG * JSBSIM_GRAVITY!r}</emptywt>'
        f'<location name="CG" unit="IN">{place([names.number(arm) for arm in world.cg])}</location></mass_balance>'
    )


def _states(names: Names) -> Iterator[str]:
    """Time, states and air data in SI."""
    names = names.also(_RAW)
    for name, formula in _STATES.items():
        yield names.component(f"si/{name}", formula)


def _table(wind: WindRecord, values: np.ndarray) -> str:
    """values (M, H) of a wind record as JSBSim's table over height and time, linear in both and constant beyond."""
    rows = "\n".join(" ".join(map(repr, [float(h), *map(float, column)])) for h, column in zip(wind.height, values.T, strict=True))
    head = " ".join(repr(float(t)) for t in wind.time)
    return (
        '<table><independentVar lookup="row">si/next_height</independentVar><independentVar lookup="column">si/next_t</independentVar>'
        f"<tableData>\n{head}\n{rows}\n</tableData></table>"
    )


def _air(names: Names, world: World, wind: WindRecord) -> Iterator[str]:
    """The recorded wind where the kite is, and what the world adds. JSBSim's wind model stands before the flight control in a frame: what
    is set here counts in the next one, and is computed for there."""
    names = names.also({n: f"si/{n}" for n in ("recorded_speed", "recorded_direction", "wind_speed", "wind_direction")})
    yield names.component("si/next_height", "height - v_d * step")
    yield names.component("si/next_t", "t + step")
    yield computed("si/recorded_speed", _table(wind, wind.speed))
    yield computed("si/recorded_direction", _table(wind, wind.direction))
    yield names.component("si/wind_speed", f"recorded_speed * ({world.air.speed_factor})")
    yield names.component("si/wind_direction", f"recorded_direction + ({world.air.turn})")
    for axis, part, added in (("north", "cos", world.air.north), ("east", "sin", world.air.east)):
        formula = f"metre * (-wind_speed * {part}(wind_direction) + ({added}))"
        yield names.component(f"si/wind_{axis}", formula, f"atmosphere/wind-{axis}-fps")
    yield names.component("si/wind_down", f"metre * ({world.air.down})", "atmosphere/wind-down-fps")


def _winch(names: Names, world: World, scene: Scene) -> Iterator[str]:
    """The line's length: what the winch says, as `ReelOut.at` has it, and what the world adds."""
    reel = scene.reel_out
    names = names.also(numbers={"l_0": reel.length, "speed": reel.speed, "swing": reel.swing, "rate": 2 * math.pi / reel.period})
    yield names.component("si/winch_length", "l_0 + speed * t + swing / rate * (1 - cos(rate * t))")
    yield names.component("si/winch_speed", "speed + swing * sin(rate * t)")
    yield names.component("si/winch_acceleration", "swing * rate * cos(rate * t)")
    yield names.component("si/length", f"winch_length + ({world.line.length})")
    yield names.component("si/reel", f"winch_speed + ({world.line.length_rate})")
    yield names.component("si/reel_acceleration", f"winch_acceleration + ({world.line.length_acceleration})")


def _actuators(names: Names, world: World) -> Iterator[str]:
    """setpoint/SURFACE -> actuator/SURFACE, by JSBSim's own actuator."""
    for surface in SURFACES:
        own = world.actuators.get(surface, Actuator())
        numbers = {name: names.number(formula) for name, formula in own.model_dump(exclude_none=True).items()}
        if "lag" in numbers:
            numbers["lag"] = 1 / numbers["lag"]  # JSBSim's lag is a rate
        delay = delayed(numbers.pop("delay")) if "delay" in numbers else ""
        inside = "".join(f"<{name}>{value!r}</{name}>" for name, value in numbers.items())
        yield f'<actuator name="actuator/{surface}"><input>setpoint/{surface}</input>{inside}{delay}</actuator>'


def _deflections(names: Names, world: World) -> Iterator[str]:
    """actuator/SURFACE -> surface/SURFACE, what acts on the air; here a surface's name is its actuator's position."""
    names = names.also({s: f"actuator/{s}" for s in SURFACES})
    for surface in SURFACES:
        yield names.component(f"surface/{surface}", world.deflections.get(surface, surface))


def _signal(names: Names, name: str, signal: Signal) -> str:
    """A signal with a memory: JSBSim's filters and integrators, or a function that reads what it was in the frame before."""
    here, driven = f"own/{name}", f"own/{name}_of"
    drive, tau = names.component(driven, signal.of), names.number(signal.tau)
    match signal.law:
        case "formula":
            return names.component(here, signal.of)
        case "lag":
            return f'{drive}<lag_filter name="{here}"><input>{driven}</input><c1>{1 / tau!r}</c1></lag_filter>'
        case "washout":
            return f'{drive}<washout_filter name="{here}"><input>{driven}</input><c1>{1 / tau!r}</c1></washout_filter>'
        case "integral":
            return f'{drive}<integrator name="{here}"><input>{driven}</input><c1>1.0</c1></integrator>'
        case "second_order":
            omega, damping = 2 * math.pi * names.number(signal.frequency), names.number(signal.damping)
            gains = (0.0, 0.0, omega**2, 1.0, 2 * damping * omega, omega**2)
            inside = "".join(f"<c{i}>{value!r}</c{i}>" for i, value in enumerate(gains, 1))
            return f'{drive}<second_order_filter name="{here}"><input>{driven}</input>{inside}</second_order_filter>'
        case "relay":
            names = names.also({"_driven": driven, "_before": here})
            on = f"where(_driven > ({signal.on_above}), 1, where(_driven < ({signal.off_below}), 0, _before))"
            return drive + names.component(here, on)


def _aerodynamics(kite: KiteDeclaration, names: Names, world: World) -> Iterator[str]:
    """The kite file's table, one function a term, and the coefficients that the world adds, in wind axes as the table is."""
    if kite.aerodynamics.frame != "wind":
        raise ValueError("the aerodynamic table of a foreign kite is in wind axes")
    unit = 180 / math.pi if kite.aerodynamics.angles == "deg" else 1.0
    signs = {s: kite.surfaces[s].sign if s in kite.surfaces else 1 for s in SURFACES}
    variables = {
        "alpha": "unit * alpha", "beta": "unit * beta",
        "p_hat": "p_air * b / (2 * V_a)", "q_hat": "q * c / (2 * V_a)", "r_hat": "r * b / (2 * V_a)",
        **{s: f"{signs[s]} * unit * {s}" for s in SURFACES},
    }  # fmt: skip
    names = names.also({**_RAW, "V_a": "now/V_a", "qS": "now/qS", **{f"x_{name}": f"table/{name}" for name in variables}}, {"unit": unit})
    for name, formula in _AIR.items():
        yield names.function(f"now/{name}", formula)
    for name, formula in variables.items():
        yield names.function(f"table/{name}", formula)
    for coefficient, (axis, arm) in _AXES.items():
        scale = f"pressure_area * metre * {arm}" if arm else "pressure_area"
        yield f'<axis name="{axis}">'
        for i, (monomial, parameter) in enumerate(kite.aerodynamics.terms.get(coefficient, {}).items()):
            factors = [f"abs(x_{n})" if absolute else f"x_{n}" for n, absolute, power in parse_monomial(monomial) for _ in range(power)]
            formula = " * ".join([scale, f"({kite.parameters[parameter].value!r})", *factors])
            yield names.function(f"aero/coefficient/{coefficient}-{i}", formula)
        if coefficient in world.coefficients:
            yield names.function(f"aero/coefficient/{coefficient}-more", f"{scale} * ({world.coefficients[coefficient]})")
        yield "</axis>"
