"""A GNSS position that is reported late."""

from types import SimpleNamespace

from awescli.notation.frames import cross, rotate
from awescli.notation.parameters import Parameter
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class PositionLatency(Effect):
    """reported p(t) = p(t - tau) = p - tau v + tau^2/2 a - tau^3/6 (omega x a) + ...: 1 cm at 0.2 s and 40 m/s in a 60 m circle."""

    name = "position_latency"
    doc = "position reported late"
    instrument = "position receiver"
    matters = {"tau": 0.05}
    parameters = (Parameter("tau", 0.0, "s", -0.5, 0.5, source="0.05-0.22 s"),)

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        acceleration = (reported["a_x"], reported["a_y"], reported["a_z"])
        a = rotate(at.R, acceleration)
        # in a coordinated turn the acceleration turns with the body
        jerk = rotate(at.R, cross((at.z.p, at.z.q, at.z.r), acceleration))
        t = own.tau
        late = {name: reported[name] - t * (at.v_ned[i] - t / 2 * (a[i] - t / 3 * jerk[i])) for i, name in enumerate(("p_n", "p_e", "p_d"))}
        return {**reported, **late}
