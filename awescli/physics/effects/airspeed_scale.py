"""A pitot that reads wrong."""

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect


class AirspeedScale(Effect):
    """reported V_a = s V_a + b."""

    name = "airspeed_scale"
    doc = "scale and offset of the pitot"
    parameters = (
        Parameter("s", 1.0, "-", 0.7, 1.3, source="2-5 %"),
        Parameter("b", 0.0, "m/s", -5.0, 5.0, source="pressure offset"),
    )

    def report(self, reported, at, own):
        return {**reported, "V_a": own.s * reported["V_a"] + own.b}
