"""The wing twists under load."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Coefficients, Instant


class AeroelasticTwist(Effect):
    """C_L,alpha (1 - k qbar): the part of C_L that grows with alpha loses a share proportional to dynamic pressure."""

    name = "aeroelastic_twist"
    doc = "lift slope falls with dynamic pressure"
    parameters = (Parameter("k", 0.0, "1/Pa", -5e-4, 5e-4, source="a few per cent at 1 kPa"),)

    def coefficients(self, coefficients: Coefficients, at: Instant, own: SimpleNamespace) -> Coefficients:
        lost = own.k * at.dynamic_pressure * coefficients.CL_alpha_part
        return coefficients._replace(CL=coefficients.CL - lost)
