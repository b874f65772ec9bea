"""Constant errors of gyros and accelerometers."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class ImuBias(Effect):
    """Three axes of one instrument: reported = true + b (rates in rad/s, accelerations in m/s2)."""

    name = "imu_bias"
    doc = "constant bias of gyros or accelerometers"
    parameters = tuple(
        Parameter(n, 0.0, "rad/s or m/s2", -3.0, 3.0, source="0.2 deg/s; accelerometers off level, 3 m/s2") for n in ("bx", "by", "bz")
    )
    targets = ("rates", "accelerations")
    _channels = {"rates": ("p", "q", "r"), "accelerations": ("a_x", "a_y", "a_z")}

    def __init__(self, target: str = "", declaration: KiteDeclaration | None = None):
        super().__init__(target, declaration)
        self.matters = dict.fromkeys(("bx", "by", "bz"), {"rates": 0.009, "accelerations": 0.5}[target])

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        biased = zip(self._channels[self.target], (own.bx, own.by, own.bz), strict=True)
        return {**reported, **{name: reported[name] + b for name, b in biased}}
