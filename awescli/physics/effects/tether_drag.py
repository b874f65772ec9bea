"""Tether drag beyond the declared one."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Line


class TetherDrag(Effect):
    """C_tD += dC, and `lateral` times the drag's part across the kite, -F_tD v_r / V_a along body y (docs/equations.md (17) has none)."""

    name = "tether_drag"
    doc = "tether drag coefficient and its lateral part"
    of_line = True
    parameters = (
        Parameter("dC", 0.0, "-", -1.0, 1.5, source="C_tD 0.7-1.2"),
        Parameter("lateral", 0.0, "-", -0.5, 2.0, source="1: the drag follows the flow"),
    )

    def line(self, line: Line, at: Instant, own: SimpleNamespace) -> Line:
        return line._replace(drag_coefficient=line.drag_coefficient + own.dC, lateral_drag=line.lateral_drag + own.lateral)
