"""Drag of something that is not in the declared table."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import absolute
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Coefficients, Instant


class ParasiticDrag(Effect):
    """C_D += dCD + k |beta|."""

    name = "parasitic_drag"
    doc = "drag independent of lift, growing with |beta|"
    parameters = (
        Parameter("dCD", 0.0, "-", -0.1, 0.3, source="+0.08-0.11, stowed rotors"),
        Parameter("k", 0.0, "1/rad", -1.0, 1.0, source="stowed rotors in side flow"),
    )

    def coefficients(self, coefficients: Coefficients, at: Instant, own: SimpleNamespace) -> Coefficients:
        return coefficients._replace(CD=coefficients.CD + own.dCD + own.k * absolute(at.beta))
