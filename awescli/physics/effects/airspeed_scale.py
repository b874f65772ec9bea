"""A pitot that reads wrong."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class AirspeedScale(Effect):
    """reported V_a = s V_a + b."""

    name = "airspeed_scale"
    doc = "scale and offset of the pitot"
    instrument = "pitot"
    parameters = (
        Parameter("s", 1.0, "-", 0.7, 1.3, source="2-5 %"),
        Parameter("b", 0.0, "m/s", -5.0, 5.0, source="pressure offset"),
    )

    slips = {
        "s": {
            1.94384: "is the airspeed in kt, and read as m/s?",
            3.6: "is the airspeed in km/h, and read as m/s?",
            2.23694: "is it in mph, and read as m/s?",
            0.51444: "is the airspeed in m/s, and read as kt?",
            0.27778: "is it in m/s, and read as km/h?",
            0.44704: "is it in m/s, and read as mph?",
        }
    }

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        return {**reported, "V_a": own.s * reported["V_a"] + own.b}
