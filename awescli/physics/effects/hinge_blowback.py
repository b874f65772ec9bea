"""A surface that the air blows back."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.quantities import CONTROL_SURFACES
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class HingeBlowback(Effect):
    """delta = set-point / (1 + k qbar): the hinge moment H qbar delta bends a linkage of stiffness K until K (set-point - delta) holds it,
    k = H / K. Source: Etkin & Reid, Dynamics of Flight, ch. 2 (hinge moments); 10-30 % lost at 50 m/s is k = 0.7-2.8e-4 per Pa."""

    name = "hinge_blowback"
    doc = "deflection lost with dynamic pressure"
    parameters = (Parameter("k", 0.0, "1/Pa", 0.0, 1e-3, source="10-30 % at 50 m/s"),)
    targets = CONTROL_SURFACES
    instrument = "actuator"

    def actuate(self, deflections: dict, at: Instant, own: SimpleNamespace) -> dict:
        return {**deflections, self.target: deflections[self.target] / (1 + own.k * at.dynamic_pressure)}
