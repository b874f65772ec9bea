"""A GNSS antenna that stands away from the reference point."""

from types import SimpleNamespace

from awescli.notation.frames import cross, rotate
from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class AntennaArm(Effect):
    """reported position p + R a and velocity v + R (omega x a), a = (x, 0, z) from the reference point, body axes (Farrell, Aided
    Navigation, ch. 11: lever arm). The reference point is where the accelerometers are: it is the arm between both that shows, whichever
    of them is off."""

    name = "antenna_arm"
    doc = "position and velocity are those of an antenna away from the accelerometers"
    instrument = "position receiver"
    needs_times = True  # 10 ms at 30 m/s are an arm of 0.3 m along the path
    parameters = (
        Parameter("x", 0.0, "m", -2.0, 2.0, source="0.2-1 m"),
        Parameter("z", 0.0, "m", -2.0, 2.0, source="0.2-1 m"),
    )

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        arm = (own.x, 0.0 * own.x, own.z)
        away, moves = rotate(at.R, arm), rotate(at.R, cross((at.z.p, at.z.q, at.z.r), arm))
        axes = ("n", "e", "d")
        there = {f"p_{a}": reported[f"p_{a}"] + away[i] for i, a in enumerate(axes)}
        return {**reported, **there, **{f"v_{a}": reported[f"v_{a}"] + moves[i] for i, a in enumerate(axes)}}
