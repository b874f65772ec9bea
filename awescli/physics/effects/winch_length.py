"""A drum that counts wrong."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Line


class WinchLength(Effect):
    """true length = (1 + s) l_t + b: scale (drum radius, stretch) and zero of the counter."""

    name = "winch_length"
    doc = "scale and zero of the logged tether length"
    of_line = True
    parameters = (
        Parameter("s", 0.0, "-", -0.05, 0.05, source="drum radius, layers"),
        Parameter("b", 0.0, "m", -20.0, 20.0, source="zero of the drum"),
    )

    def line(self, line: Line, at: Instant, own: SimpleNamespace) -> Line:
        return line._replace(
            length=line.length + own.s * line.length + own.b,
            speed=line.speed + own.s * line.speed,
            acceleration=line.acceleration + own.s * line.acceleration,
        )
