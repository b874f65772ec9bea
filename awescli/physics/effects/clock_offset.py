"""A whole group of signals on a clock of its own."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.around import LOOKED_AT, ahead, around
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Line


class ClockOffset(Effect):
    """Winch signals stamped late by tau: the true length at t is the logged one at t + tau.

    The onboard clock is the reference; a late onboard clock is an early winch. Of a winch that has no record, as on a simulated flight with
    a winch law, nothing is late.
    """

    name = "clock_offset"
    doc = "winch signals stamped late or early"
    of_line = True
    parameters = (Parameter("tau", 0.0, "s", -10.0, 10.0, source="milliseconds to 10 s"),)
    targets = ("winch",)
    inputs = tuple(name for signal in LOOKED_AT for name in around(signal))

    def line(self, line: Line, at: Instant, own: SimpleNamespace) -> Line:
        length, speed, acceleration = ahead(at.inputs, own.tau)
        return line._replace(length=line.length + length, speed=line.speed + speed, acceleration=line.acceleration + acceleration)
