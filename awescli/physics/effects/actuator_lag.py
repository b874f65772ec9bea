"""An actuator that follows its set-point late."""

from awescli.notation.parameters import Parameter
from awescli.notation.quantities import SURFACES
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import clipped, lag_rate, lagged

FASTEST = 50.0
"""[rad/s] a rate limit that no actuator reaches: none."""


class ActuatorLag(Effect):
    """d(delta)/dt = (set-point - delta)/tau, limited to +-rate. Source: 0.1 s, 2 rad/s (MegAWES actuators)."""

    name = "actuator_lag"
    doc = "first-order lag with a rate limit"
    parameters = (
        Parameter("tau", 0.0, "s", 0.0, 1.0, source="0.1 s"),
        Parameter("rate", FASTEST, "rad/s", 0.05, FASTEST, source="2 rad/s (MegAWES)"),
    )
    targets = SURFACES
    states = ("deflection",)
    probes = {"tau": (0.06, 0.15, 0.3), "rate": (FASTEST, 0.8)}
    shapes = ("rate",)

    def actuate(self, deflections, at, own):
        at.states[f"{self.key}.target"] = deflections[self.target]
        return {**deflections, self.target: lagged(*self.own_states(at), deflections[self.target], own.tau)}

    def rates(self, at, own):
        return (clipped(lag_rate(*self.own_states(at), at.states[f"{self.key}.target"], own.tau), own.rate),)

    def initial(self, at, own):
        # where a lagging surface is when its set-point has been moving steadily
        return (at.states[f"{self.key}.target"] - own.tau * clipped(at.inputs[f"{self.target}_rate"], own.rate),)
