"""Aerodynamic coefficients from the kite file's table of terms."""

import math
import re
from types import SimpleNamespace

from awescli.notation.errors import BadInput, did_you_mean
from awescli.notation.frames import Vector
from awescli.notation.present import present
from awescli.notation.quantities import CONTROL_SURFACES
from awescli.notation.scalars import Scalar, absolute, cos, sin
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Coefficients, Instant

VARIABLES = ("alpha", "beta", "p_hat", "q_hat", "r_hat", *CONTROL_SURFACES)
COEFFICIENTS = {"wind": ("CD", "CY", "CL", "Cl", "Cm", "Cn"), "body": ("CX", "CY", "CZ", "Cl", "Cm", "Cn")}
"""Frame of the forces in a kite file -> its coefficients."""
_FACTOR = re.compile(r"^(abs\()?([a-z_]+)(\))?(?:\^(\d))?$")


def parse_monomial(text: str) -> list[tuple[str, bool, int]]:
    """`alpha^2*abs(beta)` -> [(variable, absolute?, power)]; `1` -> []. Raises BadInput with what is allowed."""
    factors = []
    for part in [] if text.strip() == "1" else text.replace(" ", "").split("*"):
        match = _FACTOR.match(part)
        if not match or bool(match[1]) != bool(match[3]) or match[2] not in VARIABLES:
            raise BadInput(f"cannot read '{part}' in the monomial '{text}'", do=did_you_mean(part, [*VARIABLES, "abs(beta)", "1"]))
        factors.append((match[2], bool(match[1]), int(match[4] or 1)))
    return factors


class Aerodynamics(Effect):
    """C_j = sum over the table's terms of parameter * monomial; rates as p b/2V_a, q c/2V_a, r b/2V_a: docs/equations.md (9); Beard &
    McLain, ch. 4.

    The kite file's `aerodynamics` is the table; its `surfaces` turn the log's signs into the table's.
    """

    name = "aerodynamics"
    doc = "polynomial lift, drag, side force and moments"
    always = True

    def __init__(self, target: str = "", declaration: KiteDeclaration | None = None):
        super().__init__(target, declaration)
        declared = present(declaration, f"the kite file that '{self.name}' reads")
        self.table = declared.aerodynamics
        self.signs = {name: surface.sign for name, surface in declared.surfaces.items()}

    def coefficients(self, coefficients: Coefficients, at: Instant, own: SimpleNamespace) -> Coefficients:
        c = self._evaluate(at, at.alpha)
        at_zero = self._evaluate(at, 0.0 * at.alpha)
        return c._replace(CL_alpha_part=c.CL - at_zero.CL)

    def _evaluate(self, at: Instant, alpha: Scalar) -> Coefficients:
        unit = 180 / math.pi if self.table.angles == "deg" else 1.0
        b, c, V_a = at.values["b"], at.values["c"], at.V_a
        x = {
            "alpha": alpha * unit,
            "beta": at.beta * unit,
            "p_hat": (at.z.p - at.wind.roll) * b / (2 * V_a),
            "q_hat": (at.z.q - at.wind.pitch) * c / (2 * V_a),
            "r_hat": (at.z.r - at.wind.yaw) * b / (2 * V_a),
            **{name: self.signs.get(name, 1) * unit * at.deflections[name] for name in CONTROL_SURFACES},
        }
        C = []
        for coefficient in COEFFICIENTS[self.table.frame]:
            total = 0.0
            for monomial, parameter in self.table.terms.get(coefficient, {}).items():
                term = at.values[parameter]
                for variable, is_absolute, power in parse_monomial(monomial):
                    factor = absolute(x[variable]) if is_absolute else x[variable]
                    for _ in range(power):
                        term = term * factor
                total = total + term
            C.append(total)
        X, Y, Z, *moments = C
        if self.table.frame == "body":
            X, Y, Z = wind_axes(X, Y, Z, at.alpha, at.beta)
        return Coefficients._make((X, Y, Z, *moments, 0.0))


def wind_axes(CX: Scalar, CY: Scalar, CZ: Scalar, alpha: Scalar, beta: Scalar) -> Vector:
    """(C_D, C_Y, C_L) of a force given in body axes: the inverse of `body_axes`."""
    s_a, c_a, s_b, c_b = sin(alpha), cos(alpha), sin(beta), cos(beta)
    forward = CX * c_a + CZ * s_a
    return -(forward * c_b + CY * s_b), CY * c_b - forward * s_b, CX * s_a - CZ * c_a


def body_axes(CD: Scalar, CY: Scalar, CL: Scalar, alpha: Scalar, beta: Scalar) -> Vector:
    """(C_X, C_Y, C_Z) of (C_D, C_Y, C_L): docs/equations.md (10)."""
    s_a, c_a, s_b, c_b = sin(alpha), cos(alpha), sin(beta), cos(beta)
    return (
        -CD * c_b * c_a - CY * s_b * c_a + CL * s_a,
        -CD * s_b + CY * c_b,
        -CD * c_b * s_a - CY * s_b * s_a - CL * c_a,
    )
