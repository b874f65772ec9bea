"""The linear baseline on flights: exact where the flight is linear in body axes, from the same starts as models, blind to the future."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT

from awescli.estimation import linear_baseline as module
from awescli.estimation.linear_baseline import linear_baseline, signals_of
from awescli.estimation.prediction import predict
from awescli.flightlog.log import FlightLog, runs_of
from awescli.flightlog.split import Split
from awescli.notation.quantities import MEASURED, STATES
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator

NOISE = DEVELOPMENT.noise
PARTS = Split(((0, 1000),), ((1000, 1400),), ((1400, 2000),), (1, 1, 1), "blocks")
DT = 0.02


def level_flight(samples: int = 2000, seed: int = 5) -> FlightLog:
    """A made flight that turns both ways in level attitude: body velocities and the yaw rate answer to surfaces linearly, heading and place
    follow step by step. Linear in body axes, not in NED."""
    draw = np.random.default_rng(seed)
    commands = np.repeat(draw.standard_normal((samples // 40 + 1, 2)), 40, axis=0)[:samples]
    u, v, r, psi, p = 20.0, 0.0, 0.0, 1.0, np.zeros(2)
    rows = []
    for aileron, rudder in commands:
        v_n, v_e = u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)
        rows.append([*p, v_n, v_e, psi, r])
        p, psi = p + DT * np.array([v_n, v_e]), psi + DT * r
        u, v, r = u + DT * (-0.5 * (u - 20) + 2 * aileron), v + DT * (-v + 3 * r), r + DT * (-2 * r + 2 * rudder - 0.1 * v)
    columns = dict(zip(("p_n", "p_e", "v_n", "v_e", "psi", "r"), np.array(rows).T, strict=True))
    signals = {n: np.zeros(samples) for n in MEASURED if n not in ("tension", "alpha", "beta", "V_a")} | columns
    inputs = dict(zip(("aileron", "rudder"), commands.T, strict=True))
    return FlightLog("level", 0.0, DT, np.arange(samples) * DT, signals, inputs, np.ones(samples, bool))


@pytest.fixture(scope="module")
def level():
    return level_flight()


@pytest.fixture(scope="module")
def wing(calm):
    return Kite(DEVELOPMENT, calm.log.wind.height)


def flown(log, wing, **how):
    return linear_baseline(log, PARTS, wing, 3.0, **how)


def test_a_flight_that_is_linear_in_body_axes_is_predicted_exactly(level, wing):
    """Guards the coordinates: three seconds of turns in both directions, from unseen starts, to a millimetre; the choice is one lag of one
    sample without a penalty to speak of, which is how the flight was made."""
    found = flown(level, wing)
    assert found.outcome == "fitted" and found.model.step == 1 and found.ridge == min(module.RIDGES)
    assert np.ptp(level["psi"]) > 3 and np.ptp(level["p_e"]) > 100
    p = found.predict(level, NOISE, PARTS.test, 3.0)
    assert len(p.first) > 2 and np.abs(p.errors("p_n")).max() < 0.02 and np.abs(p.errors("psi")).max() < 1e-3 and p.diverged == 0


def test_it_starts_where_the_models_start(calm, wing):
    """Guards the comparison: the same samples, horizons and channels as a model's predictions, on a flight of the development kite."""
    parts = Split(((0, 1000),), ((1000, 1400),), ((1400, 2000),), (1, 1, 1), "loops")
    found = linear_baseline(calm.log, parts, wing, 3.0)
    model = Simulator(wing, ())
    for horizon, every in ((3.0, None), (1.0, None), (DT, 0.25)):
        own = found.predict(calm.log, NOISE, parts.test, horizon, every)
        its = predict(model, calm.log, parts.test, horizon, every=every)
        assert np.array_equal(own.first, its.first) and own.time == pytest.approx(its.time)
        assert list(own.simulated) == list(its.simulated) and own.spans == its.spans and own.floor == its.floor
    assert own.nrmse()["mean"] < 0.02 and found.signals.inputs[:1] == ("rudder",)


def test_nothing_measured_later_is_used(calm, wing):
    """Guards against a peek: what is measured after the start of a prediction, and commanded after its end, changes no bit of it."""
    parts = Split(((0, 1000),), ((1000, 1400),), ((1400, 2000),), (1, 1, 1), "loops")
    found = linear_baseline(calm.log, parts, wing, 3.0)
    before = found.predict(calm.log, NOISE, parts.test, 2.0)
    first, last = int(before.first[0]), int(before.first[0]) + len(before.time)
    late = np.arange(len(calm.log)) > first
    measured = {n: np.where(late, s + 0.3, s) for n, s in calm.log.measured.items()}
    inputs = {n: np.where(np.arange(len(s)) >= last, s + 0.3 * (np.ptp(s) > 0), s) for n, s in calm.log.inputs.items()}
    changed = replace(calm.log, measured=measured, inputs=inputs)
    after = replace(found, signals=signals_of(changed, wing, False)).predict(changed, NOISE, parts.test, 2.0)
    for name in STATES:
        assert np.array_equal(before.simulated[name][0], after.simulated[name][0]), name


def test_a_closed_loop_is_not_told_the_surfaces(calm, wing):
    found = signals_of(calm.log, wing, closed=True)
    assert "rudder" in found.outputs and "rudder" not in found.inputs and {"tether_length", "wind_n"} <= set(found.inputs)


def test_a_gappy_log_is_neither_bridged_nor_fatal(level, wing):
    """Guards gaps: nonsense in samples that are not valid changes nothing; pieces shorter than the lags are of no use, and a flight of
    nothing but such has no baseline ("too_short")."""
    valid = np.ones(len(level), bool)
    valid[100::170] = False
    spoilt = {n: np.where(valid, s, 1e4) for n, s in level.measured.items()}
    found = linear_baseline(replace(level, valid=valid, measured=spoilt), PARTS, wing, 2.0)
    p = found.predict(replace(level, valid=valid, measured=spoilt), NOISE, PARTS.test, 1.0)
    assert found.outcome == "fitted" and len(p.first) and np.abs(p.errors("psi")).max() < 1e-3
    valid[::10] = False
    assert (runs_of(valid) @ [-1, 1]).max() < 12 and flown(replace(level, valid=valid), wing) is None


def test_an_unstable_choice_is_named_and_scored_with_numbers(level, wing, monkeypatch):
    """Guards a flight that no linear model holds: the roll rate grows a thousandfold in the train part and so do predictions; all of them
    are counted as diverged, and the score is finite."""
    monkeypatch.setattr(module, "RIDGES", (1e-9,))
    grows = 1e-3 * np.exp(np.arange(len(level)) * DT * 1.0)
    log = replace(level, measured={**level.measured, "p": grows})
    found = flown(log, wing)
    p = found.predict(log, NOISE, PARTS.test, 3.0)
    assert found.outcome == "unstable" and p.diverged == len(p.first) and np.isfinite(list(p.nrmse().values())).all()
