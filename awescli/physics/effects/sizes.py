"""Sizes of the kite that flies, for what generic code must measure by something: its weight, the speed that goes with it."""

from awescli.notation.scalars import Scalar, sqrt
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
