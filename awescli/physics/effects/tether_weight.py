"""Weight and inertia of the paid-out line."""

from types import SimpleNamespace

from awescli.notation.frames import add, dot, rotate_back, scale
from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Load


class TetherWeight(Effect):
    """A straight line of mass mu l_t turns about the winch with the kite: half of its weight hangs on the kite, and a third of its mass
    moves with the kite across the line.

    A point of the line at s from the winch moves across it with (s / l_t) v_across, so that its kinetic energy is
    1/2 (mu l_t / 3) v_across^2, a rod's, and its potential energy that of mu l_t at half the height. What is paid out enters at the winch
    without angular momentum about it, so d/dt [(m l_t^2 + mu l_t^3 / 3) omega] = l_t F_across + (mu l_t^2 / 2) g_across. In terms of the
    kite's acceleration the line then pulls at it with
        mu l_t g / 2 down  -  (mu / 3) dl_t/dt v_across  -  (mu l_t / 3) a_across,
    the last of which is the load's `mass_across`. Along itself the line moves as the winch lets it: what that needs stands between drum
    and line and never reaches the kite. Source: Houska & Diehl, Optimal control for power generating kites, ECC 2007 (a third of the
    line's mass is inert, half of it weighs); the term with dl_t/dt follows from the balance above. Left out: the arm r_t of these
    forces (some cm: 4 N m beside 300 N m of the tension).
    """

    name = "tether_weight"
    doc = "half the line's weight hangs on the kite, a third of its mass moves with it"
    of_line = True
    parameters = (Parameter("mu", 0.0, "kg/m", 0.0, 0.05, source="0.0074 kg/m for 3.5 mm Dyneema"),)

    def load(self, at: Instant, own: SimpleNamespace) -> Load:
        mass = own.mu * at.line.length
        weight = mass * at.values["g"] / 2
        v_across = add(at.v_ned, scale(-dot(at.p_hat, at.v_ned), at.p_hat))
        north, east, down = scale(-own.mu * at.line.speed / 3, v_across)
        return Load(rotate_back(at.R, (north, east, down + weight)), (0.0, 0.0, 0.0), mass / 3)
