"""Propellers: thrust, reaction torque and gyroscopic moment, driven by the throttle or turned by the air."""

import math
from collections.abc import Sequence
from types import SimpleNamespace

from awescli.notation.errors import BadInput
from awescli.notation.frames import Vector, add, cross, dot, scale
from awescli.notation.parameters import Parameter
from awescli.notation.present import present
from awescli.notation.scalars import Scalar, exp, log, maximum
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Load
from awescli.physics.propeller import Propeller

SLOWEST = 0.5
"""[1/s] revolutions below which thrust and torque are nothing: keeps the advance ratio finite where nothing moves."""
LEAST_POWER = 1e-3
"""[W] below which the guess of the power balance no longer follows the power (its third root has no slope at zero)."""
ITERATIONS = 7
"""Newton steps of the power balance. It is convex and rising, so that they close in from above: 1e-12 of the power for every throttle from
idle to full and 0 to 45 m/s (tests/physics/test_thrust.py)."""


class Thrust(Effect):
    """All declared `propellers`: T = C_T(J) rho n^2 D^4 along the axis at the hub, torque Q = C_P(J) rho n^2 D^5 / 2 pi against the sense,
    and -omega x h of their angular momentum h = 2 pi n J_p along the axis (Beard & McLain, ch. 4.3; Stevens & Lewis, ch. 2).

    J = V/(n D) with the speed V of the air along the axis at the hub, rates included. A propeller is never slower than the air turns it,
    n >= V/(J_w D) with C_P(J_w) = 0: at zero throttle it windmills, its C_T(J_w) < 0 is its drag and it gives no torque. So the
    coefficients are never asked for beyond J_w. Propellers that are braked or folded are not of this kind.
    """

    name = "thrust"
    doc = "propellers: thrust, torque, windmilling drag"
    parameters = (
        Parameter("scale", 1.0, "-", 0.3, 2.0, source="thrust over the declared one; tables of small propellers scatter by 5-10 %"),
        Parameter("power", 1.0, "-", 0.3, 2.0, source="shaft power over the declared one; battery, temperature"),
    )
    always = True

    def __init__(self, target: str = "", declaration: KiteDeclaration | None = None):
        super().__init__(target, declaration)
        declared = present(declaration, f"the kite file that '{self.name}' reads")
        self.propellers = declared.propellers
        if not self.propellers:
            raise BadInput("effect 'thrust' has no propeller", where="effects", do="Declare `propellers`, a list with at least one.")
        recorded = any(p.speed.law == "recorded" for p in self.propellers)
        driven = any(p.speed.law != "recorded" for p in self.propellers)
        self.inputs = self.reads = ("motor_speed",) if recorded else ()
        self.logged = (*(("throttle",) if driven else ()), *self.reads)

    def load(self, at: Instant, own: SimpleNamespace) -> Load:
        force = moment = (0.0, 0.0, 0.0)
        for propeller in self.propellers:
            f, m = self._of(propeller, at, own)
            force, moment = add(force, f), add(moment, m)
        return Load(force, moment)

    def _of(self, propeller: Propeller, at: Instant, own: SimpleNamespace) -> tuple[Vector, Vector]:
        """(force, moment about the reference point) of one propeller."""
        axis, rates, density, D = propeller.direction, (at.z.p, at.z.q, at.z.r), at.wind.density, propeller.diameter
        speed = dot(axis, add(at.air_velocity, cross(rates, propeller.hub)))
        speed = maximum(speed, 0.0 * speed)
        n = self._revolutions(propeller, speed, at, own)
        J = speed / (n * D)
        push = own.scale * polynomial(propeller.thrust_polynomial, J) * density * n * n * D**4
        torque = polynomial(propeller.power_polynomial, J) * density * n * n * (D**5 / (2 * math.pi))
        force = scale(push, axis)
        turning = scale(propeller.sense * 2 * math.pi * n * propeller.inertia, axis)
        moment = add(cross(propeller.hub, force), scale(-propeller.sense * torque, axis))
        return force, add(moment, scale(-1.0, cross(rates, turning)))

    def _revolutions(self, propeller: Propeller, speed: Scalar, at: Instant, own: SimpleNamespace) -> Scalar:
        """Revolutions per second, not slower than the air turns the propeller."""
        free = maximum(speed / (propeller.free_advance * propeller.diameter), SLOWEST + 0.0 * speed)
        if propeller.speed.law == "recorded":
            return maximum(at.inputs["motor_speed"], free)
        throttle = at.deflections["throttle"]
        if propeller.speed.law == "proportional":
            return maximum(propeller.speed.full * throttle, free)
        power = own.power * polynomial(propeller.speed.shaft_power, throttle)
        return maximum(balanced(propeller, maximum(power, 0.0 * power), speed, free, at.wind.density), free)


def balanced(propeller: Propeller, power: Scalar, speed: Scalar, free: Scalar, density: Scalar) -> Scalar:
    """Revolutions per second n at which C_P(J) rho n^3 D^5 = `power` [W], by Newton's method; free: those at which it takes none."""
    CP, D = propeller.power_polynomial, propeller.diameter
    wanted = power / (density * D**5)
    # above the answer: C_P falls towards the free speed
    n = free + exp(log(maximum(wanted, LEAST_POWER / D**5 + 0.0 * wanted) / CP[0]) / 3)
    slope = tuple(k * c for k, c in enumerate(CP))[1:] or (0.0,)
    for _ in range(ITERATIONS):
        J = speed / (n * D)
        c = polynomial(CP, J)
        n = maximum(n - (c * n * n * n - wanted) / (n * n * (3 * c - J * polynomial(slope, J))), free)
    return n


def polynomial(coefficients: Sequence[float], x: Scalar) -> Scalar:
    """sum_k c_k x^k, by Horner's rule."""
    total = coefficients[-1] + 0.0 * x
    for c in reversed(coefficients[:-1]):
        total = total * x + c
    return total
