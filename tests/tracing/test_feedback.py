"""Which surfaces answer the kite: a plan that does not look at it is none, however much its surfaces move the kite."""

from dataclasses import replace

import numpy as np
import pytest
from kites import flight

from awescli.tracing.feedback import answering

DT, STEPS = 0.04, 1500


def wandering(random, count: int, memory: float) -> np.ndarray:
    """(count,) an Ornstein-Uhlenbeck plan of unit variance, memory in samples."""
    x, f = np.zeros(count), np.exp(-1 / memory)
    for k in range(1, count):
        x[k] = f * x[k - 1] + np.sqrt(1 - f * f) * random.standard_normal()
    return x


def moved(gain: float, seed: int):
    """A log of a kite with dp/dt = -3 p + 20 rudder + gusts, whose rudder is `gain` p beside a plan, and whose elevator is moved by a plan
    of its own and moves q alike."""
    random = np.random.default_rng(seed)
    plans, gusts = 0.02 * np.stack([wandering(random, STEPS, 40.0) for _ in range(2)], 1), random.standard_normal((STEPS, 2))
    rates, surfaces = np.zeros((STEPS, 2)), plans.copy()
    for k in range(STEPS - 1):
        surfaces[k] += np.array([gain, 0.0]) * rates[k]
        rates[k + 1] = rates[k] + DT * (-3.0 * rates[k] + 20.0 * surfaces[k]) + 0.1 * np.sqrt(DT) * gusts[k]
    surfaces[-1] = surfaces[-2]
    log = flight(duration=61.0).log
    part = slice(0, STEPS)
    own = {n: x[part] for n, x in log.measured.items() if n not in ("p", "q")}
    measured = {**own, "p": rates[:, 0] + 0.005 * gusts[:, 0], "q": rates[:, 1] + 0.005 * gusts[:, 1]}
    inputs = {**{n: x[part] for n, x in log.inputs.items()}, "rudder": surfaces[:, 0], "elevator": surfaces[:, 1]}
    time = DT * np.arange(STEPS)
    return replace(log, dt=DT, time=time, valid=np.ones(STEPS, bool), measured=measured, inputs=inputs, fresh={})


def test_a_surface_that_answers_a_rate_is_told_from_one_that_makes_it():
    """Guards both directions: a fifth of a second of the roll rate is found on every flight; a plan that moves the kite as much answers on
    few."""
    found = [answering(moved(-0.2, seed)) for seed in range(20)]
    assert all("rudder" in those for those in found)
    assert sum("elevator" in those for those in found) <= 4
    assert sum("rudder" in answering(moved(0.0, seed)) for seed in range(20)) <= 4


def test_a_steered_flight_says_which_surface_steers():
    log = flight(duration=60.0, noise=True).log
    plan = 0.02 * wandering(np.random.default_rng(5), len(log), 2.0 / log.dt)
    planned = replace(log, inputs={**log.inputs, "elevator": plan})
    assert "rudder" in answering(planned) and "elevator" not in answering(planned)
    for channel, gain in (("q", 0.2), ("V_a", 0.001), ("tension", 1e-5)):
        told = np.r_[log[channel][:1], log[channel][:-1]] if channel == "tension" else log[channel]
        assert "elevator" in answering(replace(log, inputs={**log.inputs, "elevator": plan + gain * (told - told.mean())})), channel


def test_what_a_surface_does_at_once_is_no_answer():
    """Guards accelerometers and load cells: flaps lift the kite in the very sample in which they move."""
    log = flight(duration=60.0, noise=True).log
    plan = 0.02 * wandering(np.random.default_rng(7), len(log), 2.0 / log.dt)
    lifted = {n: log[n] + gain * plan for n, gain in (("a_z", -100.0), ("tension", 2e4))}
    assert "flaps" not in answering(replace(log, inputs={**log.inputs, "flaps": plan}, measured={**log.measured, **lifted}))


@pytest.mark.parametrize("left", [0, 12])
def test_where_too_little_is_left_a_surface_may_answer(left):
    """Guards short and broken logs: what no regression tells is doubted."""
    log = moved(0.0, 0)
    assert "rudder" in answering(replace(log, valid=np.arange(len(log)) < left))


def test_a_surface_that_stands_still_answers_nothing():
    log = moved(0.0, 0)
    still = replace(log, inputs={**log.inputs, "flaps": np.zeros(len(log))})
    assert "flaps" not in answering(still)
