"""Constant errors of gyros and accelerometers."""

from dataclasses import replace
from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant

LARGEST = 3.0
"""[m/s2] plausible bias of an accelerometer."""


class ImuBias(Effect):
    """Three axes of one instrument: reported = true + b (rates in rad/s, accelerations in m/s2)."""

    name = "imu_bias"
    doc = "constant bias of gyros or accelerometers"
    parameters = tuple(Parameter(n, 0.0, "rad/s or m/s2", -1.0, 1.0, source="0.2 deg/s") for n in ("bx", "by", "bz"))
    targets = ("rates", "accelerations")
    _channels = {"rates": ("p", "q", "r"), "accelerations": ("a_x", "a_y", "a_z")}

    def __init__(self, target: str = "", declaration: KiteDeclaration | None = None):
        super().__init__(target, declaration)
        if target == "accelerations":  # a box that is mounted off level
            self.parameters = tuple(replace(p, lower=LARGEST * p.lower, upper=LARGEST * p.upper) for p in self.parameters)
        self.matters = dict.fromkeys(("bx", "by", "bz"), {"rates": 0.009, "accelerations": 0.5}[target])

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        biased = zip(self._channels[self.target], (own.bx, own.by, own.bz), strict=True)
        return {**reported, **{name: reported[name] + b for name, b in biased}}
