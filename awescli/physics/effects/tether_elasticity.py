"""An elastic line instead of the rigid constraint."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Line


class TetherElasticity(Effect):
    """T = EA (|p| - l)/l + zeta (phat . pdot - l_dot) replaces the constraint force where EA > 0."""

    name = "tether_elasticity"
    doc = "the line stretches"
    of_line = True
    parameters = (
        Parameter("EA", 0.0, "N", 0.0, 6e6, source="0.6 MN for a 4 mm line"),
        Parameter("zeta", 0.0, "N s/m", 0.0, 2000.0, source="KiteModels.jl: damping 473 N s over the length"),
    )
    probes = {"EA": (8e5,), "zeta": (100.0,)}
    abrupt = True
    shapes = ("zeta",)

    def line(self, line: Line, at: Instant, own: SimpleNamespace) -> Line:
        return line._replace(stiffness=line.stiffness + own.EA, damping=line.damping + own.zeta)
