"""Drag that falls with the Reynolds number."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import exp, log
from awescli.physics.effects.base import Effect
from awescli.physics.effects.sizes import crosswind_speed
from awescli.physics.instant import Coefficients, Instant


class ReynoldsDrag(Effect):
    """The drag coefficients of kite and line times (V_a / V_0)^-n, V_0 the kite's crosswind speed (`sizes.crosswind_speed`).

    Friction falls as Re^-1/5 on a turbulent wing (Schlichting, Boundary-Layer Theory: n = 0.2), n = 0.17 is -10 % from 30 to 55 m/s. The
    line's drag, C_tD d l_t rho V_a^2 / 8, counts as C_tD d l_t / (4 S) of the kite's drag coefficient.
    """

    name = "reynolds_drag"
    doc = "drag of kite and line falls with the Reynolds number"
    parameters = (Parameter("n", 0.0, "-", -0.5, 1.0, source="-10 % from 30 to 55 m/s: 0.17"),)

    def coefficients(self, coefficients: Coefficients, at: Instant, own: SimpleNamespace) -> Coefficients:
        v = at.values
        line = v["CtD"] * v["d_t"] * at.inputs["tether_length"] / (4 * v["S"]) if "tether_length" in at.inputs else 0.0
        change = exp(-own.n * log(at.V_a / crosswind_speed(at))) - 1
        return coefficients._replace(CD=coefficients.CD + (coefficients.CD + line) * change)
