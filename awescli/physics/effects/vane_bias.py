"""A flow vane that reads wrong."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class VaneBias(Effect):
    """reported alpha or beta = (1 + k) x + b."""

    name = "vane_bias"
    doc = "offset and scale of a flow vane"
    parameters = (
        Parameter("b", 0.0, "rad", -0.2, 0.2, source="1-2 deg"),
        Parameter("k", 0.0, "-", -0.5, 0.5, source="upwash of the boom"),
    )
    targets = ("alpha", "beta")
    matters = {"b": 0.026}

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        return {**reported, self.target: (1.0 + own.k) * reported[self.target] + own.b}
