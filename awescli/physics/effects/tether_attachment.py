"""The line is attached elsewhere than declared."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Line


class TetherAttachment(Effect):
    """r_t += (dx, dy, dz)."""

    name = "tether_attachment"
    doc = "offset of the tether attachment"
    of_line = True
    parameters = tuple(Parameter(n, 0.0, "m", -0.2, 0.2, source="1 cm = 40 N m at 4 kN") for n in ("dx", "dy", "dz"))

    def line(self, line: Line, at: Instant, own: SimpleNamespace) -> Line:
        x, y, z = line.attachment
        return line._replace(attachment=(x + own.dx, y + own.dy, z + own.dz))
