"""The tether: line constraint, virtual spring, drag sag, attachment moment: docs/equations.md (12) to (17)."""

from collections.abc import Mapping
from types import SimpleNamespace

from awescli.notation.frames import Vector, add, cross, dot, rotate, rotate_back, scale
from awescli.notation.present import present
from awescli.notation.scalars import Scalar, maximum, select, sqrt
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.base import Effect
from awescli.physics.instant import Instant, Line, Load

STEEPEST = 0.95
"""sin(theta_t) is kept below this: a line that goes slack cannot carry its drag by a tilt, docs/equations.md (16) (see `Tether._force`)."""
LEAST = 1e-9
"""[N] keeps a quotient of forces finite where both vanish."""


def thesis_pull(at: Instant, f: Vector, m: Scalar) -> Scalar:
    """F_1 = phat . R^T (f_a + f_g + m (rv-qw, pw-ru, qu-pv)): docs/equations.md (13), Rositani (2025) eq. (2) with the sign that
    cancels the pull along the line.

    As printed, it adds the pull instead of cancelling it: requiring no acceleration along the line in the body frame
    gives this sign (tests/physics/test_tether.py shows the net pull to be zero).
    """
    z = at.z
    coriolis = (z.r * z.v - z.q * z.w, z.p * z.w - z.r * z.u, z.q * z.u - z.p * z.v)
    return dot(at.p_hat, rotate(at.R, add(f, scale(m, coriolis))))


def exact_pull(at: Instant, f: Vector, m: Scalar) -> Scalar:
    """F_1 of the constraint |p| = l_t itself, docs/equations.md (14): phat . R^T f + m (|pdot|^2 - (phat . pdot)^2) / |p| - m l_t_ddot."""
    along = dot(at.p_hat, at.v_ned)
    inertial = (dot(at.v_ned, at.v_ned) - along * along) / at.distance - at.line.acceleration
    return dot(at.p_hat, rotate(at.R, f)) + m * inertial


LAWS = {"thesis": thesis_pull, "exact": exact_pull}


class Tether(Effect):
    """T = max(0, F_1 + k_v (|p| - (l_t + dl)) + c_v (phat . pdot - l_t_dot)), f_t = R_y(theta_t) R^T (-T phat), m_t = r_t x f_t.

    The tilt sin(theta_t) = -F_tD / T carries the line's drag while the line pulls harder than its drag; what it cannot carry, all of it on
    a slack line, acts on the kite against the flow.

    It puts the line on the kite, and reads from the kite's table what `requires` names: virtual spring, drag, attachment.
    """

    name = "tether"
    doc = "line constraint with virtual spring, drag and attachment moment"
    always = True
    last = True
    gives_line = True
    requires = ("d_t", "CtD", "rtx", "rty", "rtz", "k_v", "c_v", "dl")
    inputs = ("tether_length", "reel_out_speed", "reel_out_acceleration", "tension", "tension_rate")
    logged = ("tether_length", "reel_out_speed")

    def __init__(self, target: str = "", declaration: KiteDeclaration | None = None):
        super().__init__(target, declaration)
        declared = present(declaration, f"the kite file that '{self.name}' reads")
        self.pull, self.measured = LAWS[declared.tether.law], declared.tether.tension == "measured"
        self.reads = ("tension",) if self.measured else ()

    def declared_line(self, at: Instant) -> Line:
        v = at.values
        paid_out = at.inputs["tether_length"], at.inputs["reel_out_speed"], at.inputs["reel_out_acceleration"]
        return Line(*paid_out, v["CtD"], 0.0, (v["rtx"], v["rty"], v["rtz"]), 0.0, 0.0, 0.0)

    def load(self, at: Instant, own: SimpleNamespace) -> Load:
        v, line, m = at.values, at.line, at.body.mass
        at.tension = at.inputs["tension"] if self.measured else self._tension(at, v, line, m)
        return self._force(at, v, line, at.tension)

    def _tension(self, at: Instant, v: Mapping[str, Scalar], line: Line, m: Scalar) -> Scalar:
        F_1 = self.pull(at, at.applied.force, m)
        # a heavy line hangs: w^2 l^3 / (24 T^2) of its length is not distance; a parabola while it pulls by more than its own weight
        weight = line.sag_weight * line.length
        steep = weight / maximum(F_1, weight + LEAST)
        sag = steep * steep * line.length / 24
        stretch = at.distance - (line.length + v["dl"] - sag)
        stretch_rate = dot(at.p_hat, at.v_ned) - line.speed
        rigid = F_1 + v["k_v"] * stretch + v["c_v"] * stretch_rate
        elastic = line.stiffness * stretch / line.length + line.damping * stretch_rate
        T = select(line.stiffness, elastic, rigid)
        return maximum(T, 0.0 * T)

    def _force(self, at: Instant, v: Mapping[str, Scalar], line: Line, T: Scalar) -> Load:
        V_a = at.V_a
        F_tD = at.wind.density * v["d_t"] * line.drag_coefficient * line.length * V_a * V_a / 8
        share = F_tD / select(T * STEEPEST - F_tD, T, F_tD / STEEPEST + LEAST)
        sin_t, cos_t = -share, sqrt(1 - share * share)
        x, y, z = rotate_back(at.R, scale(-T, at.p_hat))
        left = maximum(F_tD - T * STEEPEST, 0.0 * T)
        sideways = line.lateral_drag * F_tD + (1 - line.lateral_drag) * left
        d_x, d_y, d_z = scale(-1 / V_a, at.air_velocity)
        force = (cos_t * x + sin_t * z + left * d_x, y + sideways * d_y, cos_t * z - sin_t * x + left * d_z)
        return Load(force, cross(line.attachment, force))
