"""The mass of the line: a straight rod that turns about the winch with the kite at its end, against the mechanics of rods."""

import numpy as np
import pytest
from kites import DEVELOPMENT, at_point, declared, lively
from scipy.integrate import solve_ivp

from awescli.notation.quantities import OUTPUTS, SURFACES
from awescli.physics.effects.tether_weight import TetherWeight
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Segments, Simulator

MU, LENGTH, MASS, G = 0.05, 20.0, 1.0, 9.80665
"""A line as heavy as the body that it holds, so that every term counts."""


def rod_and_bob(mu=MU) -> Kite:
    """A body without wings or line drag on an inextensible line of mass mu per length (the exact constraint)."""
    loads = declared(
        tether={"law": "exact"}, wind={"law": "uniform"}, m=MASS, CtD=0.0, dl=0.0, rtx=0.0, rty=0.0, rtz=0.0, k_v=10.0, c_v=5.0
    )
    kite = Kite(loads.model_copy(update={"effects": ("gravity", "tether")}), extra=("tether_weight",))
    return kite.with_values({"tether_weight.mu": mu})


def swing(kite: Kite, start, length, speed, dt=0.01) -> np.ndarray:
    """(N, 12) states along a swing from `start` (12,); length, speed: (N,) of the winch."""
    steps = len(length) - 1
    u = np.zeros((1, steps + 1, len(kite.input_names)))
    u[0, :, kite.input_names.index("density")] = 1.225
    u[0, :, kite.input_names.index("tether_length")] = length
    u[0, :, kite.input_names.index("reel_out_speed")] = speed
    segments = Segments(np.zeros(1, int), np.array([start]), np.zeros((1, steps + 1, len(SURFACES))), u, dt)
    flown = Simulator(kite, ()).rollout(segments)
    assert not flown.diverged.any() and flown["tension"].min() > 0
    return flown.states[0, :, :12]


def hanging_at(angle: float, length: float = LENGTH, across: float = 0.0, along: float = 0.0, sideways: float = 0.0) -> np.ndarray:
    """(12,) at `angle` from straight down, to the north; velocities across, along the line and to the east."""
    s, c = np.sin(angle), np.cos(angle)
    velocity = across * np.array([c, 0, -s]) + along * np.array([s, 0, c]) + sideways * np.array([0, 1, 0])
    return np.concatenate([length * np.array([s, 0, c]), velocity, np.zeros(6)])


def test_small_swings_have_the_period_of_a_rod_with_a_bob():
    """Guards inertia and weight together: T = 2 pi sqrt((m l^2 + mu l^3 / 3) / ((m + mu l / 2) g l)), to 1e-6; a line that weighs and
    does not resist would swing 15 % faster."""
    amplitude, dt = 1e-3, 0.01
    still = np.full(6001, LENGTH)
    path = swing(rod_and_bob(), hanging_at(amplitude), still, 0 * still, dt)[:, 0]
    crossing = np.flatnonzero(path[:-1] * path[1:] < 0)
    # a sine between the two samples beside a zero
    at = (crossing + path[crossing] / (path[crossing] - path[crossing + 1])) * dt
    period = 2 * (at[-1] - at[0]) / (len(at) - 1)
    moment_of_inertia = MASS * LENGTH**2 + MU * LENGTH**3 / 3
    expected = 2 * np.pi * np.sqrt(moment_of_inertia / ((MASS + MU * LENGTH / 2) * G * LENGTH))
    assert period == pytest.approx(expected * (1 + amplitude**2 / 16), rel=1e-6)


def energy(states, mu, length) -> np.ndarray:
    """Kinetic energy of the body and of the line's rotation, and potential energy of both; the line's own running is left out."""
    position, velocity = states[:, :3], states[:, 3:6]  # the body does not turn: body axes are NED
    p_hat = position / np.linalg.norm(position, axis=1)[:, None]
    along = (p_hat * velocity).sum(1)
    across = (velocity**2).sum(1) - along**2
    return 0.5 * MASS * (velocity**2).sum(1) + 0.5 * mu * length / 3 * across - (MASS + mu * length / 2) * G * position[:, 2]


@pytest.mark.parametrize("mu", [0.0, MU])
def test_a_heavy_line_of_constant_length_keeps_energy(mu):
    """Guards that what resists across the line does no work: a wide swing out of the plane keeps its energy to 1e-8."""
    still = np.full(2001, LENGTH)
    states = swing(rod_and_bob(mu), hanging_at(1.2, sideways=6.0), still, 0 * still, 0.005)
    E = energy(states, mu, LENGTH)
    assert np.abs(E - E[0]).max() < 1e-8 * np.ptp(states[:, 2]) * MASS * G


def test_a_line_that_is_paid_out_swings_as_its_angular_momentum_says():
    """Guards the term with the reel-out speed: d/dt [(m l^2 + mu l^3 / 3) omega] = - (m l + mu l^2 / 2) g sin(theta), what is paid out
    having no angular momentum; an oracle of its own (scipy, one angle). Left out, the angle comes to 0.037 rad off."""
    speed, seconds, dt, angle = 2.0, 8.0, 0.005, 0.9
    time = np.arange(int(seconds / dt) + 1) * dt
    length = LENGTH + speed * time

    def rates(t, y):
        theta, momentum = y
        r = LENGTH + speed * t
        return [momentum / (MASS * r**2 + MU * r**3 / 3), -(MASS * r + MU * r**2 / 2) * G * np.sin(theta)]

    oracle = solve_ivp(rates, (0, seconds), [angle, 0.0], t_eval=time, rtol=1e-11, atol=1e-9).y[0]
    states = swing(rod_and_bob(), hanging_at(angle, along=speed), length, np.full(len(time), speed), dt)
    theta = np.arctan2(states[:, 0], states[:, 2])
    assert np.ptp(theta) > 1.0 and np.abs(theta - oracle).max() < 1e-6


def test_the_lines_inertia_reaches_a_kite():
    """Guards the way to the equations of motion: 0.022 kg/m at 300 m resist across the line like 2.2 of 50 kg, and not along it."""
    key = "tether_weight"
    kite, plain = Kite(DEVELOPMENT, extra=(key,)).with_values({f"{key}.mu": 0.022}), Kite(DEVELOPMENT)
    far = {"p_n": 235.0, "p_e": 45.0, "p_d": -181.0, "reel_out_speed": 0.0}
    at, without = kite.instant(*at_point(kite, **far)), plain.instant(*at_point(plain, **far))
    carried = 0.022 * at.line.length / 3
    assert carried == pytest.approx(2.2, rel=0.01)
    R, n = np.array(at.R), np.array(at.p_hat)
    a, f = R @ at.acceleration, R @ at.applied.force
    assert a @ n == pytest.approx(f @ n / 50)
    across = np.eye(3) - np.outer(n, n)
    assert across @ a == pytest.approx(across @ f / (50 + carried))
    # the same line, weighing and not resisting, would be turned 4 % harder
    assert np.linalg.norm(across @ (f / 50 - a)) > 0.03 * np.linalg.norm(across @ a)
    reported = dict(zip(OUTPUTS, kite.outputs(*at_point(kite, **far)), strict=True))
    assert [reported[name] for name in ("a_x", "a_y", "a_z")] == pytest.approx(at.acceleration)
    assert without.applied.mass_across == 0.0


def test_a_flight_with_a_heavy_line_differs_from_one_whose_line_only_weighs(calm, monkeypatch):
    """Guards against inertia that is declared and not flown: over 5 s it moves the kite by many standard deviations of the sensors."""
    kite = Kite(DEVELOPMENT, calm.log.wind.height, ("tether_weight",))
    observed, heavy = lively(kite, calm.log), {"tether_weight.mu": 0.022}
    inert = Simulator(kite, ()).rollout(observed.segments, heavy)
    load = TetherWeight.load
    monkeypatch.setattr(TetherWeight, "load", lambda self, at, own: load(self, at, own)._replace(mass_across=0.0))
    weighing = Simulator(kite, ()).rollout(observed.segments, heavy)
    moved = np.abs(inert.outputs - weighing.outputs)[:, :, [OUTPUTS.index(n) for n in observed.outputs]] / observed.sigma
    assert not inert.diverged.any() and moved.max(axis=(0, 1))[observed.outputs.index("p_n")] > 5
