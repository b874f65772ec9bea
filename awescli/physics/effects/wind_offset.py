"""A constant wind that the station did not see, updraft included."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Wind


class WindOffset(Effect):
    """v_wind += (dN, dE, dD)."""

    name = "wind_offset"
    doc = "constant wind added to the declared one"
    parameters = tuple(Parameter(n, 0.0, "m/s", -6.0, 6.0, source="1-3 m/s between station and flight") for n in ("dN", "dE", "dD"))

    def airflow(self, wind: Wind, at: Instant, own: SimpleNamespace) -> Wind:
        return wind._replace(n=wind.n + own.dN, e=wind.e + own.dE, d=wind.d + own.dD)
