"""A mis-rigged surface or an asymmetric wing: a constant moment."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Coefficients, Instant

_MOMENT = {"roll": "Cl", "pitch": "Cm", "yaw": "Cn"}


class SurfaceBias(Effect):
    """C_l, C_m or C_n += b. Cannot be distinguished from that axis' derivative of a surface that never moves."""

    name = "surface_bias"
    doc = "constant moment coefficient"
    parameters = (Parameter("b", 0.0, "-", -0.02, 0.02, source="0.5-2 deg of aileron"),)
    targets = ("roll", "pitch", "yaw")

    def coefficients(self, coefficients: Coefficients, at: Instant, own: SimpleNamespace) -> Coefficients:
        moment = _MOMENT[self.target]
        return coefficients._replace(**{moment: getattr(coefficients, moment) + own.b})
