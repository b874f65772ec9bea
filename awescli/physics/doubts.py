"""What a kite file declares that may be true and mostly is a slip: of a unit, a sign, a digit. `awes check` says so, nothing stops."""

import math
from collections.abc import Iterator

from awescli.physics.admissible import INERTIA, not_rigid
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.aerodynamics import parse_monomial
from awescli.physics.kite import REQUIRED, make_effect

WING = 4.0
"""Factor by which S may differ from b c: tapered wings, biplanes, other reference lengths."""
LOADING = (0.05, 1500.0)
"""kg/m2, m / S: from a paper glider to beyond any airliner."""
GYRATION = (0.01, 0.6)
"""Radius of gyration sqrt(J / m) as a share of the span: wings have 0.1 to 0.3."""
SIGNS = (
    ("Cl", "p_hat", -1, "rolling is driven on instead of damped"), ("Cm", "q_hat", -1, "pitching is driven on instead of damped"),
    ("Cn", "r_hat", -1, "yawing is driven on instead of damped"), ("CL", "alpha", 1, "lift falls with the angle of attack"),
    ("CZ", "alpha", -1, "lift falls with the angle of attack"), ("CD", "1", 1, "drag pushes"), ("CX", "1", -1, "drag pushes"),
    ("CY", "beta", -1, "the side force pulls into the sideslip"), ("Cm", "alpha", -1, "it is unstable in pitch"),
    ("Cn", "beta", 1, "it is unstable in yaw"),
)  # fmt: skip
"""Coefficient, monomial, sign that it has on nearly every aircraft (Beard & McLain, ch. 4), and what the other one means."""


def doubts(declaration: KiteDeclaration) -> list[str]:
    """One sentence for each."""
    value = {name: row.value for name, row in declaration.parameters.items()}
    return [*_body(value), *_sizes(value), *_signs(declaration, value), *_unused(declaration)]


def _body(value: dict[str, float]) -> Iterator[str]:
    if all(name in value for name in INERTIA):
        for why in not_rigid({name: (value[name], value[name]) for name in INERTIA}):
            yield f"{why}, as declared; the bounds allow what a rigid body has"


def _sizes(value: dict[str, float]) -> Iterator[str]:
    """Area against span and chord, mass against area, inertia against mass and span: lengths and masses of one kite."""
    m, S, b, c = (value.get(name) for name in ("m", "S", "b", "c"))
    if S and b and c and abs(math.log(S / (b * c))) > math.log(WING):
        yield f"S = {S:g} m2 is {S / (b * c):.3g} times b c: are all three in metres?"
    if m and S and not LOADING[0] <= m / S <= LOADING[1]:
        yield f"m / S = {m / S:.3g} kg/m2: no wing is loaded so; is m in kg, S in m2?"
    for name in INERTIA[:3]:
        if m and b and name in value and value[name] > 0:
            share = math.sqrt(value[name] / m) / b
            if not GYRATION[0] <= share <= GYRATION[1]:
                yield f"{name} = {value[name]:g} kg m2 is that of a mass {share:.3g} spans from the axis: is it in kg m2?"


def _signs(declaration: KiteDeclaration, value: dict[str, float]) -> Iterator[str]:
    for coefficient, monomial, sign, means in SIGNS:
        terms = declaration.aerodynamics.terms.get(coefficient, {})
        for text, name in terms.items():
            if _factors(text) == monomial and sign * value.get(name, 0.0) < 0:
                yield f"{name} = {value[name]:g} ({coefficient} with {monomial}): {means}"


def _factors(text: str) -> str:
    """A monomial of one plain factor as its name, `1` for none."""
    factors = parse_monomial(str(text))
    if not factors:
        return "1"
    (name, absolute, power) = factors[0]
    return name if len(factors) == 1 and not absolute and power == 1 else ""


def _unused(declaration: KiteDeclaration) -> Iterator[str]:
    """Parameters that an estimator may move and that nothing depends on, as far as names tell."""
    used = {name for terms in declaration.aerodynamics.terms.values() for name in terms.values()} | set(REQUIRED)
    used |= {name for key in declaration.effects for name in make_effect(key, declaration).requires}
    named = {name.partition(".")[0] for name in declaration.parameters} & set(declaration.effects)
    free = [n for n, row in declaration.parameters.items() if row.free and n not in used and n.partition(".")[0] not in named]
    if free:
        yield f"{', '.join(free[:5])}: free, and no term or effect uses {'them' if len(free) > 1 else 'it'}"
