"""Pitching moment that bends with the angle of attack."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Coefficients, Instant


class PitchCurvature(Effect):
    """C_m += k alpha^2."""

    name = "pitch_curvature"
    doc = "pitching moment quadratic in alpha"
    parameters = (Parameter("k", 0.0, "1/rad2", -10.0, 10.0, source="KM1's published polynomial: -0.7 /rad2"),)

    def coefficients(self, coefficients: Coefficients, at: Instant, own: SimpleNamespace) -> Coefficients:
        return coefficients._replace(Cm=coefficients.Cm + own.k * at.alpha * at.alpha)
