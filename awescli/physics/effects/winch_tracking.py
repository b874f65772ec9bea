"""A winch that follows its reference late."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import Scalar, exp
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import clipped, lag_time, lagged
from awescli.physics.effects.past import moves, past_of
from awescli.physics.instant import Instant, Line

UNSTEADY = 0.02
"""[m/s] by how much a winch's speed may differ from what its past has left, where a rollout begins."""
REFERENCE = "reel_out_speed"
"""What the winch follows."""
FASTEST = 100.0
"""[m/s], [m/s2] a limit that no winch reaches: none."""


class WinchTracking(Effect):
    """The logged length and speed are what the winch was asked for: tau dv/dt = v_ref - v with |dv/dt| at most a_max (torque over inertia)
    and |v| at most v_max, and the length paid out is the integral of v.

    States: v, and by how much the paid-out length is ahead of its reference. A winch that has followed from rest is behind by tau v.
    Source: 0.2-1 s; a winch with inertia and limits: Fechner et al., Dynamic model of a pumping kite power system, Renewable Energy 83,
    2015.
    """

    name = "winch_tracking"
    doc = "winch follows its reference with a lag and limits"
    parameters = (
        Parameter("tau", 0.0, "s", 0.0, 3.0, source="0.2-1 s"),
        Parameter("v_max", FASTEST, "m/s", 0.1, FASTEST, source="drum and generator; gives form only"),
        Parameter("a_max", FASTEST, "m/s2", 0.05, FASTEST, source="torque over inertia; gives form only"),
    )
    of_line = True
    inputs = past_of(REFERENCE)
    states = ("speed", "ahead")
    units = ("m/s", "m")
    probes = {"tau": (0.2, 0.6)}
    shapes = ("v_max", "a_max")

    def _motion(self, line: Line, at: Instant, own: SimpleNamespace) -> tuple[Scalar, Scalar]:
        """(speed, acceleration) of the drum where `line` is asked for."""
        speed, _ = self.own_states(at)
        v = lagged(clipped(speed, own.v_max), line.speed, own.tau)
        # towards what it can reach: a drum at its fastest has no acceleration left, and none to take back
        return v, clipped((clipped(line.speed, own.v_max) - speed) / lag_time(own.tau), own.a_max)

    def line(self, line: Line, at: Instant, own: SimpleNamespace) -> Line:
        _, ahead = self.own_states(at)
        v, a = self._motion(line, at, own)
        return line._replace(length=line.length + ahead, speed=v, acceleration=lagged(a, line.acceleration, own.tau))

    def start_spreads(self, own: SimpleNamespace) -> tuple:
        # a winch that follows at once is nowhere ahead
        return UNSTEADY, UNSTEADY * max(own.tau, 1e-3)

    def rates(self, at: Instant, own: SimpleNamespace) -> tuple:
        asked = self.received(at)
        v, a = self._motion(asked, at, own)
        return a, v - asked.speed

    def initial(self, at: Instant, own: SimpleNamespace) -> tuple:
        # the speed to which the past of its reference has brought it, each change a ramp; behind as after a whole reel-out from rest
        tau = lag_time(own.tau)
        behind = at.inputs[past_of(REFERENCE)[-1]]
        for seconds, before, after in moves(REFERENCE, at):
            slope = (after - before) / seconds
            reached = after - tau * slope + (behind - before + tau * slope) * exp(-seconds / tau)
            behind = behind + clipped(reached - behind, own.a_max * seconds)
        speed = clipped(self.received(at).speed + behind, own.v_max)
        return speed, -own.tau * speed
