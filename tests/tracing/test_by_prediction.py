"""Candidates judged by what they predict, where no verdict is possible."""

from dataclasses import replace
from functools import cache

import pytest
from tracing.traced import short_flight

from awescli.estimation.prediction import predict
from awescli.tracing.by_prediction import better_by_prediction
from awescli.tracing.criteria import CRITERIA
from awescli.tracing.frame import Frame, TracedFlight

KEYS = ("actuator_lag:rudder", "sideslip_drag", "surface_bias:yaw", "air_density", "position_latency")
UNKNOWN = ("CL0", "CD0", "Cma", "Cndr", "dl")


@cache
def frame_of(effects: tuple = ()) -> Frame:
    declared, log, parts = short_flight({k: dict(v) for k, v in effects}, 31, 50.0, UNKNOWN)
    return Frame((TracedFlight(log, parts, declared),), 2.0, tuple(log.measured))


LAGGED = (("actuator_lag:rudder", (("tau", 0.12),)),)


def test_the_missing_effect_predicts_unseen_loops_better_and_keeps_doing_so_on_test_loops():
    """Guards the measured flights: what the model lacks is named, with its size; the error is told before and after, on loops that neither
    the fits nor the choice have seen."""
    frame = frame_of(LAGGED)
    found = better_by_prediction(frame, {}, KEYS)
    assert found is not None and [b.key for b in found.better] == ["actuator_lag:rudder"]
    (better,) = found.better
    assert better.after < (1 - CRITERIA.predicts) * better.before and better.rivals == {}
    assert found.model.simulator.kite.parameters["actuator_lag:rudder.tau"].value == pytest.approx(0.12, abs=0.01)
    flight = frame.flights[0]
    before, after = (predict(m.simulator, flight.log, flight.split.test, 2.0).nrmse()["mean"] for m in (found.base, found.model))
    assert after < 0.8 * before


def test_nothing_is_told_where_nothing_is_missing():
    assert better_by_prediction(frame_of(), {}, KEYS) is None


def test_no_candidate_that_leaves_the_error_where_it_is_is_told():
    """What the model lacks is not among the candidates."""
    assert better_by_prediction(frame_of(LAGGED), {}, ("air_density", "surface_bias:yaw")) is None


def test_a_model_that_is_nowhere_near_the_flight_is_not_asked():
    """Guards against a name for a flight of another aeroplane: beyond the limit of chi-square nothing is tried."""
    said = []
    assert better_by_prediction(frame_of(LAGGED), {}, KEYS, replace(CRITERIA, nowhere=1.0), said.append) is None
    assert not any("candidates" in text for text in said)
