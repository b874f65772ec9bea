"""A heading that is off by a constant."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class HeadingBias(Effect):
    """reported psi = psi + b."""

    name = "heading_bias"
    doc = "constant error of the reported yaw angle"
    instrument = "attitude reference"
    matters = {"b": 0.026}
    parameters = (Parameter("b", 0.0, "rad", -0.6, 0.6, source="1-5 deg; a declination that is not taken out, up to 30 deg"),)

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        return {**reported, "psi": reported["psi"] + own.b}
