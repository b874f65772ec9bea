"""A model as parameters of awebox (github.com/awebox/awebox): a Python file with `data_dict()` and `set_options(options)`.

The layout is that of awebox's own awebox/opts/kite_data/ampyx_data.py: a coefficient is a sum over inputs x in (1, alpha, beta, p, q, r,
deltaa, deltae, deltar) of x (c0 + c1 alpha + c2 alpha^2 + ...), angles in rad, rates as p b/2V, q c/2V, r b/2V (stability_derivatives.py
@5956590). What does not fit stands in `NOT_CARRIED`, with its value.
"""

import math
from collections.abc import Iterator, Mapping

from awescli.export.model import ExportedModel
from awescli.notation.errors import BadInput
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.aerodynamics import COEFFICIENTS, parse_monomial

_INPUTS = {
    "alpha": "alpha", "beta": "beta", "p_hat": "p", "q_hat": "q", "r_hat": "r",
    "aileron": "deltaa", "elevator": "deltae", "rudder": "deltar",
}  # fmt: skip
_ANGLES = ("alpha", "beta", "aileron", "elevator", "rudder", "flaps")
_WIND_FRAME = {"CD": "CD", "CY": "CS", "CL": "CL", "Cl": "Cl", "Cm": "Cm", "Cn": "Cn"}
_BODY_FRAME = {name: name for name in COEFFICIENTS["body"]}
_WIND = {"power": "power", "log": "log_wind", "uniform": "uniform", "table": "uniform"}

Derivatives = dict[str, dict[str, list[float]]]


def awebox_files(model: ExportedModel) -> dict[str, str]:
    """`NAME_awebox.py`. Raises BadInput for a kite without a line: awebox knows none."""
    if model.kite.tether is None:
        raise BadInput("awebox has no kites that fly free, and this one has no line", "--to awebox", "Export to c, fmu, casadi or jsbsim.")
    return {f"{model.identifier}_awebox.py": _text(model)}


def derivatives(declaration: KiteDeclaration, values: Mapping[str, float], flaps: float) -> tuple[Derivatives, dict[str, float]]:
    """(coefficient -> input -> [c0, c1, ...] per power of alpha, what awebox has no counterpart for).

    flaps: [rad, in the log's sign] where they are held: awebox has none, so that their terms become part of the others. In the frame
    `wind` awebox takes p and r about its body axes, x aft and z up: their signs change; in `control` they are ours.
    """
    table = declaration.aerodynamics
    names = _WIND_FRAME if table.frame == "wind" else _BODY_FRAME
    turned = ("p_hat", "r_hat") if table.frame == "wind" else ()
    held = flaps * (declaration.surfaces["flaps"].sign if "flaps" in declaration.surfaces else 1)
    found: Derivatives = {name: {} for name in names.values()}
    left: dict[str, float] = {}
    for coefficient, terms in table.terms.items():
        for monomial, parameter in terms.items():
            factors = [(v, absolute) for v, absolute, power in parse_monomial(str(monomial)) for _ in range(power)]
            value = values[parameter]
            if table.angles == "deg":
                value *= math.prod(180 / math.pi for v, _ in factors if v in _ANGLES)
            value *= math.prod(-1.0 for v, _ in factors if v in turned)
            if held:
                value *= math.prod(abs(held) if absolute else held for v, absolute in factors if v == "flaps")
                factors = [f for f in factors if f[0] != "flaps"]
            powers = sum(v == "alpha" and not absolute for v, absolute in factors)
            others = [(v, absolute) for v, absolute in factors if v != "alpha" or absolute]
            if len(others) > 1 or any(absolute or v not in _INPUTS for v, absolute in others):
                left[f"{coefficient}: {monomial}"] = value
                continue
            kind = _INPUTS[others[0][0]] if others else "alpha" if powers else "0"
            stack = found[names[coefficient]].setdefault(kind, [])
            at = powers - (kind == "alpha")
            stack.extend([0.0] * (at + 1 - len(stack)))
            stack[at] += value
    return found, left


def _text(model: ExportedModel) -> str:
    declaration = model.declaration
    values = model.values
    found, left = derivatives(declaration, values, model.start.set_points.get("flaps", 0.0))
    says = [f"{key}: {value}" for key, value in model.provenance.items() if not isinstance(value, Mapping)]
    lines = [
        f'"""{_plain(declaration.name)}, {model.label} model, as parameters of awebox (github.com/awebox/awebox).', "",
        "    import awebox, NAME_awebox as kite".replace("NAME", model.identifier),
        "    options = awebox.Options()", "    kite.set_options(options)", "",
        "Made by awes " + str(model.provenance.get("awes", "")) + ".", *map(_plain, says), '"""', "", "import numpy as np", "", "",
        "NOT_CARRIED = {", *_not_carried(model, left), "}",
        '"""What awebox has no counterpart for: aerodynamic terms per rad, then parameters of effects and of the line, in SI."""', "", "",
        *_data_dict(model), "", "", *_geometry(model, values), "", "", *_aero(model, found), "", "", *_options(model, values), "",
    ]  # fmt: skip
    return "\n".join(lines)


def _plain(text: str) -> str:
    """Text inside a Python string."""
    return str(text).replace("\\", "/").replace('"""', "'''")


def _not_carried(model: ExportedModel, left: Mapping[str, float]) -> Iterator[str]:
    for term, value in left.items():
        yield f"    {term!r}: {value!r},"
    own = {p.name for e in model.kite.effects for p in e.rows()} - {"tether_weight.mu"}
    for s in model.parameters:
        if s.name in own or s.name in ("k_v", "c_v", "dl"):
            yield f"    {s.name!r}: {s.value!r},  # [{s.unit}] {_plain(s.source)}"
    if model.correction is not None:
        yield "    'network': 'see NAME.json',  # rates of change that a network adds"
    if model.controller is not None:
        yield "    'controller': 'see NAME.json',  # awebox finds its own controls"


def _data_dict(model: ExportedModel) -> Iterator[str]:
    yield "def data_dict():"
    yield f"    return {{'name': {model.declaration.name!r}, 'geometry': geometry(), 'stab_derivs': aero()[0], 'aero_validity': aero()[1]}}"


def _geometry(model: ExportedModel, values: Mapping[str, float]) -> Iterator[str]:
    v, surfaces = values, model.declaration.surfaces
    inertia = [[v["Jx"], 0.0, -v["Jxz"]], [0.0, v["Jy"], 0.0], [-v["Jxz"], 0.0, v["Jz"]]]
    most = [max(abs(s.lower), abs(s.upper)) if (s := surfaces.get(n)) else 0.0 for n in ("aileron", "elevator", "rudder")]
    rates = [values.get(f"actuator_lag:{n}.rate", 2.0) for n in ("aileron", "elevator", "rudder")]
    yield "def geometry():"
    yield "    geometry = {}"
    for name, value, says in (
        ("b_ref", v["b"], "[m]"), ("s_ref", v["S"], "[m2]"), ("c_ref", v["c"], "[m]"), ("m_k", v["m"], "[kg]"),
        ("ar", v["b"] ** 2 / v["S"], "[-]"), ("length", v["b"], "[m] for drawings only"), ("height", v["b"] / 5, "[m] for drawings only"),
        ("c_root", v["c"], "[m] not declared: the mean chord"), ("c_tip", v["c"], "[m] not declared: the mean chord"),
    ):  # fmt: skip
        yield f"    geometry['{name}'] = {value!r}  # {says}"
    yield f"    geometry['j'] = np.array({inertia!r})  # [kg m2] -Jxz off the diagonal, in FRD and in (aft, right, up)"
    yield f"    geometry['delta_max'] = np.array({most!r})  # [rad] aileron, elevator, rudder; from `surfaces` of the kite file"
    yield f"    geometry['ddelta_max'] = np.array({rates!r})  # [rad/s] of actuator_lag where it is declared, else 2 rad/s (MegAWES)"
    yield "    geometry['fuselage'], geometry['wing'], geometry['tail'], geometry['wing_profile'] = True, True, True, None"
    arm = [-v["rtx"], v["rty"], -v["rtz"]]
    yield f"    geometry['r_tether'] = np.reshape({arm!r}, (3, 1))  # [m] attachment, awebox's axes (aft, right, up)"
    yield "    return geometry"


def _aero(model: ExportedModel, found: Derivatives) -> Iterator[str]:
    frame = "wind" if model.declaration.aerodynamics.frame == "wind" else "control"
    yield "def aero():"
    yield "    # signs of alpha, beta and of the surfaces: those of the kite file's table, as in awebox's own ampyx_data.py"
    if flaps := model.start.set_points.get("flaps", 0.0):
        yield f"    # awebox has no flaps: they are held at {flaps!r} rad, as at the start"
    if frame == "wind":
        yield "    # p and r: awebox takes them about its body axes here, so their derivatives have the other sign than in the kite file"
    yield f"    stab_derivs = {{'frame': {{'force': '{frame}', 'moment': 'control'}}}}"
    for coefficient, inputs in found.items():
        yield f"    stab_derivs['{coefficient}'] = {{}}"
        for name, stack in (inputs or {"0": [0.0]}).items():
            yield f"    stab_derivs['{coefficient}']['{name}'] = {stack!r}"
    yield "    aero_validity = {}"
    for name, fallback in (("alpha", (-10.0, 15.0)), ("beta", (-20.0, 20.0))):
        known = name in model.ranges
        low, high = (math.degrees(a) for a in model.ranges[name]) if known else fallback
        says = "as flown" if known else "not known without a flight"
        yield f"    aero_validity['{name}_max_deg'], aero_validity['{name}_min_deg'] = {round(high, 2)!r}, {round(low, 2)!r}  # {says}"
    low, high = model.ranges.get("V_a", (10.0, 60.0))
    says = "as flown" if "V_a" in model.ranges else "not known without a flight"
    yield f"    aero_validity['airspeed_max'], aero_validity['airspeed_min'] = {round(high, 2)!r}, {round(low, 2)!r}  # [m/s] {says}"
    yield "    return stab_derivs, aero_validity"


def _options(model: ExportedModel, values: Mapping[str, float]) -> Iterator[str]:
    v, wind, start = values, model.declaration.wind, model.start.inputs
    drag = v["CtD"] + v.get("tether_drag.dC", 0.0)
    yield "def set_options(options):"
    yield "    options['user_options.system_model.kite_dof'] = 6"
    yield "    options['user_options.kite_standard'] = data_dict()"
    yield f"    options['user_options.trajectory.fixed_params'] = {{'diam_t': {v['d_t']!r}}}  # [m]"
    yield f"    options['params.tether.cd'] = {drag!r}"
    if v.get("tether_weight.mu", 0.0) > 0:
        density = v["tether_weight.mu"] / (math.pi / 4 * v["d_t"] ** 2)
        yield f"    options['params.tether.rho'] = {density!r}  # [kg/m3] of tether_weight.mu"
    else:
        yield "    # options['params.tether.rho']: this model's line has no weight; awebox's has, and keeps its default"
    if wind.law == "table":
        yield "    # the wind of this model is a table over height; awebox gets its lowest station, uniform"
    yield f"    options['user_options.wind.model'] = '{_WIND[wind.law]}'"
    if "wind_speed_0" in start:
        yield f"    options['user_options.wind.u_ref'] = {start['wind_speed_0']!r}  # [m/s] at the start of the flight"
    yield f"    options['params.wind.z_ref'] = {model.kite.heights[0] if wind.law == 'table' else wind.reference_height!r}  # [m]"
    if wind.law == "power":
        yield f"    options['params.wind.power_wind.exp_ref'] = {v.get('wind_shear.a', wind.exponent)!r}"
    if wind.law == "log":
        yield f"    options['params.wind.log_wind.z0_air'] = {wind.roughness!r}  # [m]"
    yield "    return options"
