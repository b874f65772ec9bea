"""Air density other than declared."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Wind


class AirDensity(Effect):
    """rho = c rho_0."""

    name = "air_density"
    doc = "factor on the air density"
    parameters = (Parameter("c", 1.0, "-", 0.8, 1.2, source="+3.7 % between two real days at Lista"),)

    def airflow(self, wind: Wind, at: Instant, own: SimpleNamespace) -> Wind:
        return wind._replace(density=wind.density * own.c)
