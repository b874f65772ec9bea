"""PathFollowing: a rudder law of our own that flies crosswind loops around a pattern axis, a smooth function of the states.

It flies the synthetic flights; controllers identified from a log are the other files of this folder. Written in scalars (floats,
arrays, recorded scalars alike), so that `simulation.rollout.Simulator` compiles it: pass `law.setpoints` as its `law`.

How it steers. On the sphere around the winch the kite's course is compared with the circle's tangent. A kite outside the circle is
to fly inward by an angle that grows with its distance and saturates; the course error beyond that asks for more (or less) turn than
the circle itself needs; the rudder is what holds that rate of turn, plus feedback of the rate that is there:

    chi*   = -chi_max tanh(k_radius (arc - radius) / radius / chi_max)          inward course that is wanted
    Omega  = V (1 + k_course (chi - chi*)) / radius                             rate of turn about the line, in the pattern's sense
    rudder = k_feedforward r*_hat + k_rate (r*_hat - r_hat)                     r_hat = r b / 2V, as the yaw coefficients count it
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from awescli.control.pattern import Pattern, arc, distance, position, tangent_velocity
from awescli.notation.frames import dot, rotate, rotation_body_to_ned
from awescli.notation.quantities import STATES, SURFACES
from awescli.notation.scalars import Scalar, atan2, sqrt, tanh

SLOWEST = 5.0
"""[m/s] ground speed below which rates are no longer scaled by 1/V: a floor that keeps the law smooth near hover."""


@dataclass(frozen=True)
class PathFollowing:
    """Gains are dimensionless; angles in radians; set-points in the signs of the log (positive rudder turns positive about z).

    pattern: the circle, its `turn` says which way round; semi_span: b/2 [m]; limit: largest rudder [rad];
    trims: surface -> constant set-point [rad] of the surfaces that the law does not drive.
    """

    pattern: Pattern
    semi_span: float = 3.7
    k_radius: float = 1.0
    chi_max: float = 0.6
    k_course: float = 1.0
    k_feedforward: float = 1.4
    k_rate: float = 2.0
    limit: float = 0.44
    trims: dict = field(default_factory=dict)

    def deflections(self, z: Mapping[str, Scalar]) -> dict:
        """surface -> set-point [rad] at the state z (mapping of STATES to scalars); the interface of `control.law.Law`."""
        return {name: self._rudder(z) if name == "rudder" else self.trims.get(name, 0.0) for name in SURFACES}

    def setpoints(self, x: Sequence, u: Sequence = (), c: Sequence = ()) -> list:
        """The four set-points in the order of SURFACES, from the state vector of a `physics.kite.Kite`: what a Simulator takes."""
        deflections = self.deflections(dict(zip(STATES, x, strict=False)))
        return [deflections[name] for name in SURFACES]

    def _rudder(self, z: Mapping[str, Scalar]) -> Scalar:
        pattern = self.pattern
        outward, around = tangent_velocity(z, pattern)
        speed = sqrt(outward * outward + around * around + SLOWEST * SLOWEST)
        error = (arc(z, pattern) - pattern.radius) / pattern.radius
        wanted = -self.chi_max * tanh(self.k_radius * error / self.chi_max)
        turn_rate = speed * (1.0 + self.k_course * (atan2(outward, around) - wanted)) / pattern.radius
        # the pattern's sense is about the line outward; the kite's belly looks at the winch, so its yaw counts the other way
        r_wanted = -pattern.turn * turn_rate
        R = rotation_body_to_ned(z["phi"], z["theta"], z["psi"])
        r = -dot(rotate(R, (z["p"], z["q"], z["r"])), position(z)) / distance(z)
        hat = self.semi_span / speed
        rudder = hat * (self.k_feedforward * r_wanted + self.k_rate * (r_wanted - r))
        return self.limit * tanh(rudder / self.limit)
