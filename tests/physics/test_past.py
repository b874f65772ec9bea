"""Where actuators stand when a rollout begins: where the recorded set-points have left them."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, at_point, flight

from awescli.physics.effects.past import BEHIND, past_of
from awescli.physics.kite import Kite
from awescli.simulation.rollout import inputs_of


def begun(key: str, values: dict, setpoint, now: float, states: int = 1) -> list[float]:
    """The first states of an actuator of the rudder at `now`, as a log of 60 s tells in which `setpoint` (of time) is recorded."""
    kite = Kite(DEVELOPMENT, extra=(key,)).with_values({f"{key}.{n}": v for n, v in values.items()})
    log = flight(duration=61.0).log
    log = replace(log, inputs={**log.inputs, "rudder": setpoint(log.time)})
    row = inputs_of(log, kite)[int(round(now / log.dt))]
    past = {n: row[kite.input_names.index(n)] for n in past_of("rudder")}
    x, _, _ = at_point(kite, rudder=float(setpoint(now)), **past)
    return x[12 : 12 + states]


def swing(t):
    return 0.1 * np.sin(0.9 * np.asarray(t)) + 0.03 * np.sin(0.31 * np.asarray(t))


def integrated(rate, now: float, h: float = 1e-3) -> float:
    """A state that follows d(state)/dt = rate(state, t) from rest at 0, by small steps."""
    x = float(swing(0.0))
    for t in np.arange(0.0, now - h / 2, h):
        x += h * rate(x, t + h / 2)
    return x


@pytest.mark.parametrize("now", [25.0, 31.7, 48.3])
@pytest.mark.parametrize("tau, limit", [(0.2, 50.0), (1.0, 50.0), (0.05, 0.03), (0.2, 0.05)])
def test_a_lagging_surface_stands_where_its_past_has_left_it(tau, limit, now):
    """Guards starts of segments against small steps of the actuator's own equation from the beginning of the log: within a tenth of what it
    is behind by. A trim motor of 0.03 rad/s is nowhere near where a steady rate would leave it."""
    (found,) = begun("actuator_lag:rudder", {"tau": tau, "rate": limit, "inertia": 0.0}, swing, now)
    expected = integrated(lambda x, t: np.clip((swing(t) - x) / tau, -limit, limit), now)
    every = [abs(integrated(lambda x, t: np.clip((swing(t) - x) / tau, -limit, limit), s) - swing(s)) for s in (25.0, 31.7, 48.3)]
    assert found == pytest.approx(expected, abs=0.1 * max(every))


@pytest.mark.parametrize("now", [25.0, 31.7, 48.3])
@pytest.mark.parametrize("tau", [0.1, 0.4])
def test_a_delayed_surface_stands_where_its_past_has_left_it(tau, now):
    """Guards both states of the Pade form, whose first differs from the delayed set-point: against small steps of its equations."""
    found = begun("actuator_delay:rudder", {"tau": tau}, swing, now, states=2)
    x1, x2, h = float(swing(0.0)), 0.0, 1e-4
    for t in np.arange(now - 6.0, now - h / 2, h):
        x1, x2 = x1 + h * x2, x2 + h * 12 * (float(swing(t + h / 2)) - x1 - tau * x2 / 2) / tau**2
    assert found == pytest.approx([x1, x2], abs=5e-4)


@pytest.mark.parametrize("now", [25.0, 31.7, 48.3])
@pytest.mark.parametrize("inertia", [0.01, 0.15, 0.2499, 0.25, 0.2501, 0.5, 1.0])
def test_a_servo_stands_and_moves_as_its_past_has_left_it(inertia, now):
    """Guards both states of a lag of second order, damped more than critically, critically, less: against small steps of its equation."""
    tau = 0.2
    found = begun("actuator_lag:rudder", {"tau": tau, "inertia": inertia}, swing, now, states=2)
    x, v, h = float(swing(0.0)), 0.0, 1e-4
    for t in np.arange(now - 10.0, now - h / 2, h):
        x, v = x + h * v, v + h * ((float(swing(t + h / 2)) - x) / tau - v) / (inertia * tau)
    assert found == pytest.approx([x, v], abs=3e-4)


@pytest.mark.parametrize("now", [25.0, 28.0, 31.7])
def test_a_linkage_with_play_was_pushed_along_by_its_past(now):
    """Guards the play's memory, against the operator on all samples: a small swing within the play moves nothing."""
    width, small = 0.06, lambda t: swing(np.minimum(t, 24.0)) + 0.01 * np.sin(2.0 * np.asarray(t)) * (np.asarray(t) > 24.0)
    x = float(small(0.0))
    for s in small(np.arange(0.0, now + 1e-9, 0.001)):
        x = min(max(x, s - width / 2), s + width / 2)
    assert begun("surface_backlash:rudder", {"width": width}, small, now) == pytest.approx([x], abs=2e-3)


def test_before_a_log_begins_its_surfaces_have_stood_still():
    kite, log = Kite(DEVELOPMENT, extra=("actuator_lag:rudder",)), flight(duration=40.0).log
    inputs = inputs_of(log, kite)[:, [kite.input_names.index(n) for n in past_of("rudder")]]
    assert not inputs[0].any()
    k = int(round(30.0 / log.dt))
    there = [log.inputs["rudder"][k - int(round(s / log.dt))] - log.inputs["rudder"][k] for s in BEHIND]
    assert inputs[k] == pytest.approx(there, abs=0.02)
    # only what some effect asks for
    assert not set(past_of("elevator")) & set(kite.input_names) and not set(past_of("rudder")) & set(Kite(DEVELOPMENT).input_names)


@pytest.mark.parametrize("now", [25.0, 31.7, 48.3])
@pytest.mark.parametrize("tau, limit", [(0.4, 100.0), (2.0, 100.0), (0.3, 0.15)])
def test_a_drum_turns_as_its_past_has_left_it(tau, limit, now):
    """Guards the start of a winch that follows its reference late, or slowly, against small steps of its equation from rest."""
    kite = Kite(DEVELOPMENT, extra=("winch_tracking",))
    kite = kite.with_values({"winch_tracking.tau": tau, "winch_tracking.a_max": limit, "winch_tracking.v_max": 100.0})
    log = flight(duration=61.0).log

    def reference(t):
        return 1.0 + 3.0 * swing(t)

    row = inputs_of(replace(log, inputs={**log.inputs, "reel_out_speed": reference(log.time)}), kite)[int(round(now / log.dt))]
    asked = (*past_of("reel_out_speed"), "reel_out_speed", "reel_out_acceleration")
    x, _, _ = at_point(kite, **{n: row[kite.input_names.index(n)] for n in asked})
    v, h = float(reference(0.0)), 1e-3
    for t in np.arange(0.0, now - h / 2, h):
        v += h * float(np.clip((reference(t + h / 2) - v) / tau, -limit, limit))
    assert x[12] == pytest.approx(v, abs=0.02) and x[13] == pytest.approx(-tau * v, abs=0.02 * tau)
