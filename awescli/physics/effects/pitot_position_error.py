"""A pitot that stands in the flow of its own aircraft."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class PitotPositionError(Effect):
    """reported V_a = V_a (1 + k_a alpha + k_b beta + k_bb beta^2): static pressure at the port changes with the angle of attack; with
    sideslip alike to both sides where the port stands in the plane of symmetry (k_bb), and to first order where it stands beside it, on a
    wing (k_b). Source: position error of 1-5 % (Haering, Airdata measurement and calibration, NASA TM-104316, 1995); at alpha = 0.1 and
    beta = 0.2 rad that is k_a = 0.1-0.5, k_b = 0.05-0.25 and k_bb = 0.3-1.3."""

    name = "pitot_position_error"
    doc = "airspeed off with angle of attack and sideslip"
    instrument = "pitot"
    parameters = (
        Parameter("k_a", 0.0, "1/rad", -2.0, 2.0, source="1-5 % at 0.1 rad"),
        Parameter("k_b", 0.0, "1/rad", -1.0, 1.0, source="1-5 % at 0.2 rad"),
        Parameter("k_bb", 0.0, "1/rad2", -5.0, 5.0, source="1-5 % at 0.2 rad"),
    )

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        share = own.k_a * at.alpha + own.k_b * at.beta + own.k_bb * at.beta * at.beta
        return {**reported, "V_a": reported["V_a"] * (1 + share)}
