"""A pitot behind tubes."""

from types import SimpleNamespace

from awescli.notation.frames import dot
from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.effects.lag import lag_rate, lag_time, lagged
from awescli.physics.instant import Instant


class AirspeedLag(Effect):
    """tau dy/dt = V_a - y: first-order lag of the reported airspeed. Source: pneumatic lag of tubes and volume, 0.1-0.5 s (Haering,
    Airdata measurement and calibration, NASA TM-104316, 1995)."""

    name = "airspeed_lag"
    doc = "reported airspeed lags, pneumatic tubes"
    instrument = "pitot"
    parameters = (Parameter("tau", 0.0, "s", 0.0, 1.5, source="0.1-0.5 s, pneumatic tubes"),)
    states = ("airspeed",)
    units = ("m/s",)
    start_spread = (0.5,)
    probes = {"tau": (0.06, 0.15, 0.4)}

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        (state,) = self.own_states(at)
        return {**reported, "V_a": lagged(state, reported["V_a"], own.tau)}

    def rates(self, at: Instant, own: SimpleNamespace) -> tuple:
        (state,) = self.own_states(at)
        return (lag_rate(state, at.V_a, own.tau),)

    def initial(self, at: Instant, own: SimpleNamespace) -> tuple:
        # the airspeed has been changing as it does now, in a wind that stays
        return (at.V_a - lag_time(own.tau) * dot(at.air_velocity, at.acceleration) / at.V_a,)
