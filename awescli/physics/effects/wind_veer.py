"""Wind veer: the wind's direction turns with height."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import cos, sin
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Wind

REFERENCE_HEIGHT = 100.0
"""[m] where the veer leaves the declared direction unchanged."""


class WindVeer(Effect):
    """direction += k (h - 100 m), clockwise seen from above for k > 0."""

    name = "wind_veer"
    doc = "turning of the wind over height"
    parameters = (Parameter("k", 0.0, "rad/m", -0.005, 0.005, source="-2.5 deg per 100 m between two stations' records"),)

    def airflow(self, wind: Wind, at: Instant, own: SimpleNamespace) -> Wind:
        turn = own.k * (-at.z.p_d - REFERENCE_HEIGHT)
        s, c = sin(turn), cos(turn)
        return wind._replace(n=c * wind.n - s * wind.e, e=s * wind.n + c * wind.e)
