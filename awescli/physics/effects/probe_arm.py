"""An air data probe away from the reference point: it meets the air that the kite's rotation brings it."""

from types import SimpleNamespace

from awescli.notation.frames import add, cross
from awescli.notation.parameters import Parameter
from awescli.physics.airflow import flow_angles
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class ProbeArm(Effect):
    """reported V_a, alpha, beta are those of v_r + omega x r at the probe's place r = (x, y, z) (Jategaonkar, ch. 10).

    A boom 0.4 m ahead of the centre of mass sees 1.3 deg more angle of attack at 1 rad/s and 17 m/s. A place is known by the tape measure:
    declared, not traced. Stands before the effects of the probe's own errors (airspeed_scale, vane_bias).
    """

    name = "probe_arm"
    doc = "place of the air data probe: it sees the rotation of the kite"
    parameters = tuple(Parameter(n, 0.0, "m", -3.0, 3.0, source="from the reference point, body axes; 0.2-0.5 m") for n in "xyz")
    traceable = False

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        there = add(at.air_velocity, cross((at.z.p, at.z.q, at.z.r), (own.x, own.y, own.z)))
        # differences of one formula, so that nothing changes at null, to the last bit
        seen, own_place = flow_angles(there), flow_angles(at.air_velocity)
        changes = {name: seen[i] - own_place[i] for i, name in enumerate(("V_a", "alpha", "beta"))}
        return {**reported, **{name: reported[name] + change for name, change in changes.items()}}
