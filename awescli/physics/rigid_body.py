"""Rigid-body motion: loads in, dz/dt out (f_k and f_dy of the seed, section 2)."""

from awescli.notation.frames import rotate
from awescli.notation.scalars import cos, sin
from awescli.physics.instant import Body, Load


def gammas(Jx, Jy, Jz, Jxz):
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


def state_derivative(z, R, body: Body, load: Load):
    """dz/dt as a 12-tuple, for a load about the centre of mass in body axes. Seed section 2, its four displayed equations."""
    u, v, w, p, q, r = z.u, z.v, z.w, z.p, z.q, z.r
    (f_x, f_y, f_z), (m_x, m_y, m_z) = load
    m = body.mass
    G1, G2, G3, G4, G5, G6, G7, G8 = gammas(body.Jx, body.Jy, body.Jz, body.Jxz)
    s_f, c_f, s_t, c_t = sin(z.phi), cos(z.phi), sin(z.theta), cos(z.theta)
    yaw_pitch_rate = q * s_f + r * c_f
    return (
        # position
        *rotate(R, (u, v, w)),
        # velocity over ground, body axes
        r * v - q * w + f_x / m,
        p * w - r * u + f_y / m,
        q * u - p * v + f_z / (m + body.added_z),
        # Euler angles
        p + yaw_pitch_rate * s_t / c_t,
        q * c_f - r * s_f,
        yaw_pitch_rate / c_t,
        # rates
        G1 * p * q - G2 * q * r + G3 * m_x + G4 * m_z,
        G5 * p * r - G6 * (p * p - r * r) + m_y / body.Jy,
        G7 * p * q - G1 * q * r + G4 * m_x + G8 * m_z,
    )
