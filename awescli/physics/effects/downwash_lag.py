"""The tail meets the wing's downwash late."""

from types import SimpleNamespace

from awescli.notation.frames import add, cross
from awescli.notation.parameters import Parameter
from awescli.notation.scalars import Scalar
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import lag_rate, lag_time, lagged
from awescli.physics.instant import Coefficients, Instant


class DownwashLag(Effect):
    """C_m += Cm_adot (c / 2 V_a) dalpha/dt, the rate as the tail sees it: (alpha - alpha_tail) / tau, tau = l_t / V_a the time that air
    takes from wing to tail, arm l_t in chords c, and tau dalpha_tail/dt = alpha - alpha_tail.

    For a slow change this is the textbook's lag of downwash (Etkin & Reid, Dynamics of Flight, ch. 5: C_m_alphadot), and it needs no
    derivative of a state that the moment itself changes. Typical: -3 to -8 with a conventional tail.
    """

    name = "downwash_lag"
    doc = "pitching moment with the rate of the angle of attack"
    parameters = (
        Parameter("Cm_adot", 0.0, "1/rad", -40.0, 40.0, source="-3 to -8 (conventional tail)"),
        Parameter("arm", 4.0, "-", 1.0, 10.0, source="tail arm in chords; gives form only"),
    )
    states = ("alpha",)
    units = ("rad",)
    start_spread = (0.02,)
    shapes = ("arm",)

    def _tau(self, at: Instant, own: SimpleNamespace) -> Scalar:
        return own.arm * at.values["c"] / at.V_a

    def coefficients(self, coefficients: Coefficients, at: Instant, own: SimpleNamespace) -> Coefficients:
        (state,) = self.own_states(at)
        seen = lagged(state, at.alpha, self._tau(at, own))
        # c / (2 V_a) / tau = 1 / (2 arm)
        return coefficients._replace(Cm=coefficients.Cm + own.Cm_adot * (at.alpha - seen) / (2 * own.arm))

    def rates(self, at: Instant, own: SimpleNamespace) -> tuple:
        (state,) = self.own_states(at)
        return (lag_rate(state, at.alpha, self._tau(at, own)),)

    def initial(self, at: Instant, own: SimpleNamespace) -> tuple:
        # the velocity through air that stays changes with that over ground, and turns as the body does
        u, _, w = at.air_velocity
        du, _, dw = add(at.acceleration, cross(at.air_velocity, (at.z.p, at.z.q, at.z.r)))
        return (at.alpha - lag_time(self._tau(at, own)) * (u * dw - w * du) / (u * u + w * w),)
