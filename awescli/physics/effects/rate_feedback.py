"""A damper in the autopilot that moves a surface beyond its logged set-point."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import Scalar
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import lag_rate
from awescli.physics.instant import Instant

TURNS = {"aileron": "p", "elevator": "q", "rudder": "r"}
"""Surface -> rate about the axis that it turns the kite about."""


class RateFeedback(Effect):
    """deflection = set-point + k (rate - its slow part), tau d(slow part)/dt = rate - slow part: a damper with washout, which leaves steady
    turns alone (McLean, Automatic Flight Control Systems, 1990, ch. 6; Etkin & Reid 1996, ch. 8)."""

    name = "rate_feedback"
    doc = "a damper with washout that is not in the logged set-points"
    parameters = (
        Parameter("k", 0.0, "s", -1.5, 1.5, source="0.1-1 s"),
        Parameter("tau", 2.0, "s", 0.3, 20.0, source="1-4 s; gives form only"),
    )
    targets = tuple(TURNS)
    states = ("slow",)
    units = ("rad/s",)
    start_spread = (0.2,)
    shapes = ("tau",)
    probes = {"tau": (2.0,)}
    refinements = {"tau": (0.8, 5.0)}

    def actuate(self, deflections: dict, at: Instant, own: SimpleNamespace) -> dict:
        (slow,) = self.own_states(at)
        return {**deflections, self.target: deflections[self.target] + own.k * (self._rate(at) - slow)}

    def _rate(self, at: Instant) -> Scalar:
        return getattr(at.z, TURNS[self.target])

    def rates(self, at: Instant, own: SimpleNamespace) -> tuple:
        (slow,) = self.own_states(at)
        return (lag_rate(slow, self._rate(at), own.tau),)

    def initial(self, at: Instant, own: SimpleNamespace) -> tuple:
        return (self._rate(at),)
