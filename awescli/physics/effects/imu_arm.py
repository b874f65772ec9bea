"""Accelerometers that stand away from the reference point: they feel the rotation of the kite."""

from types import SimpleNamespace

from awescli.notation.frames import add, cross
from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class ImuArm(Effect):
    """reported a + omega_dot x r + omega x (omega x r), r = (x, y, z) from the reference point, body axes (Klein & Morelli, Aircraft System
    Identification, ch. 10: correction of accelerometers to the centre of gravity). Gyros are the same everywhere."""

    name = "imu_arm"
    doc = "accelerations are those of a place away from the reference point"
    instrument = "accelerometers"
    parameters = tuple(Parameter(n, 0.0, "m", -2.0, 2.0, source="0.1-1 m") for n in "xyz")

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        omega, arm = (at.z.p, at.z.q, at.z.r), (own.x, own.y, own.z)
        felt = add(cross(at.derivative[9:12], arm), cross(omega, cross(omega, arm)))
        return {**reported, **{f"a_{n}": reported[f"a_{n}"] + felt[i] for i, n in enumerate("xyz")}}
