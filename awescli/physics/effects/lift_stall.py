"""Lift rolls off at high angle of attack."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import maximum
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Coefficients, Instant


class LiftStall(Effect):
    """C_L -= k max(0, alpha - alpha_0)^2: the beginning of stall."""

    name = "lift_stall"
    doc = "lift rolls off above alpha_0"
    parameters = (
        Parameter("k", 0.0, "1/rad2", -50.0, 200.0, source="alpha > 10 deg"),
        Parameter("alpha_0", 0.1, "rad", 0.0, 0.35, source="onset; gives form only"),
    )
    probes = {"alpha_0": (0.06, 0.09, 0.12, 0.16)}
    shapes = ("alpha_0",)

    def coefficients(self, coefficients: Coefficients, at: Instant, own: SimpleNamespace) -> Coefficients:
        beyond = maximum(at.alpha - own.alpha_0, 0.0 * at.alpha)
        return coefficients._replace(CL=coefficients.CL - own.k * beyond * beyond)
