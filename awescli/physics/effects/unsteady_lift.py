"""Lift follows the angle of attack with a delay."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import lag_rate, lagged
from awescli.physics.instant import Coefficients, Instant

UNSTEADY = 0.5
"""[1/s] rate at which the coefficient changes in flight: a lag of tau is behind by tau times that."""


class UnsteadyLift(Effect):
    """tau dC_L/dt = C_L,steady - C_L: first-order lag of the circulation (Wagner's two states, the fast one dropped)."""

    name = "unsteady_lift"
    doc = "first-order lag of lift"
    parameters = (Parameter("tau", 0.0, "s", 0.0, 0.6, source="0.1 s"),)
    states = ("CL",)
    units = ("-",)
    probes = {"tau": (0.05, 0.1, 0.2)}

    def coefficients(self, coefficients: Coefficients, at: Instant, own: SimpleNamespace) -> Coefficients:
        (state,) = self.own_states(at)
        return coefficients._replace(CL=lagged(state, coefficients.CL, own.tau))

    def start_spreads(self, own: SimpleNamespace) -> tuple:
        # lift that follows at once is nowhere behind
        return (UNSTEADY * max(own.tau, 1e-3),)

    def rates(self, at: Instant, own: SimpleNamespace) -> tuple:
        (state,) = self.own_states(at)
        return (lag_rate(state, self.received(at).CL, own.tau),)

    def initial(self, at: Instant, own: SimpleNamespace) -> tuple:
        return (self.received(at).CL,)
