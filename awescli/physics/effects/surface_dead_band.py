"""A linkage with play: small deflections are lost."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.quantities import CONTROL_SURFACES
from awescli.notation.scalars import absolute, maximum, select
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class SurfaceDeadBand(Effect):
    """delta -> delta -+ d beyond the band, 0 inside it. Source: play in a linkage, half a degree to two."""

    name = "surface_dead_band"
    doc = "play in a linkage: deflections within the band are lost"
    parameters = (Parameter("d", 0.0, "rad", 0.0, 0.1, source="play of 0.5-2 deg"),)
    targets = CONTROL_SURFACES
    instrument = "actuator"
    probes = {"d": (0.01, 0.03)}

    def actuate(self, deflections: dict, at: Instant, own: SimpleNamespace) -> dict:
        delta = deflections[self.target]
        lost = own.d - maximum(own.d - absolute(delta), 0.0 * delta)
        return {**deflections, self.target: delta - select(delta, lost, -lost)}
