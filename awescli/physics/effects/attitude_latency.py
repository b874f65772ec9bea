"""Euler angles that are reported late."""

from types import SimpleNamespace

from awescli.notation.parameters import Parameter
from awescli.notation.scalars import cos, sin
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant


class AttitudeLatency(Effect):
    """reported angles e(t) = e(t - tau) = e - tau de/dt + tau^2/2 d2e/dt2 - ..., from the rates and angular accelerations of the instant
    (Beard & McLain eq. 3.3, and its derivative). Where surfaces move all the time, what is left out is a tenth of the noise at 40 ms and
    half of it at 80 ms. Not near theta = 90 deg, where the angles themselves run away."""

    name = "attitude_latency"
    doc = "attitude reported late"
    instrument = "attitude reference"
    matters = {"tau": 0.03}
    parameters = (Parameter("tau", 0.0, "s", -0.3, 0.3, source="0.02-0.1 s"),)

    def report(self, reported: dict, at: Instant, own: SimpleNamespace) -> dict:
        z, t = at.z, own.tau
        s_f, c_f, s_t, c_t = sin(z.phi), cos(z.phi), sin(z.theta), cos(z.theta)
        dphi, dtheta, dpsi, dp, dq, dr = at.derivative[6:12]
        # Y = q sin(phi) + r cos(phi), the rate of turn in the plane of the yaw axis
        Y, dY = z.q * s_f + z.r * c_f, dq * s_f + dr * c_f + dphi * dtheta
        second = (
            dp + dY * s_t / c_t + Y * dtheta / (c_t * c_t),
            dq * c_f - dr * s_f - dphi * Y,
            dY / c_t + Y * dtheta * s_t / (c_t * c_t),
        )
        names, first = ("phi", "theta", "psi"), (dphi, dtheta, dpsi)
        late = {n: reported[n] - t * (a - t / 2 * b) for n, a, b in zip(names, first, second, strict=True)}
        return {**reported, **late}
