"""Lift that changes in flight."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import tanh
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import lag_time
from awescli.physics.instant import Coefficients, Instant

SUDDEN = 1.0
"""[s] within which a step happens where nothing else is known: fast against a loop, and slow enough for the cost to have a slope in its
time."""


class LiftDrift(Effect):
    """C_L times 1 + rate t + step (1 + tanh((t - at) / within)) / 2, t the flight's clock: rain, icing, temperature; damage, a shed layer.
    Source: 1-10 % (Lynch & Khodadoust, Effects of ice accretions on aircraft aerodynamics, Prog. Aerospace Sci. 37, 2001)."""

    name = "lift_drift"
    doc = "lift that drifts, or steps, in flight"
    parameters = (
        Parameter("rate", 0.0, "1/s", -0.002, 0.002, source="1-10 % in minutes"),
        Parameter("step", 0.0, "-", -0.3, 0.3, source="1-10 %"),
        Parameter("at", 60.0, "s", 0.0, 1e5, source="onset on the flight's clock; gives form only"),
        Parameter("within", SUDDEN, "s", 0.0, 10.0, source="from damage to rain; gives form only"),
    )
    shapes = ("at", "within")
    onset = "at"
    refinements = {"within": (0.3, 0.1)}

    def coefficients(self, coefficients: Coefficients, at: Instant, own: SimpleNamespace) -> Coefficients:
        time = at.inputs["time"]
        since = (1 + tanh((time - own.at) / lag_time(own.within))) / 2
        return coefficients._replace(CL=coefficients.CL * (1 + own.rate * time + own.step * since))
