"""Lift that changes in flight."""

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import tanh
from awescli.physics.effects.base import Effect

SUDDEN = 1.0
"""[s] within which a step happens: damage or a shed layer of ice is fast against a loop, and the cost must have a slope in its time."""


class LiftDrift(Effect):
    """C_L times 1 + rate t + step s(t - at), t the flight's clock, s a smooth step from 0 to 1: rain, icing, damage, temperature.
    Source: 1-10 % (Lynch & Khodadoust, Effects of ice accretions on aircraft aerodynamics, Prog. Aerospace Sci. 37, 2001)."""

    name = "lift_drift"
    doc = "lift that drifts, or steps, in flight"
    parameters = (
        Parameter("rate", 0.0, "1/s", -0.002, 0.002, source="1-10 % in minutes"),
        Parameter("step", 0.0, "-", -0.3, 0.3, source="1-10 %"),
        Parameter("at", 60.0, "s", 0.0, 1e5, source="onset on the flight's clock; gives form only"),
    )
    probes = {"at": (20.0, 40.0, 60.0, 80.0, 100.0, 120.0)}
    shapes = ("at",)

    def coefficients(self, coefficients, at, own):
        time = at.inputs["time"]
        since = (1 + tanh((time - own.at) / SUDDEN)) / 2
        return coefficients._replace(CL=coefficients.CL * (1 + own.rate * time + own.step * since))
