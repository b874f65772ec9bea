"""A flight flown again in other gusts: its surfaces answer as the record says, and nothing else is moved."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from kites import DEVELOPMENT

from awescli.estimation.misfit import Misfit
from awescli.estimation.processes.gusts import Gusts
from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import split
from awescli.notation.quantities import SURFACES
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import observe
from awescli.tracing import bootstrap
from awescli.tracing.frame import Frame, TracedFlight

RUDDER = SURFACES.index("rudder")
K = np.array([[0.02, -0.03, -0.25, 0.05, -0.04, -0.6, 0.001, -0.015, 0.002]])


@pytest.fixture(scope="module")
def calm_fit(kite, calm):
    """A fit, as far as it is asked here: 12 segments of 4 s of a flight in calm air with the rudder held, gusts of 0.8 m/s possible."""
    simulator = Simulator(kite)
    first = np.linspace(50, len(calm.log) - 210, 12).astype(int)
    observed = observe(calm.log, kite, first, 200, ("p", "r", "v_d"))
    held = observed.segments.setpoints.copy()
    held[:, :, RUDDER] = held[:, :1, RUDDER]
    observed = replace(observed, segments=replace(observed.segments, setpoints=held))
    gusts = Gusts.of(kite.declaration, calm.log)
    gusts = gusts.at({g.name: 0.8 if "gust_n" in g.axes or "gust_d" in g.axes else 0.0 for g in gusts.groups})
    misfit = Misfit(simulator, observed, ("CLa",), (gusts,))
    return SimpleNamespace(misfit=misfit, own=misfit.own(), parameters=kite.parameters)


def test_surfaces_answer_what_is_different(calm_fit):
    """Guards the flight that is flown again: other gusts, from the same starts, and set-points that agree with it sample by sample."""
    own = replace(calm_fit.own, path=bootstrap._other_gusts(calm_fit.misfit, calm_fit.own.path, np.random.default_rng(3)))
    flown, setpoints = bootstrap._closed(calm_fit, own, K, [RUDDER])
    recorded = calm_fit.misfit.observed.segments
    before = bootstrap._flown(calm_fit, calm_fit.own, recorded.setpoints)
    moved = bootstrap.motion(flown, recorded.dt) - bootstrap.motion(before, recorded.dt)
    assert not flown.diverged.any() and np.abs(moved[:, 0, :6]).max() < 1e-9 < 0.01 < np.abs(moved[:, 100:, 5]).std()
    assert (setpoints - recorded.setpoints)[:, :, RUDDER] == pytest.approx((moved @ K.T)[..., 0], abs=1e-4)
    assert np.array_equal(np.delete(setpoints, RUDDER, axis=2), np.delete(recorded.setpoints, RUDDER, axis=2))


def test_what_a_controller_answers_is_read_off_its_flight(calm_fit):
    """Guards the regression: set-points that answer gusts by K say K again."""
    own = replace(calm_fit.own, path=bootstrap._other_gusts(calm_fit.misfit, calm_fit.own.path, np.random.default_rng(4)))
    observed, dt = calm_fit.misfit.observed, calm_fit.misfit.observed.segments.dt
    setpoints = observed.segments.setpoints.copy()
    for _ in range(100):
        answer = bootstrap.motion(bootstrap._flown(calm_fit, own, setpoints), dt) @ K.T
        setpoints[:, :, RUDDER] = observed.segments.setpoints[:, :1, RUDDER] + answer[..., 0] - answer[:, :1, 0]
    answered = replace(observed, segments=replace(observed.segments, setpoints=setpoints))
    fit = SimpleNamespace(misfit=replace(calm_fit.misfit, observed=answered), own=own, parameters=calm_fit.parameters)
    assert bootstrap.feedback_gains(fit, [RUDDER]) == pytest.approx(K, abs=0.01)


def test_a_segment_that_diverges_stays_as_it_was_recorded(calm_fit):
    """Guards a trace whose model loses a segment: the others are flown again, and nothing that is no number comes of the lost one."""
    starts = calm_fit.own.starts.copy()
    starts[3, 3:6] = (400.0, -300.0, 900.0)
    fit = SimpleNamespace(misfit=calm_fit.misfit, own=replace(calm_fit.own, starts=starts), parameters=calm_fit.parameters)
    found, observed = bootstrap.feedback_gains(fit, [RUDDER]), calm_fit.misfit.observed
    made = bootstrap.flown_again(fit, 0.3 * K, [RUDDER], seed=1)
    assert np.isfinite(found).all() and all(np.isfinite(a).all() for pair in made.values() for a in pair)
    kept = [k for k, first in enumerate(observed.segments.first.tolist()) if np.array_equal(made[first][1], observed.measured[k])]
    assert kept == [3]
    _, setpoints = bootstrap._closed(calm_fit, calm_fit.own, K, [RUDDER])
    assert np.array_equal(setpoints, observed.segments.setpoints)  # where nothing is different nothing answers
    moved = [k for k, first in enumerate(made) if not np.array_equal(made[first][0], observed.segments.setpoints[k])]
    assert moved == [k for k in range(12) if k != 3]


def test_gusts_are_drawn_at_their_level_and_nothing_else_is(calm_fit):
    path = calm_fit.own.path + 0.7
    drawn = np.concatenate([bootstrap._other_gusts(calm_fit.misfit, path, np.random.default_rng(k)) for k in range(20)])
    for w, (_, axis) in enumerate(calm_fit.misfit.labels):
        assert drawn[..., w].std() == pytest.approx(0.8, rel=0.15) and abs(drawn[..., w].mean()) < 0.3, axis
        near, far = (np.corrcoef(drawn[:, 0, w], drawn[:, k, w])[0, 1] for k in (1, -1))
        assert near > max(far, 0.5)


def test_what_was_flown_again_stands_in_the_place_of_what_was_recorded(calm):
    """Guards the fits beside it: set-points, their rates, and what was measured, of the segments that are looked at."""
    frame = Frame((TracedFlight(calm.log, split(find_loops(calm.log)), DEVELOPMENT),), 2.0, ("p", "r"))
    (as_recorded,) = frame.problems(())
    every = [*as_recorded.fitted.segments.first.tolist(), *as_recorded.validation.segments.first.tolist()]
    steps = as_recorded.fitted.segments.steps
    ramp = np.linspace(0.0, 0.2, steps + 1)[:, None] * np.arange(1.0, 6.0)
    made = {first: (ramp, np.full((steps + 1, 2), float(first))) for first in every}
    (again,) = bootstrap.FlownAgain(frame.flights, frame.horizon, frame.outputs, frame.per_flight, 8.0, 0.0, (made,)).problems(())
    assert len(again.fitted.segments) < len(as_recorded.fitted.segments)
    for o in (again.fitted, again.validation):
        column = again.kite.input_names.index("rudder_rate")
        assert o.measured[:, 0, 0].tolist() == o.segments.first.tolist() and np.array_equal(o.segments.setpoints[0], ramp)
        assert o.segments.inputs[:, 1:, column] == pytest.approx(0.2 / steps / o.segments.dt * (1 + RUDDER))
