"""The line of a foreign kite: an external reaction of JSBSim, computed in every frame from that frame's other loads.

The same as in our model (awescli/physics/effects/tether.py, law `exact`): the tension is what keeps the distance at the line's length,

    T = max(0, p_hat . R^T (f_a + f_g) + m ((|pdot|^2 - (p_hat . pdot)^2) / |p| - l_t_ddot)
               + k_v (|p| - (l_t + dl)) + c_v (p_hat . pdot - l_t_dot)),

with k_v, c_v of the kite file; a quarter of the line's drag, F_tD = rho d_t C_tD l_t V_a^2 / 8, tilts the force about body y by
arcsin(-F_tD / T), and it acts at r_t. What differs: these are functions that JSBSim evaluates, with its own attitude, air data and
aerodynamic forces; the line holds loads that the world adds too; a heavy line also has inertia, mu l_t / 3 across itself, by the
acceleration of the frame before.

The log is KM1's: its load is T at the kite (`LoadFiltered`, of whose filter nothing is published: none is flown), its length is that of
the drum's revolutions, and it has no flow angles and no sag, which the kite has neither.
"""

from collections.abc import Iterator

from foreign_kinds import World
from foreign_names import Names, place

from awescli.physics.declaration import KiteDeclaration

STEEPEST = 0.95
"""sin of the tilt is kept below this on a line that goes slack, as in our model."""


def line(kite: KiteDeclaration, names: Names, world: World) -> Iterator[str]:
    """Functions and forces inside external_reactions: loads that the world adds, weight and inertia of the line, the line itself, and the
    kinematic acceleration true/a_x ... that all forces make together."""
    if (kite.tether.law, kite.tether.tension) != ("exact", "constraint"):
        raise ValueError("the line of a foreign kite is the exact constraint")
    formulas = _formulas(world)
    names = names.also(
        {**{f"aero_{axis}": f"forces/fb{axis}-aero-lbs" for axis in "xyz"}, **{name: f"line/{name}" for name in formulas}},
        {"mass": names.numbers["m"] + names.number(world.mass), "mu": names.number(world.line.weight)},
    )
    for name, formula in formulas.items():
        yield names.function(f"line/{name}", formula)
    for axis in "xyz":
        yield names.function(f"true/a_{axis}", f"(others_{axis} + line_{axis}) / mass")
    attached = [kite.parameters[name].value for name in ("rtx", "rty", "rtz")]
    for axis in "xyz":
        yield _reaction("force", f"line-{axis}", axis, names.xml(f"line_{axis} / lbf"), attached)
        yield _reaction("force", f"more-{axis}", axis, names.xml(f"(more_f_{axis} + heavy_{axis}) / lbf"), (0, 0, 0))
        yield _reaction("moment", f"turn-{axis}", axis, names.xml(f"more_m_{axis} * metre / lbf"), None)


def _formulas(world: World) -> dict[str, str]:
    """Name -> formula, in the order in which they are computed; forces in body axes [N]."""
    axes = tuple(enumerate("xyz", start=1))
    inertia = {axis: f"mu * length / 3 * (last_a_{axis} - last_along * hat_{axis})" for axis in "xyz"}
    return {
        **{f"hat_{axis}": f"(R1{i} * p_n + R2{i} * p_e + R3{i} * p_d) / distance" for i, axis in axes},
        "range_rate": "(p_n * v_n + p_e * v_e + p_d * v_d) / distance",
        **{f"more_{channel}": world.loads.get(channel, "0") for channel in ("f_x", "f_y", "f_z", "m_x", "m_y", "m_z")},
        "last_along": "last_a_x * hat_x + last_a_y * hat_y + last_a_z * hat_z",
        **{f"heavy_{axis}": f"mu * length * g / 2 * R3{i} - {inertia[axis]}" for i, axis in axes},
        **{f"others_{axis}": f"lbf * aero_{axis} + mass * g * R3{i} + more_f_{axis} + heavy_{axis}" for i, axis in axes},
        "inertial": "mass * ((v_n * v_n + v_e * v_e + v_d * v_d - range_rate * range_rate) / distance - reel_acceleration)",
        "pull": "others_x * hat_x + others_y * hat_y + others_z * hat_z + inertial",
        "tension": "max(0, pull + k_v * (distance - (length + dl)) + c_v * (range_rate - reel))",
        "drag": f"rho * d_t * (CtD + ({world.line.drag})) * length * V_a * V_a / 8",
        "share": f"drag / where(tension * {STEEPEST} - drag > 0, tension, drag / {STEEPEST} + 0.000000001)",
        "level": "sqrt(1 - share * share)",
        "line_x": "share * tension * hat_z - level * tension * hat_x",
        "line_y": f"-tension * hat_y - ({world.line.lateral}) * drag * sin(beta)",
        "line_z": "-level * tension * hat_z - share * tension * hat_x",
    }  # fmt: skip


def _reaction(kind: str, name: str, axis: str, element: str, where) -> str:
    """One force or moment along a body axis; where: its place [m, FRD]."""
    direction = "".join(f"<{a}>{float(a == axis)}</{a}>" for a in "xyz")
    location = f'<location unit="IN">{place(where)}</location>' if where is not None else ""
    return f'<{kind} name="{name}" frame="BODY"><function>{element}</function>{location}<direction>{direction}</direction></{kind}>'
