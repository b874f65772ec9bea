"""The rigid body against Euler's equation with the full matrix, and against what it must conserve."""

from types import SimpleNamespace

import numpy as np
import pytest
from oracles import body_to_ned, euler_rates, inertia, order_of, runge_kutta

from awescli.notation.frames import rotation_body_to_ned
from awescli.notation.quantities import STATES
from awescli.physics.instant import Body, Load
from awescli.physics.rigid_body import acceleration, gammas, state_derivative

NOTHING = Load((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def body(seed=0, added=0.0) -> Body:
    """A body whose inertia is that of some mass distribution: the largest principal moment is below the sum of the others."""
    random = np.random.default_rng(seed)
    while True:
        Jx, Jy, Jz = random.uniform(5, 100, 3)
        Jxz = random.uniform(-0.4, 0.4) * np.sqrt(Jx * Jz)
        a, b, c = np.linalg.eigvalsh(inertia(Jx, Jy, Jz, Jxz))
        if a > 1.0 and a + b > c:
            return Body(random.uniform(5, 60), added, Jx, Jy, Jz, Jxz, (0.0, 0.0, 0.0))


def derivative(x, b: Body, load: Load = NOTHING) -> np.ndarray:
    z = SimpleNamespace(**dict(zip(STATES, x, strict=True)))
    a = acceleration(b, load, (0.0, 0.0, 1.0))
    return np.array(state_derivative(z, rotation_body_to_ned(z.phi, z.theta, z.psi), b, a, load.moment))


@pytest.mark.parametrize("seed", range(50))
def test_rates_obey_eulers_equation(seed):
    """Guards all eight Gammas: J omega_dot + omega x J omega = M to 1e-12 for random inertias, rates and moments."""
    random, b = np.random.default_rng(seed), body(seed)
    J, omega, M = inertia(b.Jx, b.Jy, b.Jz, b.Jxz), random.standard_normal(3), 100 * random.standard_normal(3)
    x = np.concatenate([random.standard_normal(3), 30 * random.standard_normal(3), [0.3, -0.2, 1.0], omega])
    rates = derivative(x, b, Load((0.0, 0.0, 0.0), tuple(M)))[9:]
    assert J @ rates + np.cross(omega, J @ omega) == pytest.approx(M, rel=1e-12, abs=1e-12 * np.abs(M).max())
    assert rates == pytest.approx(euler_rates(J, omega, M), rel=1e-11)


def test_gammas_of_a_body_without_a_product_of_inertia():
    """Guards the printed numbering of the Gammas: with Jxz = 0 they are the textbook quotients."""
    assert gammas(2.0, 3.0, 5.0, 0.0) == pytest.approx((0, (5 - 3) / 2, 1 / 2, 0, (5 - 2) / 3, 0, (2 - 3) / 5, 1 / 5))


@pytest.mark.parametrize("seed", range(10))
def test_velocity_obeys_newton_in_the_inertial_frame(seed):
    """Guards the sign of omega x v: R (v_dot + omega x v) = F / m, and p_dot = R v."""
    random, b = np.random.default_rng(seed), body(seed)
    x = np.concatenate(
        [100 * random.standard_normal(3), 30 * random.standard_normal(3), random.uniform(-1, 1, 3), random.standard_normal(3)]
    )
    F = 500 * random.standard_normal(3)
    d = derivative(x, b, Load(tuple(F), (0.0, 0.0, 0.0)))
    R = body_to_ned(*x[6:9])
    assert d[3:6] + np.cross(x[9:], x[3:6]) == pytest.approx(F / b.mass, abs=1e-11)
    assert d[:3] == pytest.approx(R @ x[3:6], abs=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_euler_angles_turn_as_the_rotation_does(seed):
    """Guards the Euler kinematics: dR/dt = R [omega]x, by complex step through the angles."""
    random = np.random.default_rng(seed)
    x = np.concatenate([np.zeros(6), random.uniform(-1.2, 1.2, 3), random.standard_normal(3)])
    rates = derivative(x, body(seed))[6:9]
    turned = np.imag(np.array(rotation_body_to_ned(*(x[6:9] + 1e-200j * rates)))) / 1e-200
    p, q, r = x[9:]
    assert turned == pytest.approx(body_to_ned(*x[6:9]) @ np.array([[0, -r, q], [r, 0, -p], [-q, p, 0]]), abs=1e-13)


def test_added_mass_acts_on_body_z_only():
    """Guards against apparent mass that leaks into u, v or the rates."""
    x, load = np.concatenate([np.zeros(3), [30, 1, 4, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]]), Load((10.0, 20.0, 300.0), (1.0, 2.0, 3.0))
    with_air, without = derivative(x, body(1, 3.0), load), derivative(x, body(1), load)
    m = body(1).mass
    assert np.flatnonzero(with_air != without).tolist() == [5]
    assert with_air[5] - without[5] == pytest.approx(300 / (m + 3) - 300 / m)


@pytest.mark.parametrize("seed", range(10))
def test_mass_that_moves_across_the_line_only(seed):
    """Guards the closed form of the mass matrix (m 1 + m_z e_z e_z' + m_l (1 - n n')): it solves M a = f, for any line and air mass."""
    random, b = np.random.default_rng(seed), body(seed, added=3.0)
    n = random.standard_normal(3)
    n /= np.linalg.norm(n)
    f, m_l = 500 * random.standard_normal(3), float(random.uniform(0.1, 20))
    M = b.mass * np.eye(3) + np.diag([0, 0, 3.0]) + m_l * (np.eye(3) - np.outer(n, n))
    assert acceleration(b, Load(tuple(f), (0.0,) * 3, m_l), tuple(n)) == pytest.approx(np.linalg.solve(M, f), rel=1e-12)
    light = b._replace(added_z=0.0)
    along = acceleration(light, Load(tuple(100 * n), (0.0,) * 3, m_l), tuple(n))
    assert along == pytest.approx(100 * n / b.mass, rel=1e-12)  # nothing of it resists along the line


def energy_and_momentum(x, b: Body):
    J, R = inertia(b.Jx, b.Jy, b.Jz, b.Jxz), body_to_ned(*x[6:9])
    return 0.5 * b.mass * x[3:6] @ x[3:6] + 0.5 * x[9:] @ J @ x[9:], R @ J @ x[9:], b.mass * R @ x[3:6]


def test_a_body_without_loads_conserves_energy_and_momenta():
    """Guards the whole set of equations at once: nothing acts, so energy, angular and linear momentum (inertial) stay."""
    b = body(3)
    x = np.array([0, 0, -100, 20.0, 3.0, -2.0, 0.2, 0.1, -0.5, 0.5, 0.4, -0.6])
    path = runge_kutta(lambda z: derivative(z, b), x, 0.005, 400)
    before, after = energy_and_momentum(path[0], b), energy_and_momentum(path[-1], b)
    for was, is_ in zip(before, after, strict=True):
        # RK4's error after 2 s at this step, measured at 2e-11
        assert is_ == pytest.approx(was, rel=1e-9, abs=1e-9 * np.linalg.norm(was))


def test_free_tumbling_converges_with_order_four():
    """Guards against a kink or an inconsistency in the equations that would cost the integrator its order."""
    b = body(3)
    x = np.array([0, 0, -100, 20.0, 3.0, -2.0, 0.2, 0.1, -0.5, 0.5, 0.4, -0.6])
    ends = [runge_kutta(lambda z: derivative(z, b), x, 1.0 / n, n)[-1] for n in (10, 20, 40, 320)]
    order = order_of([np.abs(end - ends[-1])[3:].max() for end in ends[:-1]])
    assert ((3.7 < order) & (order < 4.6)).all(), order


def test_complex_step_is_the_derivative():
    """Guards differentiability of the rigid body: complex step against central differences, every column."""
    b, h = body(5), 1e-6
    x = np.array([10.0, 20.0, -100, 30.0, 3.0, -2.0, 0.2, 0.1, -0.5, 0.5, 0.4, -0.6])
    load = Load((10.0, 20.0, 300.0), (1.0, 2.0, 3.0))
    for i in range(12):
        e = np.eye(12)[i]
        exact = np.imag(derivative(x + 1e-200j * e, b, load)) / 1e-200
        central = (derivative(x + h * e, b, load) - derivative(x - h * e, b, load)) / (2 * h)
        assert exact == pytest.approx(central, abs=1e-7)
