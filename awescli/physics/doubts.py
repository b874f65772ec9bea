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
    ("CD", "alpha^2", 1, "the polar opens towards less drag"), ("CD", "beta^2", 1, "drag falls with sideslip"),
    ("CY", "beta", -1, "the side force pulls into the sideslip"), ("Cm", "alpha", -1, "it is unstable in pitch"),
    ("Cn", "beta", 1, "it is unstable in yaw"), ("Cl", "beta", -1, "it rolls into the sideslip instead of out of it"),
    ("Cl", "r_hat", 1, "the wing half that yawing makes faster lifts less"),
    ("CL", "q_hat", 1, "a tail behind the centre of mass lifts more while pitching up, this one less"),
    ("CZ", "q_hat", -1, "a tail behind the centre of mass lifts more while pitching up, this one less"),
    ("CY", "r_hat", 1, "a fin behind the centre of mass pushes to the right in a right turn, this one to the left"),
)  # fmt: skip
"""Coefficient, monomial, sign that it has on nearly every aircraft (Beard & McLain, ch. 4; Etkin & Reid, ch. 5), what the other one means.

Without a sign of their own are constants, drag's slopes, CY with p_hat, Cn with p_hat, and all that surfaces do, whose positive sense every
table chooses for itself: of those only PAIRS.
"""
PAIRS = (
    ("CL", "Cm", "elevator", -1, "its force would act ahead of the centre of mass"),
    ("CZ", "Cm", "elevator", 1, "its force would act ahead of the centre of mass"),
    ("CY", "Cn", "rudder", -1, "its force would act ahead of the centre of mass"),
    ("CL", "CD", "flaps", 1, "the deflection that adds lift would take drag away"),
)
"""Two coefficients, the surface, the sign of their product, which is the same whichever deflection counts as positive, and what the other
one means (Etkin & Reid, ch. 2 and 3: a surface's moment is its force times its distance; drag grows with lift)."""


def doubts(declaration: KiteDeclaration) -> list[str]:
    """One sentence for each."""
    value = {name: row.value for name, row in declaration.parameters.items()}
    return [*_body(value), *_sizes(value), *unusual_signs(declaration).values(), *_pairs(declaration, value), *_unused(declaration)]


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


def unusual_signs(declaration: KiteDeclaration) -> dict[str, str]:
    """Parameter whose sign hardly any aircraft has -> what it means, in a sentence."""
    found = {}
    for coefficient, monomial, sign, means in SIGNS:
        terms = declaration.aerodynamics.terms.get(coefficient, {})
        for text, name in terms.items():
            row = declaration.parameters.get(name)
            if row and _factors(text) == monomial and sign * row.value < 0:
                found[name] = f"{name} = {row.value:g} ({coefficient} with {monomial}): {means}"
    return found


def _pairs(declaration: KiteDeclaration, value: dict[str, float]) -> Iterator[str]:
    terms = declaration.aerodynamics.terms
    for first, second, surface, sign, means in PAIRS:
        a, b = (next((n for text, n in terms.get(c, {}).items() if _factors(text) == surface), "") for c in (first, second))
        if sign * value.get(a, 0.0) * value.get(b, 0.0) < 0:
            alike = "one sign" if sign < 0 else "different signs"
            yield f"{a} = {value[a]:g} and {b} = {value[b]:g} ({first} and {second} with {surface}) have {alike}: {means}"


def _factors(text: str) -> str:
    """A monomial of one plain factor as its name and power, `1` for none, nothing for any other."""
    factors = parse_monomial(str(text))
    if not factors:
        return "1"
    (name, absolute, power) = factors[0]
    return "" if len(factors) > 1 or absolute else name if power == 1 else f"{name}^{power}"


def _unused(declaration: KiteDeclaration) -> Iterator[str]:
    """Parameters that an estimator may move and that nothing depends on, as far as names tell."""
    used = {name for terms in declaration.aerodynamics.terms.values() for name in terms.values()} | set(REQUIRED)
    used |= {name for key in declaration.effects for name in make_effect(key, declaration).requires}
    named = {name.partition(".")[0] for name in declaration.parameters} & set(declaration.effects)
    free = [n for n, row in declaration.parameters.items() if row.free and n not in used and n.partition(".")[0] not in named]
    if free:
        yield f"{', '.join(free[:5])}: free, and no term or effect uses {'them' if len(free) > 1 else 'it'}"
