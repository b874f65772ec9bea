"""Sensitivities through switches: a bouncing ball and a switched oscillator against their closed forms, phases that are alike to the last
bit, and a pumping cycle against differences."""

import numpy as np
import pytest
from kites import flight

from awescli.engine.machine import compile_program
from awescli.notation.quantities import OUTPUTS
from awescli.physics.kite import Kite
from awescli.simulation import groups, rollout
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import observe
from awescli.simulation.stepping import Stepping
from awescli.simulation.switched_sensitivities import Columns, Programs, sensitivities_through
from awescli.simulation.switching import Guard, Phase, fly_switched

H = 0.02


def toy(rates, c, start, guards, seconds, resets=None, columns=None):
    """(flight, sensitivities or None) of two states x, v of the twelve that a loop steps; rates: (x, v, c) -> (dx/dt, dv/dt); c: (phases,
    n_c); guards: of each phase."""

    def derivative(x, u, c):
        return [*rates(x[0], x[1], c), *(0.0 * x[0] for _ in range(10))]

    count = c.shape[1]
    sizes, wrt = (12, 1, count), range(count)
    f = compile_program(derivative, *sizes, linearised=False)
    g = compile_program(lambda x, u, c: [*derivative(x, u, c), x[0] * x[1]], *sizes, wrt, rows=range(13), rates=12)
    initial = compile_program(lambda x, u, c: [x[0]], *sizes, wrt)
    samples = int(round(seconds / H)) + 1
    made = [Phase(str(i), 0, row, guards[i], (resets or [None] * len(c))[i]) for i, row in enumerate(c)]
    how = 12, np.array([*start, *np.zeros(10)]), np.zeros((samples, 0)), np.zeros((samples, 1)), H, Stepping(1), 1
    read = lambda X, Y, U: {"height": X[:, 0], "product": Y[:, 0]}  # noqa: E731
    flown = fly_switched(f.value, g.value, initial.value, made, *how, read, at_guards=True)
    if columns is None:
        return flown, None
    return flown, sensitivities_through(flown, made, Programs(f, g, initial, [None] * len(c), (0,)), *how, read, columns)


def ball(z, v, gravity, left, ground, t):
    """(height, speed, times of the impacts) at t of a ball that keeps a share `left` of its speed: parabolas between roots."""
    begun, w, height, times = 0.0, v, z, []
    while True:
        root = (w + np.sqrt(w * w + 2 * gravity * (height - ground))) / gravity
        if (begun + root).real > t:
            since = t - begun
            return height + w * since - gravity / 2 * since * since, w - gravity * since, times
        begun, w, height = begun + root, -left * (w - gravity * root), ground
        times.append(begun)


def complex_step(function, values, i):
    """Derivative of what a function of several numbers gives back, with respect to number i."""
    return np.imag(function(*(v + 1e-30j * (j == i) for j, v in enumerate(values)))) / 1e-30


def test_a_ball_bounces_at_the_ground_and_its_sensitivities_are_those_of_parabolas():
    """Guards resets and saltation: height, speed, product and impact times of a ball, and their derivatives with respect to height and
    speed at the start, gravity and the height of the ground, at times before and behind four impacts; the closed form, complex-stepped."""
    gravity, left = 9.81, 0.77

    def turned(x):
        return np.array([x[0], -left * x[1], *x[2:]])

    columns = Columns(np.array([0, 1, -1, -1]), np.array([[1, 1, 0, 1]]), {(0, 0): 3})
    flown, J = toy(lambda x, v, c: (v, -c[0] + 0.0 * v), np.array([[gravity]]), (3.0, 0.4), [[Guard("height", 0.1, False)]], 4.0,
                   [turned], columns)  # fmt: skip
    assert len(flown.switches) == 4 and flown.alive == 201
    impacts = ball(3.0, 0.4, gravity, left, 0.1, 4.0)[2]
    assert [s.time for s in flown.switches] == pytest.approx(impacts, abs=1e-10)
    whole, order = (3.0, 0.4, gravity, left, 0.1), (0, 1, 2, 4)
    for k in (20, 50, 75, 100, 160, 195):
        z, v, _ = ball(*whole, k * H)
        assert flown.states[k, :2] == pytest.approx((z, v), abs=1e-9)
        for column, i in enumerate(order):
            dz, dv = (complex_step(lambda *a, k=k, w=w: ball(*a, k * H)[w], whole, i) for w in (0, 1))
            assert J.states[k, :2, column] == pytest.approx((dz, dv), rel=1e-7, abs=1e-7), (k, column)
            assert J.outputs[k, 0, column] == pytest.approx(dz * v + z * dv, rel=1e-7, abs=1e-6)
    for column, i in enumerate(order):
        moved = [complex_step(lambda *a, n=n: ball(*a, 4.0)[2][n], whole, i) for n in range(4)]
        assert J.times[:, column] == pytest.approx(moved, rel=1e-7), column


def oscillator(x, v, slow, fast, limit, wait, t):
    """(x, v, times of the switches) at t: `slow` until x has come to `limit` from above, then `fast` for `wait` seconds, and so on."""
    begun, w, times = 0.0, slow, []
    while True:
        if w is slow:
            # x = A cos(w s - phi): the first s > 0 at which it comes down through the limit
            A, phi = np.sqrt(x * x + v * v / w / w), np.arctan(v / w / x) if x.real > 0 else np.arctan(v / w / x) + np.pi
            last = (np.arccos(limit / A) + phi) / w
            while last.real < 1e-9:
                last = last + 2 * np.pi / w
        else:
            last = wait
        s = last if (begun + last).real <= t else t - begun
        x, v = x * np.cos(w * s) + v / w * np.sin(w * s), v * np.cos(w * s) - w * x * np.sin(w * s)
        if (begun + last).real > t:
            return x, v, times
        begun, w = begun + last, fast if w is slow else slow
        times.append(begun)


def test_an_oscillator_of_two_frequencies_has_the_sensitivities_of_its_closed_form():
    """Guards parameters of one phase alone, guards on the state and on the time in a phase, which begins at a guard: both frequencies, the
    limit, the time and the start, complex-stepped; to what a step of 20 ms leaves of 5 rad/s."""
    c = np.array([[2.0], [5.0]])
    guards = [[Guard("height", 0.2, False)], [Guard("time_in_phase", 1.0, True)]]
    columns = Columns(np.array([0, 1, -1, -1, -1, -1]), np.array([[1, 1, 0, 1, 1, 1], [1, 1, 1, 0, 1, 1]]), {(0, 0): 4, (1, 0): 5})
    flown, J = toy(lambda x, v, c: (v, -c[0] * c[0] * x), c, (1.0, 0.3), guards, 5.0, columns=columns)
    values = (1.0, 0.3, 2.0, 5.0, 0.2, 1.0)
    times = oscillator(*values, 5.0)[2]
    assert [s.into for s in flown.switches] == [1, 0] * (len(times) // 2) + [1] * (len(times) % 2) and len(times) >= 4
    assert [s.time for s in flown.switches] == pytest.approx(times, abs=2e-5)
    for k in (20, 60, 110, 150, 200, 245):
        x, v, _ = oscillator(*values, k * H)
        assert flown.states[k, :2] == pytest.approx((x, v), abs=1e-4), k
        for column in range(6):
            exact = [complex_step(lambda *a, k=k, w=w: oscillator(*a, k * H)[w], values, column) for w in (0, 1)]
            assert J.states[k, :2, column] == pytest.approx(exact, rel=1e-3, abs=1e-3), (k, column)
    for column in range(6):
        moved = [complex_step(lambda *a, n=n: oscillator(*a, 5.0)[2][n], values, column) for n in range(len(times))]
        assert J.times[:, column] == pytest.approx(moved, rel=1e-3, abs=1e-4), column


def test_without_what_a_switch_adds_they_would_be_wrong():
    """Guards that saltation matters: behind an impact the derivative of the speed has grown by what the impact's time adds; with that time
    held it would be a share of what it was before, nothing."""
    columns = Columns(np.array([0]), np.array([[1]]), {})
    _, J = toy(lambda x, v, c: (v, -c[0] + 0.0 * v), np.array([[9.81]]), (3.0, 0.0), [[Guard("height", 0.0, False)]], 1.2,
               [lambda x: np.array([x[0], -0.77 * x[1], *x[2:]])], columns)  # fmt: skip
    held = -0.77 * J.states[39, 1, 0]
    assert held == pytest.approx(0.0, abs=1e-12) and J.states[40, 1, 0] == pytest.approx(1.77 * np.sqrt(9.81 / 6), rel=1e-7)


def test_phases_that_are_alike_have_the_sensitivities_of_one_to_the_last_bit():
    """Guards that a switch by itself changes nothing: states, outputs and sensitivities of the development kite with effects' states and a
    law in the loop, switched at a height and after a time between two phases that are the same, against one rollout."""
    made = flight(seed=1, duration=40.0, effects=(("actuator_lag:rudder", (("tau", 0.1),)), ("winch_tracking", (("tau", 0.4),))))
    kite = Kite(made.flown, made.log.wind.height)
    names, asked = ("CLa", "Cnb", "winch_tracking.tau"), ("p_d", "tension")
    simulator = Simulator(kite, names, law=made.law.setpoints, step=0.01)
    segments = observe(made.log, kite, np.array([200]), 600, ("p_n",)).segments
    whole, J = simulator.sensitivities(segments, rollout.Columns(("p_n", "u"), names), asked)
    height = float(np.median(-whole.states[0, :, 2]))
    guards = [Guard("height", height, True), Guard("time_in_phase", 0.71, True)]
    alike = [Phase(name, simulator.law.value, kite.parameters.vector(), guards) for name in "ab"]
    x0, stepping = segments.starts_for(simulator.n_s)[0], simulator.stepping(segments)
    one = segments.setpoints[0], segments.inputs[0], segments.dt, stepping, len(OUTPUTS), lambda X, Y, U: {"height": -X[:, 2]}
    how = simulator.n_s, x0, *one
    switched = fly_switched(simulator.f.value, simulator.g.value, simulator.initial.value, alike, *how, at_guards=True)
    assert len(switched.switches) >= 15 and any(s.guard.quantity == "height" and s.share not in (None, 1.0) for s in switched.switches)
    assert np.array_equal(switched.states, whole.states[0]) and np.array_equal(switched.outputs, whole.outputs[0])
    rows = tuple(OUTPUTS.index(name) for name in asked)
    programs = Programs(simulator.f, simulator.differentiating(asked), simulator.initial, [simulator.law] * 2, rows)
    state = np.array([kite.x_names.index("p_n"), kite.x_names.index("u"), -1, -1, -1])
    columns = Columns(state, np.tile([3, 3, 0, 1, 2], (2, 1)), {})
    through = sensitivities_through(switched, alike, programs, *how, columns)
    assert np.array_equal(through.outputs, J[0])
    # but the times of the switches do move
    assert np.abs(through.times).min(axis=1).max() > 0


def test_columns_do_not_depend_on_the_cores_that_they_are_shared_out_to(monkeypatch):
    """Guards the limit of a guard, which is one column of all: a ball's sensitivities on one to five cores, to the last bit."""

    def turned(x):
        return np.array([x[0], -0.8 * x[1], *x[2:]])

    columns = Columns(np.array([0, 1, -1, -1]), np.array([[1, 1, 0, 1]]), {(0, 0): 3})
    found = []
    for count in (1, 2, 3, 5):
        monkeypatch.setattr(groups, "cores", lambda count=count: count)
        found.append(toy(lambda x, v, c: (v, -c[0] + 0.0 * v), np.array([[9.81]]), (2.0, 0.0), [[Guard("height", 0.1, False)]], 2.0,
                         [turned], columns)[1])  # fmt: skip
    assert np.abs(found[0].times[:, 3]).min() > 0 and len(found[0].times) > 1
    for J in found[1:]:
        assert all(np.array_equal(getattr(J, what), getattr(found[0], what)) for what in ("outputs", "states", "times"))


def test_set_points_that_move_within_a_sample_end_no_phase_there():
    """Guards the limits of it: a slow log's set-points would have to be asked for again at the guard."""
    with pytest.raises(ValueError, match="held from sample to sample"):
        how = 12, np.zeros(12), np.zeros((1, 0)), np.zeros((1, 1)), H, Stepping(2, 0.0, 0.5), 1, dict
        fly_switched(0, 0, 0, [], *how, at_guards=True)
