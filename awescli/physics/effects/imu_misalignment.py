"""A box of gyros and accelerometers that is turned against the axes of the attitude."""

from types import SimpleNamespace

from awescli.notation.frames import cross
from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class ImuMisalignment(Effect):
    """reported rates and accelerations x - e cross x: body axes turned by the small angles e = (x, y, z) [rad] are those of the box
    (Titterton & Weston, Strapdown Inertial Navigation Technology, ch. 10: misalignment)."""

    name = "imu_misalignment"
    doc = "gyros and accelerometers turned against the axes of the attitude"
    instrument = "IMU"
    parameters = tuple(Parameter(n, 0.0, "rad", -0.2, 0.2, source="mounting: 1-3 deg") for n in "xyz")

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        turned = (own.x, own.y, own.z)
        for channels in (("p", "q", "r"), ("a_x", "a_y", "a_z")):
            there = tuple(reported[n] for n in channels)
            reported = {**reported, **{n: x - c for n, x, c in zip(channels, there, cross(turned, there), strict=True)}}
        return reported
