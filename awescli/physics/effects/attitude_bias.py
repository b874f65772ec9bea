"""A roll or pitch angle that is off by a constant."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class AttitudeBias(Effect):
    """reported phi or theta = angle + b (Klein & Morelli 2006, ch. 10)."""

    name = "attitude_bias"
    doc = "constant error of the reported roll or pitch angle"
    targets = ("phi", "theta")
    instrument = "attitude reference"
    parameters = (Parameter("b", 0.0, "rad", -0.3, 0.3, source="level calibration: 1-5 deg"),)

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        return {**reported, self.target: reported[self.target] + own.b}
