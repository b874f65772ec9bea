"""A compass with iron beside it."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import cos, sin
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class CompassDeviation(Effect):
    """reported psi = psi + b sin(psi) + c cos(psi): the semicircular deviation of a compass, which iron that is magnetised makes (Bowditch,
    The American Practical Navigator, on compasses: coefficients B and C)."""

    name = "compass_deviation"
    doc = "error of the reported yaw angle that goes round with it"
    instrument = "attitude reference"
    parameters = tuple(Parameter(n, 0.0, "rad", -0.4, 0.4, source="1-10 deg before compensation") for n in "bc")

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        psi = at.z.psi
        return {**reported, "psi": reported["psi"] + own.b * sin(psi) + own.c * cos(psi)}
