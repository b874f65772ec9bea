"""A winch that is commanded how fast to pay out, and answers the load."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import Scalar, maximum, sqrt
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import lag_rate
from awescli.physics.instant import Instant, Line

HEAVIEST = 1e8
"""[N] a load that no line holds: no limit."""
USUAL, LATE = 3000.0, 0.1
"""[N] a usual load; [s] by which what a winch pays out is known beforehand no better."""


def asked_speed(load: Scalar, v: Scalar, kv: Scalar, k: Scalar, f_low: Scalar, f_high: Scalar) -> Scalar:
    """[m/s] the law: what is asked for at a load [N]."""
    beyond = maximum(load - f_high, 0.0 * load) - maximum(f_low - load, 0.0 * load)
    return v + kv * sqrt(maximum(load, 1.0 + 0.0 * load)) + k * beyond


class WinchControl(Effect):
    """Beside what the log says (nothing, where a flight is only simulated) the reference speed of the winch is

        v + kv sqrt(f) + k (max(f - f_high, 0) - max(f_low - f, 0)),

    f the load behind a filter of first order. kv is the law under which a kite of constant lift to drag ratio yields most, T = (v / kv)^2
    (Luchsinger, Airborne Wind Energy, ch. 3, 2013); f_low and f_high are limits of force control, names and form of
    github.com/OpenSourceAWE/WinchControllers.jl. Inertia and limits of the drum are `winch_tracking`'s, behind it.

    States: the filtered load, and by how much the reference length is ahead of the logged one. The reference's own acceleration is left
    to the drum that follows it.
    """

    name = "winch_control"
    doc = "reel-out speed asked for, and how it answers the load"
    parameters = (
        Parameter("v", 0.0, "m/s", -20.0, 20.0, source="reel-in 4-8 m/s, reel-out 0.5-3 m/s"),
        Parameter("kv", 0.0, "m/s/sqrt(N)", 0.0, 1.0, source="v / sqrt(T): 2 m/s at 4 kN are 0.03"),
        Parameter("k", 0.0, "m/s/N", 0.0, 0.1, source="1 m/s per 0.2-2 kN beyond a limit"),
        Parameter("f_low", 0.0, "N", 0.0, HEAVIEST, source="a line that stays taut: 200-500 N; gives form only"),
        Parameter("f_high", HEAVIEST, "N", 0.0, HEAVIEST, source="what line and kite hold: 4-10 kN; gives form only"),
        Parameter("tau", 0.3, "s", 0.02, 10.0, source="load cell filter, 0.1-0.5 s; gives form only"),
    )
    of_line = True
    traceable = False
    states = ("load", "ahead")
    units = ("N", "m")
    shapes = ("f_low", "f_high", "tau")

    def _asked(self, at: Instant, own: SimpleNamespace) -> Scalar:
        """[m/s]"""
        load, _ = self.own_states(at)
        return asked_speed(load, own.v, own.kv, own.k, own.f_low, own.f_high)

    def line(self, line: Line, at: Instant, own: SimpleNamespace) -> Line:
        _, ahead = self.own_states(at)
        return line._replace(length=line.length + ahead, speed=line.speed + self._asked(at, own))

    def start_spreads(self, own: SimpleNamespace) -> tuple:
        # what it asks for, at a usual load, in the time by which a winch's records are late
        asked = abs(own.v) + own.kv * USUAL**0.5 + own.k * USUAL
        return 100.0, max(LATE * asked, 1e-4)

    def rates(self, at: Instant, own: SimpleNamespace) -> tuple:
        load, _ = self.own_states(at)
        return lag_rate(load, at.tension, own.tau), self._asked(at, own)

    def initial(self, at: Instant, own: SimpleNamespace) -> tuple:
        return at.tension, 0.0 * at.tension
