"""Rigid-body motion: loads in, dz/dt out (docs/equations.md (1) to (5))."""

from types import SimpleNamespace

from awescli.notation.frames import Rotation, Vector, add, dot, rotate, scale
from awescli.notation.scalars import Scalar, cos, sin
from awescli.physics.instant import Body, Load


def gammas(Jx: Scalar, Jy: Scalar, Jz: Scalar, Jxz: Scalar) -> tuple[Scalar, ...]:
    """Gamma_1..8 (Beard & McLain, Small Unmanned Aircraft, eq. 3.13), for the inertia matrix with -Jxz off the diagonal."""
    G = Jx * Jz - Jxz * Jxz
    return (
        Jxz * (Jx - Jy + Jz) / G,
        (Jz * (Jz - Jy) + Jxz * Jxz) / G,
        Jz / G,
        Jxz / G,
        (Jz - Jx) / Jy,
        Jxz / Jy,
        ((Jx - Jy) * Jx + Jxz * Jxz) / G,
        Jx / G,
    )


def acceleration(body: Body, load: Load, along: Vector) -> Vector:
    """Inertial acceleration a of the centre of mass [m/s2, body axes]: (m 1 + m_z e_z e_z' + m_l (1 - n n')) a = f.

    m_z: air that moves with the wing along body z; m_l: `load.mass_across`, which moves with the kite across the line's direction n
    (`along`, body axes) only. Without m_l the matrix is diagonal; with it, it is a diagonal less one dyad (Sherman & Morrison 1950).
    """
    m, m_l, f = body.mass, load.mass_across, load.force
    if isinstance(m_l, float) and m_l == 0.0:
        return f[0] / m, f[1] / m, f[2] / (m + body.added_z)
    diagonal = (m + m_l, m + m_l, m + body.added_z + m_l)
    of_f, of_n = (tuple(x / d for x, d in zip(vector, diagonal, strict=True)) for vector in (f, along))
    return add(of_f, scale(m_l * dot(along, of_f) / (1 - m_l * dot(along, of_n)), of_n))


def force_for(body: Body, load: Load, a: Vector, along: Vector) -> Vector:
    """Force [N] that gives the inertial acceleration a [m/s2, body axes]: (m 1 + m_z e_z e_z' + m_l (1 - n n')) a, see `acceleration`."""
    m, m_l = body.mass, load.mass_across
    own = (m * a[0], m * a[1], (m + body.added_z) * a[2])
    return add(own, scale(m_l, add(a, scale(-dot(along, a), along))))


def moment_for(body: Body, rates: Vector) -> Vector:
    """J rates: moment [N m] that changes the body rates by `rates` [rad/s2] beside what they do of themselves (- J^-1 omega x J omega)."""
    x, y, z = rates
    return body.Jx * x - body.Jxz * z, body.Jy * y, body.Jz * z - body.Jxz * x


def state_derivative(z: SimpleNamespace, R: Rotation, body: Body, acceleration: Vector, moment: Vector) -> tuple[Scalar, ...]:
    """dz/dt as a 12-tuple, for the inertial acceleration of the centre of mass and the moment about it, both in body axes.
    docs/equations.md (1) to (4)."""
    u, v, w, p, q, r = z.u, z.v, z.w, z.p, z.q, z.r
    (a_x, a_y, a_z), (m_x, m_y, m_z) = acceleration, moment
    G1, G2, G3, G4, G5, G6, G7, G8 = gammas(body.Jx, body.Jy, body.Jz, body.Jxz)
    s_f, c_f, s_t, c_t = sin(z.phi), cos(z.phi), sin(z.theta), cos(z.theta)
    yaw_pitch_rate = q * s_f + r * c_f
    return (
        # position
        *rotate(R, (u, v, w)),
        # velocity over ground, body axes
        r * v - q * w + a_x,
        p * w - r * u + a_y,
        q * u - p * v + a_z,
        # Euler angles
        p + yaw_pitch_rate * s_t / c_t,
        q * c_f - r * s_f,
        yaw_pitch_rate / c_t,
        # rates
        G1 * p * q - G2 * q * r + G3 * m_x + G4 * m_z,
        G5 * p * r - G6 * (p * p - r * r) + m_y / body.Jy,
        G7 * p * q - G1 * q * r + G4 * m_x + G8 * m_z,
    )
