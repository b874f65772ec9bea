"""Switched systems against closed forms: a ball that bounces, an oscillator of two frequencies, and a kite whose phases are alike."""

import numpy as np
import pytest
from kites import flight

from awescli.engine.machine import compile_program
from awescli.notation.quantities import OUTPUTS
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Segments, Simulator
from awescli.simulation.segments import observe
from awescli.simulation.stepping import Stepping
from awescli.simulation.switching import Guard, Phase, fly_switched

H = 0.02


def toy(rates, c, start, guards, seconds, resets=None, most=None, phases=1):
    """A system of two states x, v of the twelve that a loop steps; rates: (x, v, c) -> (dx/dt, dv/dt); c: (phases, n_c)."""

    def derivative(x, u, c):
        return [*rates(x[0], x[1], c), *(0.0 * x[0] for _ in range(10))]

    sizes = (12, 1, c.shape[1])
    f, g, none = (compile_program(fn, *sizes, linearised=False).value for fn in (
        derivative, lambda x, u, c: [*derivative(x, u, c), x[0]], lambda x, u, c: [x[0]]))  # fmt: skip
    samples = int(round(seconds / H)) + 1
    made = [Phase(str(i), 0, c[i], guards[i], (resets or [None] * phases)[i]) for i in range(phases)]
    x0 = np.array([*start, *np.zeros(10)])
    return fly_switched(
        f, g, none, made, 12, x0, np.zeros((samples, 0)), np.zeros((samples, 1)), H, Stepping(1), 1,
        lambda X, Y, U: {"height": X[:, 0], "out": Y[:, 0]}, most,
    )  # fmt: skip


def test_a_ball_bounces_as_often_and_as_high_as_it_must():
    """Guards guards and resets: a ball that is put on the ground, and turned round, at the first sample below it. Closed form, impact by
    impact: the parabola's root is the time that is told, to 1e-9 s; the sample behind it is where 0.77 of the velocity is left."""
    gravity, left = 9.81, 0.77

    def turned(x):
        return np.array([0.0, -left * x[1], *x[2:]])

    fall = toy(lambda x, v, c: (v, -c[0] + 0.0 * v), np.array([[gravity]]), (3.0, 0.0), [[Guard("height", 0.0, False)]], 6.0, [turned])
    assert len(fall.switches) >= 4 and fall.alive == 301
    z, v, t = 3.0, 0.0, 0.0
    for bounce in fall.switches[:4]:
        root = (v + np.sqrt(v * v + 2 * gravity * z)) / gravity
        sample = int(np.ceil((t + root) / H - 1e-9))
        assert bounce.sample == sample and bounce.time == pytest.approx(t + root, abs=1e-9)
        late = sample * H - t
        z, v, t = 0.0, -left * (v - gravity * late), sample * H
        assert fall.states[sample, :2] == pytest.approx((z, v), abs=1e-9)


def test_an_oscillator_of_two_frequencies():
    """Guards parameters that change with the phase: 2 rad/s on one side, 5 rad/s on the other, turned from solution to solution by hand;
    guards of both directions, in turn."""
    frequencies = (2.0, 5.0)
    c = np.array(frequencies)[:, None]
    guards = [[Guard("height", 0.0, False)], [Guard("out", 0.0, True)]]
    flown = toy(lambda x, v, c: (v, -c[0] * c[0] * x), c, (1.0, 0.0), guards, 8.0, phases=2)
    x, v, phase = 1.0, 0.0, 0
    changes = {s.sample: s for s in flown.switches}
    for k in range(1, 401):
        w = frequencies[phase]
        x, v = x * np.cos(w * H) + v / w * np.sin(w * H), v * np.cos(w * H) - w * x * np.sin(w * H)
        assert flown.states[k, :2] == pytest.approx((x, v), abs=2e-5), k
        if k in changes:
            phase = 1 - phase
        assert flown.phase[k] == phase
    assert len(changes) == 7 and [s.into for s in flown.switches] == [1, 0] * 3 + [1]
    # it was at the top: a quarter of a period to the first crossing
    assert flown.switches[0].time == pytest.approx(np.pi / 4, abs=2e-6)


def test_what_ends_at_the_last_switch_says_so():
    """Guards flights of a number of cycles: the guard after the last allowed switch ends it, and is no switch."""
    fall = toy(lambda x, v, c: (v, -c[0] + 0.0 * v), np.array([[9.81]]), (3.0, 0.0), [[Guard("height", 0.0, False)]], 6.0,
               [lambda x: np.array([0.0, -x[1], *x[2:]])], most=2)  # fmt: skip
    assert fall.ended and len(fall.switches) == 2 and fall.states[fall.alive - 1, 0] <= 0 < fall.states[fall.alive - 2, 0]


def test_phases_that_are_alike_are_no_phases_to_the_last_bit():
    """Guards that switching by itself does nothing: the development kite, line and effects with states of their own, switched every 0.7 s
    between two phases that are the same, against one rollout."""
    flown = flight(seed=1, duration=40.0, effects=(("actuator_lag:rudder", (("tau", 0.1),)), ("winch_tracking", (("tau", 0.4),))))
    kite = Kite(flown.flown, flown.log.wind.height)
    simulator = Simulator(kite, (), law=flown.law.setpoints, step=0.01)
    segments: Segments = observe(flown.log, kite, np.array([200]), 900, ("p_n",)).segments
    whole = simulator.rollout(segments)
    alike = [Phase(name, simulator.law.value, kite.parameters.vector(), [Guard("time_in_phase", 0.7, True)]) for name in "ab"]
    switched = fly_switched(
        simulator.f.value, simulator.g.value, simulator.initial.value, alike, simulator.n_s, segments.starts_for(simulator.n_s)[0],
        segments.setpoints[0], segments.inputs[0], segments.dt, simulator.stepping(segments), len(OUTPUTS), lambda X, Y, U: {},
    )  # fmt: skip
    assert len(switched.switches) == 25 and switched.alive == 901
    assert np.array_equal(switched.states, whole.states[0]) and np.array_equal(switched.outputs, whole.outputs[0])


def test_what_was_flown_beyond_a_guard_counts_for_nothing():
    """Guards flying ahead: a system that blows up within the samples that are looked at together is switched off before it does."""
    explosive = toy(lambda x, v, c: (c[0] * x * x, 0.0 * v), np.array([[1.0], [0.0]]), (1.0, 0.0),
                    [[Guard("height", 3.0, True)], [Guard("height", 99.0, True)]], 4.0, phases=2)  # fmt: skip
    assert explosive.alive == 201 and len(explosive.switches) == 1
    # 1 / (1 - t) comes to 3 at 2/3 s, and stands still from the sample behind it
    assert explosive.switches[0].sample == 34 and explosive.states[-1, 0] == pytest.approx(1 / (1 - 0.68), rel=1e-5)
