"""Drag of sideslip."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Coefficients, Instant


class SideslipDrag(Effect):
    """C_D += k beta^2."""

    name = "sideslip_drag"
    doc = "drag growing with the square of sideslip"
    parameters = (Parameter("k", 0.0, "1/rad2", -10.0, 10.0, source="1-5 /rad2"),)

    def coefficients(self, coefficients: Coefficients, at: Instant, own: SimpleNamespace) -> Coefficients:
        return coefficients._replace(CD=coefficients.CD + own.k * at.beta * at.beta)
