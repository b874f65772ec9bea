"""A whole group of signals on a clock of its own."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Line


class ClockOffset(Effect):
    """Winch signals stamped late by tau: the true length at t is the logged one at t + tau, l_t + tau l_t_dot + tau^2/2 l_t_ddot.

    The onboard clock is the reference; a late onboard clock is an early winch.
    """

    name = "clock_offset"
    doc = "winch signals stamped late or early"
    of_line = True
    parameters = (Parameter("tau", 0.0, "s", -10.0, 10.0, source="milliseconds to 10 s"),)
    targets = ("winch",)

    def line(self, line: Line, at: Instant, own: SimpleNamespace) -> Line:
        return line._replace(
            length=line.length + own.tau * (line.speed + own.tau / 2 * line.acceleration), speed=line.speed + own.tau * line.acceleration
        )
