"""An actuator that follows its set-point late."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.quantities import SURFACES
from awescli.notation.scalars import Scalar, cos, exp, maximum, select, sin, sqrt
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import clipped, lag_rate, lag_time, lagged
from awescli.physics.effects.past import moves, past_of
from awescli.physics.instant import Instant

FASTEST = 50.0
"""[rad/s] a rate limit that no actuator reaches: none."""
LIGHTEST = 1e-4
"""Inertia of which nothing is left within what an actuator follows."""
ALIKE = 1e-6
"""Square of the difference of two poles, as a share, at which they are alike: there is a formula for two, and one for none."""


class ActuatorLag(Effect):
    """inertia tau^2 d2(delta)/dt2 + tau d(delta)/dt + delta = set-point, with |d(delta)/dt| at most rate.

    Of first order where inertia is 0; the damping ratio is 1/(2 sqrt(inertia)): 1 at 1/4, and 0.7, as servos have it, at 1/2. (Two lags in
    a row have the sum tau and the product inertia tau^2, but a fit of the two cannot tell which is which.) Source: 0.1 s, 2 rad/s (MegAWES
    actuators).
    """

    name = "actuator_lag"
    doc = "first- or second-order lag with a rate limit"
    parameters = (
        Parameter("tau", 0.0, "s", 0.0, 1.0, source="0.1 s"),
        Parameter("rate", FASTEST, "rad/s", 0.002, FASTEST, source="2 rad/s (MegAWES); a trim motor needs seconds for a degree"),
        Parameter("inertia", 0.0, "-", 0.0, 1.0, source="from first order to a damping ratio of 1/2; gives form only"),
    )
    targets = SURFACES
    instrument = "actuator"
    matters = {"tau": 0.03}
    states = ("deflection", "speed")
    start_spread = (0.005, 0.05)
    units = ("target", "target/s")
    probes = {"tau": (0.06, 0.15, 0.3), "rate": (FASTEST, 0.8, 0.06, 0.005)}
    shapes = ("rate", "inertia")
    refinements = {"inertia": (0.15, 0.5)}

    def __init__(self, target: str = "", declaration: KiteDeclaration | None = None):
        super().__init__(target, declaration)
        self.inputs = past_of(target)

    def actuate(self, deflections: dict, at: Instant, own: SimpleNamespace) -> dict:
        deflection, _ = self.own_states(at)
        return {**deflections, self.target: lagged(deflection, deflections[self.target], own.tau)}

    def rates(self, at: Instant, own: SimpleNamespace) -> tuple:
        deflection, speed = self.own_states(at)
        tau = lag_time(own.tau)
        towards = (self.received(at)[self.target] - deflection) / tau
        # the speed follows what a first-order lag would do
        return clipped(lagged(speed, towards, own.inertia * tau), own.rate), lag_rate(speed, towards, own.inertia * tau)

    def initial(self, at: Instant, own: SimpleNamespace) -> tuple:
        # where the set-points of the past have left it, each move of theirs a ramp: it follows tau behind, and what differs from that dies
        # away
        tau = lag_time(own.tau)
        behind, speed = at.inputs[past_of(self.target)[-1]], 0.0 * tau
        for seconds, before, after in moves(self.target, at):
            slope = (after - before) / seconds
            left, faster = _died_away(behind - before + tau * slope, speed - slope, seconds, tau, own.inertia)
            reached = after - tau * slope + left
            behind = behind + clipped(reached - behind, own.rate * seconds)
            speed = clipped(slope + faster, own.rate)
        return self.received(at)[self.target] + behind, speed


def _died_away(x: Scalar, speed: Scalar, seconds: float, tau: Scalar, inertia: Scalar) -> tuple[Scalar, Scalar]:
    """(x, speed) after some seconds of inertia tau^2 x'' + tau x' + x = 0: by both poles where it is damped critically or more, as a swing
    that dies away where it is less."""
    # poles -(1 -+ root) / (2 inertia tau), the slow one written so that it stays where the fast one runs away
    root, heavy = sqrt(maximum(1 - 4 * inertia, ALIKE)), maximum(inertia, LIGHTEST)
    slow, fast = -2 / (tau * (1 + root)), -(1 + root) / (2 * heavy * tau)
    of_slow, of_fast = (speed - fast * x) / (slow - fast), (slow * x - speed) / (slow - fast)
    of_slow, of_fast = of_slow * exp(slow * seconds), of_fast * exp(fast * seconds)
    damped = of_slow + of_fast, slow * of_slow + fast * of_fast
    heavy = maximum(inertia, 0.25)
    decay, turn = 1 / (2 * heavy * tau), sqrt(maximum(4 * heavy - 1, ALIKE)) / (2 * heavy * tau)
    left, c, s = exp(-decay * seconds), cos(turn * seconds), sin(turn * seconds) / turn
    swings = left * (c * x + s * (speed + decay * x)), left * (c * speed - s * (decay * speed + x / (heavy * tau * tau)))
    return select(0.25 - inertia, damped[0], swings[0]), select(0.25 - inertia, damped[1], swings[1])
