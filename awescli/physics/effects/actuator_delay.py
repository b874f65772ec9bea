"""An actuator, or its bus, that answers after a pure delay."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.quantities import SURFACES
from awescli.notation.scalars import Scalar, cos, exp, sin, sqrt
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import SHORTEST
from awescli.physics.effects.past import moves, past_of
from awescli.physics.instant import Instant


class ActuatorDelay(Effect):
    """delta(t) = set-point(t - tau) as a second-order Pade form (1 - tau s/2 + (tau s)^2/12) / (1 + tau s/2 + (tau s)^2/12).

    All-pass: amplitude untouched, phase right to 1 % up to 2/tau; the poles of a delay below 0.1 s are slower than its own, and its
    amplitude at 10 rad/s loses up to 5 %. States x1, x2 = x1': tau^2/12 x1'' + tau/2 x1' + x1 = set-point, delta = set-point - tau x1'.
    """

    name = "actuator_delay"
    doc = "pure delay of a surface"
    parameters = (Parameter("tau", 0.0, "s", 0.0, 0.5, source="0.05-0.2 s"),)
    targets = SURFACES
    instrument = "actuator"
    matters = {"tau": 0.03}
    states = ("x1", "x2")
    start_spread = (0.005, 0.05)
    units = ("target", "target/s")
    probes = {"tau": (0.06, 0.12, 0.2)}

    def __init__(self, target: str = "", declaration: KiteDeclaration | None = None):
        super().__init__(target, declaration)
        self.inputs = past_of(target)

    def _tau(self, own: SimpleNamespace) -> Scalar:
        # the Pade poles, 3.5/tau, must be stepped through well by the longest step: a delay much shorter than 60 ms keeps those of one that
        # is so long. No kink between the two: fits ended on it
        shortest = 5 * SHORTEST
        return sqrt(sqrt(own.tau**4 + shortest**4))

    def actuate(self, deflections: dict, at: Instant, own: SimpleNamespace) -> dict:
        _, x2 = self.own_states(at)
        return {**deflections, self.target: deflections[self.target] - own.tau * x2}

    def rates(self, at: Instant, own: SimpleNamespace) -> tuple:
        (x1, x2), tau = self.own_states(at), self._tau(own)
        return x2, 12 * (self.received(at)[self.target] - x1 - tau * x2 / 2) / (tau * tau)

    def initial(self, at: Instant, own: SimpleNamespace) -> tuple:
        # what set-points of the past have left: on a ramp x1 = set-point - tau/2 slope, and what differs from that dies away by the poles
        # (-3 +- i sqrt(3)) / tau
        tau = self._tau(own)
        decay, turn = 3 / tau, 3**0.5 / tau
        x1, x2 = at.inputs[past_of(self.target)[-1]], 0.0 * tau
        for seconds, before, after in moves(self.target, at):
            slope = (after - before) / seconds
            y1, y2 = x1 - (before - tau * slope / 2), x2 - slope
            left, c, s = exp(-decay * seconds), cos(turn * seconds), sin(turn * seconds)
            x1 = after - tau * slope / 2 + left * (c * y1 + s * (y2 + decay * y1) / turn)
            x2 = slope + left * (c * y2 - s * (decay * y2 + 12 / (tau * tau) * y1) / turn)
        return self.received(at)[self.target] + x1, x2
