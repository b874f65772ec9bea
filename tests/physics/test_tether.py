"""The tether: no net pull along a taut line, range follows the winch, never pushes, energy closes; trim and symmetry of the whole kite."""

import numpy as np
import pytest
from kites import DEVELOPMENT, at_point, declared, inputs_of_one_for
from oracles import body_to_ned, order_of
from scipy.optimize import root

from awescli.notation.quantities import STATES
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Segments, Simulator, inputs_of, setpoints_of

LAWS = ("thesis", "exact")


def with_law(law, **values) -> Kite:
    return Kite(declared(tether={"law": law}, **values))


def at_rest(kite: Kite, **changes):
    """(x, u, c) with the spring unstretched and the winch running as fast as the kite recedes."""
    x, u, c = at_point(kite, **changes)
    position, v_ned = np.array(x[:3]), body_to_ned(*x[6:9]) @ x[3:6]
    distance = np.linalg.norm(position)
    u[kite.input_names.index("tether_length")] = distance - kite.parameters["dl"].value
    u[kite.input_names.index("reel_out_speed")] = float(position @ v_ned / distance)
    return x, u, c


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", range(5))
def test_a_taut_line_leaves_no_pull_along_itself(law, seed):
    """Guards the sign of eq. 2, which as printed doubles the pull: with the spring at rest nothing accelerates along the line.

    thesis law: no acceleration of the body-frame velocity along the line; exact law: the second derivative of the range itself is the
    winch's acceleration (0.3 m/s2 here: 15 N of a 50 kg kite). The line's drag is off (it tilts the force away from the line).
    """
    random = np.random.default_rng(seed)
    kite = with_law(law, CtD=0.0)
    x, u, c = at_rest(kite, p=float(random.normal(0, 0.3)), q=float(random.normal(0, 0.3)), r=float(random.normal(0, 0.6)),
                      phi=float(random.uniform(-0.8, 0.8)), v=float(random.normal(0, 3)))  # fmt: skip
    at = kite.instant(x, u, c)
    assert at.tension > 100  # the line is taut: the case is not empty
    R, p_hat = body_to_ned(*x[6:9]), np.array(x[:3]) / at.distance
    velocity, omega, rate = np.array(x[3:6]), np.array(x[9:12]), np.array(at.derivative[3:6])
    if law == "thesis":
        along = p_hat @ R @ rate
    else:
        v_ned = R @ velocity
        along = p_hat @ R @ (rate + np.cross(omega, velocity)) + (v_ned @ v_ned - (p_hat @ v_ned) ** 2) / at.distance - 0.3
    assert abs(along) < 1e-11 * at.tension / 50


@pytest.mark.parametrize("law", LAWS)
def test_the_spring_and_the_damper_pull_back(law):
    """Guards the signs of stretch and damping: a longer range and a slower winch raise the tension by k_v and c_v."""
    kite = with_law(law)
    x, u, c = at_rest(kite)
    T = kite.instant(x, u, c).tension
    length, speed = kite.input_names.index("tether_length"), kite.input_names.index("reel_out_speed")
    shorter, slower = list(u), list(u)
    shorter[length] -= 0.01
    slower[speed] -= 0.1
    assert kite.instant(x, shorter, c).tension - T == pytest.approx(8000 * 0.01)
    assert kite.instant(x, slower, c).tension - T == pytest.approx(900 * 0.1)


def test_the_line_pulls_towards_the_winch():
    """Guards -T phat: without drag the load on the kite is exactly the tension, along the line, and its moment is r_t x f_t."""
    kite, free = with_law("thesis", CtD=0.0), Kite(declared(CtD=0.0).model_copy(update={"effects": ("gravity", "aerodynamics")}))
    x, u, c = at_rest(kite)
    with_line, without = kite.instant(x, u, c), free.instant(x, inputs_of_one_for(free, kite, u), c)
    force = np.subtract(with_line.applied.force, without.applied.force)
    assert body_to_ned(*x[6:9]) @ force == pytest.approx(-with_line.tension * np.array(with_line.p_hat), rel=1e-9)
    arm = [kite.parameters[n].value for n in ("rtx", "rty", "rtz")]
    moment = np.subtract(with_line.applied.moment, without.applied.moment)
    assert moment == pytest.approx(np.cross(arm, force), rel=1e-9, abs=1e-6)


def test_drag_tilts_the_force_and_keeps_its_size():
    """Guards eq. 6: |f_t| = T, tilted about body y by arcsin(F_tD / T), and against the flow."""
    kite, straight = with_law("thesis"), with_law("thesis", CtD=0.0)
    x, u, c = at_rest(kite)
    untied = Kite(DEVELOPMENT.model_copy(update={"effects": ("gravity", "aerodynamics")}))
    free = untied.instant(x, inputs_of_one_for(untied, kite, u), c)
    at = kite.instant(x, u, c)
    tilted = np.subtract(at.applied.force, free.applied.force)
    drag = 1.22 * 0.004 * 1.04 * at.line.length * at.V_a**2 / 8
    plain = np.subtract(straight.instant(x, u, straight.parameters.vector()).applied.force, free.applied.force)
    assert np.linalg.norm(tilted) == pytest.approx(at.tension) and tilted[1] == pytest.approx(plain[1])
    angle = np.arctan2(tilted[2], tilted[0]) - np.arctan2(plain[2], plain[0])
    assert np.sin(angle) == pytest.approx(drag / at.tension, rel=1e-9) or np.sin(angle) == pytest.approx(-drag / at.tension, rel=1e-9)
    assert tilted[0] < plain[0]  # drag holds back


def test_a_slack_line_only_drags():
    """Guards T >= 0 and the guard of the tilt: 20 m of slack, and the kite is an untethered aircraft with the line's drag against its
    flow, whether or not the lateral part is switched on; without drag it is one to rounding."""
    for lateral in (0.0, 1.0):
        for CtD in (1.04, 0.0):
            kite = Kite(declared(CtD=CtD), extra=("tether_drag",)).with_values({"tether_drag.lateral": lateral})
            free = Kite(DEVELOPMENT.model_copy(update={"effects": ("gravity", "aerodynamics")}))
            x, u, c = at_point(kite)
            u[kite.input_names.index("tether_length")] += 20.0
            at = kite.instant(x, u, c)
            aircraft = free.instant(x, inputs_of_one_for(free, kite, u), free.parameters.vector().tolist())
            assert at.tension == 0.0
            force = np.subtract(at.applied.force, aircraft.applied.force)
            drag = 1.22 * 0.004 * CtD * at.line.length * at.V_a**2 / 8
            assert force == pytest.approx(-drag * np.array(at.air_velocity) / at.V_a, rel=1e-9, abs=1e-9)
            arm = [kite.parameters[n].value for n in ("rtx", "rty", "rtz")]
            moment = np.subtract(at.applied.moment, aircraft.applied.moment)
            assert moment == pytest.approx(np.cross(arm, force), rel=1e-9, abs=1e-9)


def test_the_drag_does_not_jump_where_a_line_goes_slack():
    """Guards the way from the tilt of a taut line to the drag of a slack one: in steps of 1 N of tension from 0 past the drag, the force on
    the kite changes by a few N at most, and is finite with no drag and no tension at all."""
    kite = Kite(declared(tether={"law": "thesis", "tension": "measured"}))
    forces = np.array([kite.instant(*at_point(kite, tension=float(T))).applied.force for T in range(0, 700)])
    at = kite.instant(*at_point(kite))
    drag = 1.22 * 0.004 * 1.04 * at.line.length * at.V_a**2 / 8
    assert 200 < drag < 600
    assert np.abs(np.diff(forces, axis=0)).max() < 8.0
    bare = Kite(declared(CtD=0.0, tether={"law": "thesis", "tension": "measured"}))
    assert np.isfinite(bare.instant(*at_point(bare, tension=0.0)).applied.force).all()


def test_a_measured_tension_is_taken_as_it_is():
    """Guards `tension: measured`: the load cell's value is the force, whatever the constraint says."""
    kite = Kite(declared(tether={"law": "thesis", "tension": "measured"}))
    at = kite.instant(*at_point(kite, tension=1234.0))
    assert at.tension == 1234.0


# --- over time ---


def held(segments: Segments, times: int) -> Segments:
    """The same segments at a finer clock, set-points held over `times` samples, inputs linear between."""
    fine = np.arange(segments.steps * times + 1) / times
    old = np.minimum(fine.astype(int), segments.steps - 1)
    share = (fine - old)[None, :, None]
    inputs = segments.inputs[:, old] * (1 - share) + segments.inputs[:, old + 1] * share
    setpoints = segments.setpoints[:, np.minimum(np.floor(fine + 1e-9).astype(int), segments.steps)]
    return Segments(segments.first, segments.starts, setpoints, inputs, segments.dt / times, segments.values)


def replay(calm, kite: Kite, seconds: float, first=(200, 700)) -> Segments:
    """Parts of the calm flight as segments, from its true states."""
    log = calm.log
    rows = np.array(first)[:, None] + np.arange(int(round(seconds / log.dt)) + 1)
    starts = np.stack([log[n] for n in STATES], axis=1)[list(first)]
    return Segments(np.array(first), starts, setpoints_of(log)[rows], inputs_of(log, kite)[rows], log.dt)


def test_range_follows_the_winch(calm):
    """Guards the constraint over time: in taut loops the range is l_t + dl within 5 cm (k_v 8000 N/m, c_v 900 N s/m)."""
    log = calm.log
    distance = np.sqrt(log["p_n"] ** 2 + log["p_e"] ** 2 + log["p_d"] ** 2)
    away = distance - log["tether_length"] - DEVELOPMENT.parameters["dl"].value
    assert log["tension"].min() > 0 and np.abs(away[100:]).max() < 0.05 and np.ptp(log["tether_length"]) > 20


def test_tension_is_never_negative(calm, kite):
    """Guards T >= 0 through a whole rollout that starts with 3 m of slack and falls into the line."""
    segments = replay(calm, kite, 5.0)
    inputs = segments.inputs.copy()
    inputs[:, :, kite.input_names.index("tether_length")] += 3.0
    flown = Simulator(kite, ()).rollout(Segments(segments.first, segments.starts, segments.setpoints, inputs, segments.dt))
    assert not flown.diverged.any() and flown["tension"].min() == 0.0 and flown["tension"].max() > 500


@pytest.mark.parametrize("law", LAWS)
def test_energy_closes_over_a_loop(calm, law):
    """Guards every load and the equations of motion together: over a loop of 9 s the change of kinetic and potential energy is the work
    of the aerodynamic force and moment and of the tether, to 1e-6 of what was turned over (quadrature and integrator: 3e-8)."""
    declaration = calm.flown.model_copy(update={"tether": declared(tether={"law": law}).tether})
    kite = Kite(declaration, calm.log.wind.height)
    aloft = Kite(declaration.model_copy(update={"effects": ("aerodynamics",)}), calm.log.wind.height)
    fine = held(replay(calm, kite, 9.0, first=(200,)), 8)
    states = Simulator(kite, ()).rollout(fine).states[0]
    c = [float(v) for v in kite.parameters.vector()]

    def powers(setpoints):
        x = [*states[:, :12].T, *setpoints.T]
        u = list(fine.inputs[0].T)
        with np.errstate(all="ignore"):
            whole, air = kite.instant(x, u, c), aloft.instant(x, inputs_of_one_for(aloft, kite, u), c)
        v, omega, m, g = np.array(x[3:6]), np.array(x[9:12]), kite.parameters["m"].value, kite.parameters["g"].value
        weight = m * g * np.array(whole.R[2])
        tether = np.array(whole.applied.force) - np.array(air.applied.force) - weight
        moment = np.array(whole.applied.moment) - np.array(air.applied.moment)
        return np.sum(air.applied.force * v + air.applied.moment * omega, axis=0), np.sum(tether * v + moment * omega, axis=0)

    # set-points jump at samples: the end of each hold is evaluated with the set-points before the jump
    before = fine.setpoints[0].copy()
    before[8::8] = fine.setpoints[0][7:-1:8]
    right, left = np.array(powers(fine.setpoints[0])), np.array(powers(before))
    work = np.zeros(2)
    simpson = np.array([1, 4, 2, 4, 2, 4, 2, 4, 1]) * fine.dt / 3
    for k in range(0, len(states) - 1, 8):
        values = right[:, k : k + 9].copy()
        values[:, 8] = left[:, k + 8]
        work += values @ simpson
    v, omega, p = states[:, 3:6], states[:, 9:12], kite.parameters
    Jx, Jy, Jz, Jxz, m, g = (p[n].value for n in ("Jx", "Jy", "Jz", "Jxz", "m", "g"))
    J = np.array([[Jx, 0, -Jxz], [0, Jy, 0], [-Jxz, 0, Jz]])
    energy = 0.5 * m * (v * v).sum(1) + 0.5 * np.einsum("ki,ij,kj->k", omega, J, omega) - m * g * states[:, 2]
    turned_over = np.ptp(energy) + np.abs(work).sum()
    assert abs(energy[-1] - energy[0] - work.sum()) < 1e-6 * turned_over
    # the wind feeds the kite, the line takes from it: power goes out at the winch
    assert work[0] > 0 > work[1]


def test_the_integrator_converges_with_order_four(calm):
    """Guards RK4 in the kernel (weights, stages, inputs at half steps): halving the step divides the error by 16.

    In a smooth wind (a table has kinks at its stations) and on a moderate spring, away from slack.
    """
    kite = Kite(declared(wind={"law": "power", "exponent": 0.12}), (10.0,))
    flight = replay(calm, Kite(DEVELOPMENT, calm.log.wind.height), 2.0)
    u = np.zeros((2, flight.steps + 1, len(kite.input_names)))
    old = Kite(DEVELOPMENT, calm.log.wind.height)
    for i, name in enumerate(kite.input_names):
        u[:, :, i] = flight.inputs[:, :, old.input_names.index(name)]
    segments = Segments(flight.first, flight.starts, flight.setpoints, u, flight.dt)
    ends = [Simulator(kite, (), step=0.02 / n).rollout(segments).states[:, :, :12] for n in (1, 2, 4, 8, 64)]
    order = order_of([np.abs(e - ends[-1]).max() for e in ends[:-1]])
    assert ((3.5 < order) & (order < 4.6)).all(), order


def test_halving_the_step_hardly_changes_a_rollout_of_five_seconds(calm, kite):
    """Guards the step of 20 ms as good enough: positions within 0.1 mm, velocities 0.2 mm/s, angles and rates 1e-4, far below noise."""
    segments = replay(calm, kite, 5.0)
    one, two = (Simulator(kite, (), step=0.02 / n).rollout(segments).states[:, :, :12] for n in (1, 2))
    change = np.abs(one - two).max(axis=(0, 1))
    assert change[:3].max() < 1e-4 and change[3:6].max() < 2e-4 and change[6:].max() < 1e-4, change


# --- the whole aircraft ---


def gliding(kite: Kite):
    """(x, u, c) of steady symmetric flight on a slack line in calm air: u, w, theta from the three equations of the plane of symmetry."""
    calm_air = {"wind_speed_0": 0.0, "p_n": 100.0, "p_e": 0.0, "p_d": -300.0, "v": 0.0, "phi": 0.0, "psi": 0.0, "p": 0.0, "q": 0.0,
                "r": 0.0, "aileron": 0.0, "rudder": 0.0, "elevator": 0.08}  # fmt: skip

    def at(unknown):
        u, w, theta = (float(v) for v in unknown)
        point = at_point(kite, **calm_air, u=u, w=w, theta=theta)
        point[1][kite.input_names.index("tether_length")] = 2000.0
        point[1][kite.input_names.index("reel_out_speed")] = 0.0
        return point

    def rates(unknown):
        d = kite.derivative(*at(unknown))
        return [d[3], d[5], d[10]]

    solution = root(rates, [20.0, 1.5, -0.05], tol=1e-14)
    assert np.abs(rates(solution.x)).max() < 1e-10
    return at(solution.x)


def test_a_trimmed_aircraft_stays_trimmed():
    """Guards the balance of forces and moments: a steady glide found by a root search is flown on for 5 s, unchanged to 1e-6."""
    kite = Kite(declared(wind={"law": "uniform"}, CtD=0.0))  # 2 km of slack line would drag
    x, u, c = gliding(kite)
    assert 15 < x[3] < 40 and np.abs(np.array(kite.derivative(x, u, c))[3:]).max() < 1e-9
    K = 250
    segments = Segments(np.zeros(1, int), np.array([x[:12]]), np.repeat([[x[12:]]], K + 1, 1), np.repeat([[u]], K + 1, 1), 0.02)
    states = Simulator(kite, ()).rollout(segments).states[0]
    assert np.abs(states[:, 3:12] - states[0, 3:12]).max() < 1e-6
    slope = np.diff(states[:, :3], axis=0)
    assert np.abs(slope - slope[0]).max() < 1e-6


def test_a_symmetric_kite_in_symmetric_flow_feels_no_side_force():
    """Guards lateral terms: no sideslip, no roll or yaw, line and wind in the plane of symmetry: exactly no lateral acceleration."""
    kite = Kite(DEVELOPMENT)
    symmetric = {"p_e": 0.0, "v": 0.0, "phi": 0.0, "psi": 0.0, "p": 0.0, "r": 0.0, "aileron": 0.0, "rudder": 0.0, "wind_direction_0": 0.0}
    at = kite.instant(*at_point(kite, **symmetric, u=25.0, w=2.0))
    lateral = [at.derivative[STATES.index(n)] for n in ("p_e", "v", "phi", "psi", "p", "r")]
    assert lateral == [0.0] * 6 and at.beta == 0.0 and at.tension > 0


def test_a_mirrored_flight_is_the_mirrored_flight():
    """Guards every sign of the lateral motion at once: mirror state, wind and surfaces about the vertical plane, and all rates mirror."""
    kite = Kite(DEVELOPMENT)
    x, u, c = at_point(kite)
    odd = {"p_e", "v", "phi", "psi", "p", "r", "aileron", "rudder"}
    sign = np.array([-1.0 if n in odd else 1.0 for n in kite.x_names])
    mirrored = list(u)
    mirrored[kite.input_names.index("wind_direction_0")] *= -1
    there, here = kite.derivative((sign * x).tolist(), mirrored, c), kite.derivative(x, u, c)
    assert there == pytest.approx(sign[:12] * here, rel=1e-11, abs=1e-11)
