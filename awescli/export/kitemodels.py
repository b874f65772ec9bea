"""A model as settings of KiteModels.jl (github.com/ufechner7/KiteModels.jl): a settings.yaml, in its keys and units.

KiteModels.jl knows a kite as a point or four points with lift and drag over the angle of attack; so mass, area, these two curves, the
tether, the wind and the start are given, and every other key is left to the user, by name. Keys as in KiteUtils.jl's src/settings.jl
@020212e. The curves are the model's own coefficients, without sideslip and rates, surfaces as at the start.
"""

import math
from collections.abc import Iterator, Mapping

from awescli.engine.record import record
from awescli.export.model import ExportedModel
from awescli.export.programs import values_of
from awescli.notation.errors import BadInput
from awescli.notation.quantities import STATES, SURFACES
from awescli.physics.kite import Kite

AIRSPEED = 25.0
"""[m/s] at which the coefficients are read: they depend on it only where an effect makes them."""
ALONE = (-10.0, 15.0)
"""[deg] angles of attack of the curves where no flight gives others."""
_MISSING = {
    "system": "log_file, time_lapse, sim_time, segments, sample_freq, zoom, kite_scale, fixed_font: of the simulation, not of the kite",
    "initial": "depower: a rigid wing has none",
    "solver": "all keys: of the DAE solver",
    "steering": "all keys: a rigid wing is steered by its surfaces (aileron, elevator, rudder, flaps)",
    "depower": "all keys: a rigid wing has none",
    "kite": "rel_side_area, height: the side force of this model is its coefficient CY; model, physical_model, version: yours",
    "kps4": "all keys: a rigid wing is no four points",
    "bridle": "all keys: this kite hangs on one attachment",
    "kcu": "all keys: there is no control unit below the kite",
    "winch": "all keys: length and speed of the line are inputs of this model",
    "environment": "temp_ref, height_gnd, and all keys of turbulence",
}
"""Section -> keys without a counterpart, and why."""
_CARRIED = ("m", "g", "S", "b", "c", "d_t", "CtD", "tether_weight.mu", "tether_drag.dC", "tether_elasticity.EA", "wind_shear.a")
"""Parameters that a key holds, or that need none."""
_PROFILES = {"power": 1, "log": 2}
"""WindLaw -> profile_law: 1 = EXP, 2 = LOG."""


def kitemodels_files(model: ExportedModel) -> dict[str, str]:
    """`settings_NAME.yaml`. Raises BadInput for a kite without a line."""
    if model.kite.tether is None:
        what = "KiteModels.jl has no kites that fly free, and this one has no line"
        raise BadInput(what, "--to kitemodels", "Export to c, fmu, casadi or jsbsim.")
    return {f"settings_{model.identifier}.yaml": "\n".join(_lines(model)) + "\n"}


def curves(model: ExportedModel, angles: list[float]) -> dict[str, list[float]]:
    """CL, CD at angles of attack [rad], in still air, wings level, without rates, surfaces as at the start."""
    physics = model.physics
    parameters = model.programs.parameters
    tape, outputs = record(
        lambda x, u, c: _coefficients(physics, x, dict(zip(parameters, c, strict=True)), u), x=len(physics.x_names), u=1, c=len(parameters)
    )
    found: dict[str, list[float]] = {"CL": [], "CD": []}
    for alpha in angles:
        state = dict.fromkeys(STATES, 0.0) | {"p_n": 100.0, "p_d": -100.0, "u": AIRSPEED * math.cos(alpha), "w": AIRSPEED * math.sin(alpha)}
        held = [model.start.set_points.get(name, 0.0) for name in SURFACES]
        x = [*state.values(), *[0.0] * (len(physics.state_names) - 12), *held]
        CL, CD = values_of(tape, outputs, x=x, u=[1.225], c=[*model.values.values()])
        found["CL"].append(CL)
        found["CD"].append(CD)
    return found


def _coefficients(physics: Kite, x: list, values: Mapping, u: list) -> list:
    inputs = [u[0] if name == "density" else 150.0 if name == "tether_length" else 0.0 for name in physics.input_names]
    c = [values.get(name, 0.0) for name in physics.parameter_names]
    # lags have settled
    x = [*x[:12], *physics.initial(x, inputs, c), *x[len(physics.state_names) :]]
    at = physics.instant(x, inputs, c)
    return [at.coefficients.CL, at.coefficients.CD]


def _lines(model: ExportedModel) -> Iterator[str]:
    v = model.values
    yield f"# {model.declaration.name}, {model.label} model, as settings of KiteModels.jl. Made by awes {model.provenance.get('awes', '')}."
    for key, value in model.provenance.items():
        if not isinstance(value, Mapping):
            yield f"# {key}: {value}"
    yield "# Put these keys over those of your settings.yaml (copy_settings() writes one). What has no counterpart is named."
    for section, own in _sections(model, v).items():
        yield ""
        yield f"{section}:" if own else f"# {section}:"
        for key, (value, comment) in own.items():
            yield f"    {key}: {value}  # {comment}"
        if section in _MISSING:
            yield f"    # no counterpart: {_MISSING[section]}"
    table = {p for terms in model.declaration.aerodynamics.terms.values() for p in terms.values()}
    yield ""
    yield "# Parameters of this model that no key of KiteModels.jl holds (lift and drag of alpha alone are in the curves):"
    for s in model.parameters:
        if s.name not in _CARRIED and s.name not in table:
            yield f"#   {s.name}: {s.value!r} [{s.unit}]"
    for coefficient in sorted(set(model.declaration.aerodynamics.terms) - {"CL", "CD", "CX", "CZ"}):
        yield f"#   {coefficient}: {', '.join(model.declaration.aerodynamics.terms[coefficient])}"


def _sections(model: ExportedModel, v: Mapping[str, float]) -> dict[str, dict[str, tuple[str, str]]]:
    """Section -> key -> (value, what it is)."""
    start = model.start
    n, e, d = (start.states[name] for name in ("p_n", "p_e", "p_d"))
    low, high = tuple(math.degrees(a) for a in model.ranges["alpha"]) if "alpha" in model.ranges else ALONE
    count = 12
    angles = [low + (high - low) * i / (count - 1) for i in range(count)]
    C = curves(model, [math.radians(a) for a in angles])
    as_list = lambda values: f"[{', '.join(f'{x:.5g}' for x in values)}]"  # noqa: E731
    flown = "as flown; held beyond" if "alpha" in model.ranges else "held beyond"
    return {
        "system": {}, "initial": {
            "l_tether": (f"{start.inputs.get('tether_length', math.hypot(n, e, d)):.6g}", "[m]"),
            "elevation": (f"{math.degrees(math.atan2(-d, math.hypot(n, e))):.6g}", "[deg]"),
            "v_reel_out": (f"{start.inputs.get('reel_out_speed', 0.0):.6g}", "[m/s]"),
        },
        "solver": {}, "steering": {}, "depower": {},
        "kite": {
            "mass": (f"{v['m']:.6g}", "[kg]"), "area": (f"{v['S']:.6g}", "[m2]"),
            "alpha_cl": (as_list(angles), f"[deg] {flown}"), "cl_list": (as_list(C["CL"]), "[-]"),
            "alpha_cd": (as_list(angles), f"[deg] {flown}"), "cd_list": (as_list(C["CD"]), "[-]"),
        },
        "kps4": {}, "bridle": {}, "kcu": {}, "tether": _tether(v), "winch": {}, "environment": _environment(model, v),
    }  # fmt: skip


def _tether(v: Mapping[str, float]) -> dict[str, tuple[str, str]]:
    section = math.pi / 4 * v["d_t"] ** 2
    own = {"d_tether": (f"{1e3 * v['d_t']:.6g}", "[mm]"), "cd_tether": (f"{v['CtD'] + v.get('tether_drag.dC', 0.0):.6g}", "[-]")}
    if v.get("tether_weight.mu", 0.0) > 0:
        own["rho_tether"] = (f"{v['tether_weight.mu'] / section:.6g}", "[kg/m3] of tether_weight.mu")
    if v.get("tether_elasticity.EA", 0.0) > 0:
        own["c_spring"] = (f"{v['tether_elasticity.EA']:.6g}", "[N] EA")
        own["e_tether"] = (f"{v['tether_elasticity.EA'] / section:.6g}", "[Pa] EA over the line's section")
    return own


def _environment(model: ExportedModel, v: Mapping[str, float]) -> dict[str, tuple[str, str]]:
    start, wind = model.start.inputs, model.declaration.wind
    own = {"rho_0": (f"{start.get('density', 1.225):.6g}", "[kg/m3] at the kite, at the start")}
    if "wind_speed_0" in start:
        upwind = _half_turn(math.degrees(start["wind_direction_0"]))
        own["v_wind"] = (f"{start['wind_speed_0']:.6g}", "[m/s] at h_ref, at the start")
        own["h_ref"] = (f"{wind.reference_height if wind.law in _PROFILES else model.kite.heights[0]:.6g}", "[m]")
        own["upwind_dir"] = (f"{upwind:.6g}", "[deg] where it comes from, from north, clockwise")
    if wind.law in _PROFILES:
        own["profile_law"] = (str(_PROFILES[wind.law]), f"the kite file's law is `{wind.law}`")
        own["alpha"] = (f"{v.get('wind_shear.a', wind.exponent):.6g}", "[-]")
        own["z0"] = (f"{wind.roughness:.6g}", "[m]")
    return own


def _half_turn(degrees: float) -> float:
    """The same angle within +-180."""
    return (degrees + 180.0) % 360.0 - 180.0
