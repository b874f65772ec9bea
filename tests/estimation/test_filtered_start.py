"""Predictions that begin in the air of the second before: what is known of that fades, nothing is seen later, without processes nothing
changes."""

from dataclasses import replace

import numpy as np
import pytest
from kites import DEVELOPMENT, declared, flight

from awescli.estimation import filtered_start
from awescli.estimation.filter_levels import with_levels
from awescli.estimation.filtered_start import filtered
from awescli.estimation.known import Known
from awescli.estimation.prediction import predict
from awescli.estimation.problem import simulator_of
from awescli.estimation.wind_seen import processes_at
from awescli.flightlog.split import Split
from awescli.notation.quantities import MEASURED, STATES
from awescli.simulation.campaign_flights import dev_like
from awescli.simulation.segments import observe

RANGES = [(300, 2900)]
GUSTS = {"horizontal gusts": {"level": 0.9, "memory_s": 3.7}, "vertical gusts": {"level": 0.78, "memory_s": 0.75}}
DEG = np.pi / 180


@pytest.fixture(scope="module")
def gusty():
    """(log, simulator of the kite that flew, in calm air): a minute in gusts of 0.9 m/s."""
    flown = dev_like(DEVELOPMENT, 3, {"turbulence": {"sigma": 0.9}}, duration=60.0)
    calm = flown.flown.with_parameters(flown.flown.table().with_values({"turbulence.sigma": 0.0}))
    return flown.log, simulator_of(calm, flown.log)


def told(log, simulator, levels, **factors):
    """What is known of a perfect model in processes of these levels."""
    record = {"wind record": {"level": 0.05, "memory_s": 2.0}}
    processes = processes_at(simulator.kite.declaration, log, levels | record)
    return replace(Known.declared(simulator.kite), processes=processes, factors=factors)


def test_a_kite_in_gusts_is_predicted_better_by_what_it_has_just_flown_in(gusty):
    """Guards the purpose: in gusts of 0.9 m/s, with a memory of seconds, a perfect model errs by a fifth less one second ahead, and not
    more later, when the gusts have faded."""
    log, simulator = gusty
    known = told(log, simulator, GUSTS)
    for horizon, share in ((1.0, 0.8), (5.0, 1.05)):
        free, carried = (predict(simulator, log, RANGES, horizon, known=k).nrmse()["mean"] for k in (None, known))
        assert carried < share * free, horizon


def test_processes_run_to_the_end_of_the_warm_up_and_fade_with_their_memory(gusty):
    """Guards exp(-(t - t0) / memory), axis by axis."""
    log, simulator = gusty
    observed = observe(log, simulator.kite, np.array([400, 900]), 150, MEASURED)
    whole, own = filtered(simulator, observed, 50, told(log, simulator, GUSTS))
    at = np.flatnonzero(whole.nodes == 50)[0]
    later = (whole.nodes[at:] - 50) * log.dt
    memory = {g.name: g.memory for p in whole.processes for g in p.groups}
    assert np.abs(own.path[:, at]).max() > 0.2
    for w, (group, _) in enumerate(whole.labels):
        assert own.path[:, at:, w] == pytest.approx(own.path[:, at, w][:, None] * np.exp(-later / memory[group]))


def test_nothing_measured_later_is_used(gusty):
    """Guards against a look ahead, also from one prediction's warm-up into the one before."""
    log, simulator = gusty
    known = told(log, simulator, GUSTS)
    p = predict(simulator, log, RANGES, 1.0, known=known)
    begin = int(p.first[3])
    measured = {n: np.where(np.arange(len(log)) > begin, s + 0.3, s) for n, s in log.measured.items()}
    q = predict(simulator, replace(log, measured=measured), RANGES, 1.0, known=known)
    for name in STATES:
        assert q.simulated[name][:4] == pytest.approx(p.simulated[name][:4], rel=1e-9, abs=1e-12), name
        assert np.abs(q.simulated[name][5] - p.simulated[name][5]).max() > 1e-3, name


def test_warm_ups_filtered_a_few_at_a_time_are_those_filtered_together(gusty, monkeypatch):
    """Guards long flights, whose warm-ups do not fit into memory at once."""
    log, simulator = gusty
    known = told(log, simulator, GUSTS)
    together = predict(simulator, log, RANGES, 1.0, known=known)
    monkeypatch.setattr(filtered_start, "AT_ONCE", 7)
    apart = predict(simulator, log, RANGES, 1.0, known=known)
    for name in STATES:
        assert apart.simulated[name] == pytest.approx(together.simulated[name], rel=1e-9, abs=1e-9), name


def test_without_processes_it_is_the_start_that_fits_the_warm_up(gusty):
    """Guards the special case: nothing beside the model, the noise as declared."""
    log, simulator = gusty
    none = replace(Known.declared(simulator.kite), processes=())
    free, carried = (predict(simulator, log, RANGES, 2.0, known=k) for k in (None, none))
    for name in STATES:
        assert carried.simulated[name] == pytest.approx(free.simulated[name], abs=2e-3 * free.spans[name]), name


def test_a_drift_of_the_attitude_is_in_what_is_predicted_of_the_sensor():
    """Guards drifts: an attitude that reads 2 deg off, slowly changing, is predicted as it will read, and so are u, v, w."""
    flown = flight(seed=1, duration=60.0, noise=True)
    off = 2 * DEG * np.sin(2 * np.pi * flown.log.time / 60.0)
    log = replace(flown.log, measured={**flown.log.measured, "theta": flown.log.measured["theta"] + off})
    simulator = simulator_of(flown.flown, log)
    known = told(log, simulator, {"roll and pitch drift": {"level": 1.5 * DEG, "memory_s": 20.0}})
    free, carried = (predict(simulator, log, RANGES, 1.0, known=k).nrmse() for k in (None, known))
    for name in ("theta", "w"):
        assert carried[name] < 0.8 * free[name], name


def test_a_model_that_leaves_the_flight_in_the_warm_up_is_counted(gusty):
    """Guards the outcome: every segment is on its own, and none makes the others fail."""
    log, _ = gusty
    simulator = simulator_of(declared(Cmq=4e4), log)
    p = predict(simulator, log, RANGES, 2.0, known=told(log, simulator, GUSTS))
    assert p.diverged == len(p.first) and np.isfinite(list(p.nrmse().values())).all()


def test_levels_are_those_that_the_train_loops_show_unless_a_fit_has_left_some(gusty):
    """Guards the filter's tuning: gusts of 0.9 m/s are found at their level beside a model that was fitted without them, and those that a
    fit has left are taken as they are."""
    log, simulator = gusty
    parts = Split(((100, 1600),), ((1600, 2200),), ((2200, 2900),), (1, 1, 1), "loops")
    found = with_levels(simulator, log, parts, 5.0, told(log, simulator, {}))
    levels = {g.name: g.level for p in found.processes for g in p.groups}
    assert levels["horizontal gusts"] == pytest.approx(0.9, rel=0.25) and levels["vertical gusts"] == pytest.approx(0.78, rel=0.25)
    assert all(0.8 < f < 1.25 for f in found.factors.values()), found.factors
    left = told(log, simulator, GUSTS)
    assert with_levels(simulator, log, parts, 5.0, left) is left


def test_a_minute_of_train_tells_the_levels(gusty):
    """Guards long logs: no more than a minute, from the beginning of the flight to its end, and all of a shorter one."""
    log, simulator = gusty
    first = np.arange(100, 2800, 100)
    observed = observe(log, simulator.kite, first, 100, MEASURED)
    assert observed.seconds == 54.0 and len(observed.spread_out(1.0).segments) == len(first) == 27
    some = observed.spread_out(10 / 27).segments.first
    assert len(some) == 10 and some[0] == first[0] and some[-1] == first[-1] and np.ptp(np.diff(some)) <= 100
    assert observed.spread_out(0.01).segments.first.tolist() == [first[0]]
