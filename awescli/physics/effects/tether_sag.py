"""A heavy line hangs: part of its length is not distance."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Line


class TetherSag(Effect):
    """l_t - |p| = w^2 l^3 / (24 T^2), w the line's weight per length across it."""

    name = "tether_sag"
    doc = "sag of the line under its weight"
    of_line = True
    parameters = (Parameter("w", 0.0, "N/m", 0.0, 1.0, source="0.07 N/m for 3.5 mm Dyneema; 0.6 m of sag"),)
    probes = {"w": (0.1, 0.3)}

    def line(self, line: Line, at: Instant, own: SimpleNamespace) -> Line:
        return line._replace(sag_weight=line.sag_weight + own.w)
