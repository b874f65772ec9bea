"""A kite file to fill in: every key with its unit and meaning, an aerodynamic table that is complete, numbers marked `fill_in`."""

import textwrap
from collections.abc import Sequence

from pydantic import BaseModel

from awescli.notation.quantities import CONTROL_SURFACES
from awescli.physics.declaration import Noise, SurfaceDeclaration, TetherLaw, WindLaw
from awescli.physics.parameter_words import MEANINGS
from awescli.physics.unfilled import FILL_IN

TERMS: dict[str, dict[str, str]] = {
    "CL": {"1": "CL0", "alpha": "CLa", "q_hat": "CLq", "elevator": "CLde", "flaps": "CLdf"},
    "CD": {"1": "CD0", "alpha": "CDa", "alpha^2": "CDa2", "flaps": "CDdf"},
    "CY": {"beta": "CYb", "p_hat": "CYp", "r_hat": "CYr", "rudder": "CYdr"},
    "Cl": {"beta": "Clb", "p_hat": "Clp", "r_hat": "Clr", "aileron": "Clda", "rudder": "Cldr"},
    "Cm": {"1": "Cm0", "alpha": "Cma", "q_hat": "Cmq", "elevator": "Cmde", "flaps": "Cmdf"},
    "Cn": {"beta": "Cnb", "p_hat": "Cnp", "r_hat": "Cnr", "aileron": "Cnda", "rudder": "Cndr"},
}
"""The derivatives of a rigid wing with a tail (Beard & McLain, chapter 4)."""

KNOWN = {
    "g": "value: 9.80665",
    "CtD": "value: 1.1, lower: 0.3, upper: 2.0, free: true, std: 0.2",
    "rty": "value: 0.0",
    "k_v": "value: 1000.0",
    "c_v": "value: 300.0",
    "dl": "value: 0.0, lower: -15.0, upper: 15.0, free: true, std: 3.0",
}
"""Rows that need no knowledge of the kite to start with."""

GROUPS = (
    ("mass, geometry and gravity", ("m", "g", "S", "b", "c"), False),
    ("inertia about the centre of mass, body axes forward, right, down", ("Jx", "Jy", "Jz", "Jxz"), True),
    ("line, and where it holds the kite", ("d_t", "CtD", "rtx", "rty", "rtz", "k_v", "c_v", "dl"), False),
)

WIDTH = 130
"""Columns of a comment."""

HEAD = """\
# A kite file to fill in. `awes check` names every number that is still `{fill}`, with its line and meaning.
# A row: {{value: number, unit: its unit, free: whether `awes identify` may move it (default false), lower, upper: bounds it keeps (default
# none), std: how well you know the value beforehand (default a quarter of the bounds' distance, else 30 % of the value), source: text}}.
# SI and radians throughout. Free parameters may be rough guesses: what the flight shows corrects them.
name: my kite
description: ""
parameters:"""


def kite_template(surfaces: Sequence[str] = CONTROL_SURFACES, on_line: bool = True) -> str:
    """The text of a kite file whose aerodynamic table has a term for each of the `surfaces` that the log drives; on_line: with a tether."""
    terms = {c: {m: p for m, p in row.items() if m not in CONTROL_SURFACES or m in surfaces} for c, row in TERMS.items()}
    lines = HEAD.format(fill=FILL_IN).splitlines()
    for title, names, free in GROUPS if on_line else GROUPS[:2]:
        lines += [f"  # {title}", *(_row(name, free) for name in names)]
    lines.append("  # aerodynamic derivatives, in the order of the table below")
    lines += [_row(name, True) for row in terms.values() for name in row.values()]
    lines += [
        "aerodynamics:",
        "  frame: wind    # wind: CD, CY, CL; body: CX, CY, CZ; moments Cl, Cm, Cn about body axes in both",
        "  angles: rad    # unit in which angles and deflections enter the terms: rad or deg",
        "  # coefficient -> {what it is multiplied with: parameter}; p_hat = p b / 2 V_a, q_hat = q c / 2 V_a, r_hat = r b / 2 V_a;",
        "  # products and powers too: alpha^2, alpha*beta, abs(beta)",
        "  terms:",
        *(f"    {c}: {{{', '.join(f'{chr(34)}{m}{chr(34)}: {p}' for m, p in row.items())}}}" for c, row in terms.items()),
        f"surfaces:{'' if surfaces else ' {}'}",
        f"  # {_said(SurfaceDeclaration)}",
        *(f"  {name}: {{sign: 1, lower: -0.5, upper: 0.5}}" for name in surfaces),
        *([f"# {_said(TetherLaw)}", "tether: {law: exact, tension: constraint}"] if on_line else ["# no tether: a free flight"]),
        f"# {_said(WindLaw)}",
        "wind: {law: table, std: 0.3}",
        "# in order; `awes effects` lists all that there are. What is missing here is what `awes trace-residual` looks for",
        f"effects: [gravity, aerodynamics{', tether' if on_line else ''}]",
        'constraints: ["Jx + Jy >= Jz", "Jx + Jz >= Jy", "Jy + Jz >= Jx"]    # kept by identified values',
        f"# {_said(Noise)}",
        "noise: {position: [0.1, 0.1, 0.15], velocity: 0.05, euler: 0.0035, rates: 0.0052, airspeed: 0.3, flow_angles: 0.0087,",
        "  load_relative: 0.01, acceleration: 0.2}",
    ]
    return "\n".join(lines) + "\n"


def _row(name: str, free: bool) -> str:
    unit, meaning, hint = MEANINGS[name]
    value = KNOWN.get(name, f"value: {FILL_IN}{', free: true' if free else ''}")
    shown = unit if unit.isidentifier() else f'"{unit}"'
    return f"  {name}: {{{value}, unit: {shown}}}    # {meaning}{f'; {hint}' if hint else ''}"


def _said(model: type[BaseModel]) -> str:
    """`sign: what it means; lower: ...` of a block's keys, in lines of a comment."""
    text = "; ".join(f"{n}: {f.description}" for n, f in model.model_fields.items() if f.description)
    return "\n# ".join(textwrap.wrap(text, WIDTH))
