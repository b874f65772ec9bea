"""An actuator that follows its set-point late."""

from awescli.notation.parameters import Parameter
from awescli.notation.quantities import SURFACES
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import clipped, lag_rate, lagged

FASTEST = 50.0
"""[rad/s] a rate limit that no actuator reaches: none."""


class ActuatorLag(Effect):
    """d(delta)/dt = (y - delta)/tau, limited to +-rate; tau_2 dy/dt = set-point - y makes the lag one of second order.

    Source: 0.1 s, 2 rad/s (MegAWES actuators); two time constants are a second-order actuator without overshoot.
    """

    name = "actuator_lag"
    doc = "first- or second-order lag with a rate limit"
    parameters = (
        Parameter("tau", 0.0, "s", 0.0, 1.0, source="0.1 s"),
        Parameter("rate", FASTEST, "rad/s", 0.05, FASTEST, source="2 rad/s (MegAWES)"),
        Parameter("tau_2", 0.0, "s", 0.0, 0.5, source="no slower than the first; gives form only"),
    )
    targets = SURFACES
    states = ("command", "deflection")
    probes = {"tau": (0.06, 0.15, 0.3), "rate": (FASTEST, 0.8)}
    shapes = ("rate", "tau_2")
    refinements = {"tau_2": (0.08,)}

    def actuate(self, deflections, at, own):
        command, deflection = self.own_states(at)
        setpoint = deflections[self.target]
        command = lagged(command, setpoint, own.tau_2)
        at.states[f"{self.key}.setpoint"], at.states[f"{self.key}.followed"] = setpoint, command
        return {**deflections, self.target: lagged(deflection, command, own.tau)}

    def rates(self, at, own):
        command, deflection = self.own_states(at)
        return (
            lag_rate(command, at.states[f"{self.key}.setpoint"], own.tau_2),
            clipped(lag_rate(deflection, at.states[f"{self.key}.followed"], own.tau), own.rate),
        )

    def initial(self, at, own):
        # where a lagging surface is when its set-point has been moving steadily
        setpoint, rate = at.states[f"{self.key}.setpoint"], at.inputs[f"{self.target}_rate"]
        command = setpoint - own.tau_2 * rate
        return command, command - own.tau * clipped(rate, own.rate)
