"""A surface that works less beyond a threshold."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.quantities import CONTROL_SURFACES
from awescli.notation.scalars import absolute, maximum, select
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class SurfaceEffectiveness(Effect):
    """The part of a deflection beyond the threshold counts s times. Source: Makani, 0.5 beyond 10 deg."""

    name = "surface_effectiveness"
    doc = "deflection beyond a threshold works less"
    parameters = (
        Parameter("s", 1.0, "-", -0.5, 2.0, source="0.5 beyond 10 deg (Makani)"),
        Parameter("threshold", 0.17, "rad", 0.02, 0.5, source="10 deg; gives form only"),
    )
    targets = CONTROL_SURFACES
    probes = {"threshold": (0.09, 0.14, 0.19)}
    shapes = ("threshold",)

    def actuate(self, deflections: dict, at: Instant, own: SimpleNamespace) -> dict:
        delta = deflections[self.target]
        beyond = maximum(absolute(delta) - own.threshold, 0.0 * delta)
        return {**deflections, self.target: delta + (own.s - 1.0) * select(delta, beyond, -beyond)}
