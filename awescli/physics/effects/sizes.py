"""Sizes of the kite that flies, for what generic code must measure by something: its weight, the speed that goes with it, and by how much
what is plausible of an effect grows with both."""

from dataclasses import replace

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import Scalar, sqrt
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.instant import Instant

SEA_LEVEL = 1.225
"""[kg/m3] density of the standard atmosphere (ISA)."""


def weight(at: Instant) -> Scalar:
    """[N] m g of the kite."""
    return at.values["m"] * at.values["g"]


def crosswind_speed(at: Instant) -> Scalar:
    """[m/s] 2.5 times the speed at which a lift coefficient of 1 carries the kite's weight: about what it flies across the wind (41 m/s for
    50 kg on 3 m2)."""
    return 2.5 * sqrt(2 * weight(at) / (SEA_LEVEL * at.values["S"]))


LISTED_MASS, LISTED_AREA = 54.0, 3.0
"""[kg], [m2] of the kites that the ranges of effects are listed for: KM1 and AP2."""
GROWS: dict[str, tuple[float, float]] = {
    "kg": (1.0, 0.0), "m": (0.0, 0.5), "kg/m": (1.0, -0.5), "N": (1.0, 0.0), "N/m": (1.0, -0.5), "N s/m": (0.5, 0.5),
    "m/s": (0.5, -0.5), "1/Pa": (-1.0, 1.0), "rad/m": (0.0, -0.5), "m/s/N": (-0.5, -0.5), "m/s/sqrt(N)": (0.0, -0.5),
    "m2": (0.0, 1.0), "kg m2": (1.0, 1.0),
}  # fmt: skip
"""Unit -> powers of mass and area with which a quantity grows from kite to kite: forces as the weight, lengths as the root of the area,
speeds as the root of the wing loading (Froude's law)."""
OF_THE_AIR = ("m/s", "rad/m")
"""Units in which effects are of the air or of what measures it, neither of which knows the kite; nor do the times of instruments."""


def growth(unit: str, declaration: KiteDeclaration) -> float:
    """By how much a quantity in `unit` is larger on the declared kite than on those the effects are listed for, at least 1: what is
    plausible of those stays plausible. 1 too where the file does not say mass and area, or says what none can be (`admissible`)."""
    mass, area = (0.0, 0.0) if unit in OF_THE_AIR else GROWS.get(unit, (0.0, 0.0))
    m, S = (declaration.parameters[n].value if n in declaration.parameters else 0.0 for n in ("m", "S"))
    return max((m / LISTED_MASS) ** mass * (S / LISTED_AREA) ** area, 1.0) if m > 0 and S > 0 else 1.0


def widened(p: Parameter, declaration: KiteDeclaration) -> Parameter:
    """A parameter of an effect with the bounds that are plausible of the declared kite. An end that is its null value stays."""
    if (by := growth(p.unit, declaration)) == 1.0:
        return p
    ends = {end: at if at == p.value else p.value + by * (at - p.value) for end, at in (("lower", p.lower), ("upper", p.upper))}
    return replace(p, **ends)
