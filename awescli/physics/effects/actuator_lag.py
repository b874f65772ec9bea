"""An actuator that follows its set-point late."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.quantities import SURFACES
from awescli.notation.scalars import exp
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import clipped, lag_rate, lag_time, lagged
from awescli.physics.effects.past import moves, past_of
from awescli.physics.instant import Instant

FASTEST = 50.0
"""[rad/s] a rate limit that no actuator reaches: none."""


class ActuatorLag(Effect):
    """inertia tau^2 d2(delta)/dt2 + tau d(delta)/dt + delta = set-point, with |d(delta)/dt| at most rate.

    Of first order where inertia is 0; 1/4 is critical damping, damping ratio 1/(2 sqrt(inertia)) = 1. (Two lags in a row have the sum tau
    and the product inertia tau^2, but a fit of the two cannot tell which is which.) Source: 0.1 s, 2 rad/s (MegAWES actuators).
    """

    name = "actuator_lag"
    doc = "first- or second-order lag with a rate limit"
    parameters = (
        Parameter("tau", 0.0, "s", 0.0, 1.0, source="0.1 s"),
        Parameter("rate", FASTEST, "rad/s", 0.002, FASTEST, source="2 rad/s (MegAWES); a trim motor needs seconds for a degree"),
        Parameter("inertia", 0.0, "-", 0.0, 0.25, source="from first order to critical damping; gives form only"),
    )
    targets = SURFACES
    instrument = "actuator"
    matters = {"tau": 0.03}
    states = ("deflection", "speed")
    start_spread = (0.005, 0.5)
    units = ("target", "target/s")
    probes = {"tau": (0.06, 0.15, 0.3), "rate": (FASTEST, 0.8, 0.06, 0.005)}
    shapes = ("rate", "inertia")
    refinements = {"inertia": (0.15,)}

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
        # where the set-points of the past have left it, each move of theirs a ramp
        tau = lag_time(own.tau)
        behind = at.inputs[past_of(self.target)[-1]]
        for seconds, before, after in moves(self.target, at):
            slope = (after - before) / seconds
            reached = after - tau * slope + (behind - before + tau * slope) * exp(-seconds / tau)
            behind = behind + clipped(reached - behind, own.rate * seconds)
        return self.received(at)[self.target] + behind, clipped(-behind / tau, own.rate)
