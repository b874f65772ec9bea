"""Errors of all instruments at once, where no verdict is possible; and the time at which a surface answers."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from kites import DEVELOPMENT
from kites import flight as true_flight
from scipy.signal import butter, lfilter, sosfiltfilt
from sensors import POSITION, RATES, Sensors
from tracing.traced import short_flight

from awescli.flightlog.reconstruction.flight_path import MATTERS, reconstruct
from awescli.notation.quantities import MEASURED, SURFACES
from awescli.physics.kite import candidates, make_effect
from awescli.tracing import flight
from awescli.tracing.criteria import CRITERIA
from awescli.tracing.frame import Frame, TracedFlight
from awescli.tracing.instruments import InstrumentError, given_later, instrument_errors
from awescli.tracing.instruments import _follows as follows
from awescli.tracing.investigate import Finding
from awescli.tracing.lateness import lateness

KEYS = (
    "actuator_lag:rudder", "actuator_delay:rudder", "position_latency", "attitude_latency", "heading_bias", "vane_bias:beta",
    "sideslip_drag",
)  # fmt: skip
UNKNOWN = ("CL0", "CD0", "Cma", "Cndr", "dl")
GUSTS = {"turbulence": {"sigma": 0.6, "L": 80.0}}


def errors_of(effects: dict, late: float = 0.0) -> dict[str, InstrumentError]:
    """Of a flight in gusts with `effects`, whose rudder was commanded `late` seconds before what is logged; beside another flight, whose
    instruments are not asked, and which has a heading of its own."""
    declared, log, parts = short_flight(GUSTS | effects, 31, 50.0, UNKNOWN)
    asked = TracedFlight(given_later(log, {"rudder": -late}), parts, declared, "first")
    frame = Frame((asked, TracedFlight(log, parts, declared, "second")), 2.0, tuple(log.measured), per_flight=("heading_bias*",))
    return {e.key: e for e in instrument_errors(frame, {}, KEYS)}


def test_errors_of_several_instruments_are_told_together():
    """Guards the measured flights: three errors at once, in gusts, each with its size; none where there is none; and nothing of an effect
    that is no instrument."""
    flown = {"position_latency": {"tau": 0.1}, "heading_bias": {"b": 0.06}, "actuator_delay:rudder": {"tau": 0.08}}
    told = errors_of(flown)
    assert {key for key, e in told.items() if e.found} == set(flown)
    sizes = {key: v for key, values in flown.items() for v in values.values()}
    assert all(abs(told[key].size - size) < 1.96 * told[key].std for key, size in sizes.items())
    assert told["actuator_delay:rudder"].rivals == ("actuator_lag:rudder",) and told["heading_bias"].rivals == ()
    assert "sideslip_drag" not in told and "actuator_lag:rudder" not in told


def test_no_instrument_is_blamed_for_gusts():
    assert not any(e.found for e in errors_of({}).values())


@pytest.mark.parametrize("late, said", [((), ()), (RATES, ("rates late by",)), (POSITION, ())])
def test_sensors_that_contradict_each_other_are_told_before_a_model_is_asked(late, said):
    """Rates that are 0.06 s late make no model's residual; a position that is late is an effect that can be traced. Nor does it count for
    channels that are not compared."""
    log = Sensors(late={late: 0.06} if late else {}).record(true_flight(3, 60.0).log, 7)
    all_compared, places = (flight.contradictions([reconstruct(log).findings], outputs) for outputs in (MEASURED, ("p_n",)))
    assert [s.startswith(begin) for s, begin in zip(all_compared, said, strict=True)] == [True] * len(said) and places == ()


def test_a_gyro_of_the_wrong_scale_is_told_before_a_model_is_asked():
    log = Sensors().record(true_flight(3, 60.0).log, 7)
    log = replace(log, measured={**log.measured, "r": 0.9 * log["r"]})
    (said,) = flight.contradictions([reconstruct(log).findings], MEASURED)
    assert said.startswith("r reads ") and " % low against the attitude" in said


@pytest.mark.parametrize(
    ("verdict", "chi2", "against", "asked"),
    [
        ("not_testable", 1.0, (), True), ("not_testable", 1.0, ("rates late by 0.04 s",), False), ("unexplained", 2.5, (), True),
        ("unexplained", 1.5, (), False), ("found", 2.5, (), False),
    ],
)  # fmt: skip
def test_which_flights_are_asked_for_their_instruments(monkeypatch, verdict, chi2, against, asked):
    """Guards measured flights that are unexplained by far (a vane that is 3.5 deg off was silent), and everybody else's time. Where sensors
    contradict each other, other errors would stand for that."""
    declared, log, parts = short_flight({}, 31, 20.0, UNKNOWN)
    evidence, seen = SimpleNamespace(rest=SimpleNamespace(chi2=chi2), contradictions=against), ("what instruments say",)
    monkeypatch.setattr(flight, "fit_null", lambda *of: SimpleNamespace(simulator=None))
    monkeypatch.setattr(flight, "without_outliers", lambda frame, null: (frame, null, {"theta": 3}))
    monkeypatch.setattr(flight, "predict", lambda *of: SimpleNamespace(nrmse=lambda: {"mean": 0.1}))
    monkeypatch.setattr(flight, "investigate", lambda frame, null, *of, **how: Finding(frame, verdict, (), {}, evidence, null))
    monkeypatch.setattr(flight, "better_by_prediction", lambda *of, **how: None)
    monkeypatch.setattr(flight, "instrument_errors", lambda *of, **how: seen)
    found = flight.trace_flight(declared, log, parts)
    assert found.instruments == (seen if asked else ()) and found.outliers == {"theta": 3}


@pytest.mark.parametrize("seen", [0.0, 0.34])
def test_a_surface_that_is_very_late_is_told(monkeypatch, seen):
    """Guards delays beyond the reach of their form (of 0.35 s on a measured flight a fit told half): where equation error has seen one, the
    record is given later by most of it, and the rest is fitted; the sum is the delay, as it is without that where surfaces move slowly. The
    model without these errors need not follow the flight."""
    monkeypatch.setattr("awescli.tracing.instruments.lateness", lambda log, surface: seen)
    monkeypatch.setattr("awescli.tracing.instruments._follows", lambda model, criteria: bool(model.keys) and follows(model, criteria))
    told = errors_of({}, late=0.3)["actuator_delay:rudder"]
    assert told.found and told.size == pytest.approx(0.3, abs=0.02)


def test_no_instrument_is_blamed_for_a_model_of_another_aeroplane():
    """Guards against wrong names: the signs of the weathercock and of the rudder are wrong, and the fit may not mend them; and where even
    gusts and model error do not make a model follow, nothing is said."""
    declared, log, parts = short_flight(GUSTS, 31, 50.0, UNKNOWN)
    rows = (declared.table()[n] for n in ("Cma", "Cndr"))
    wrong = declared.with_parameters(declared.table().with_rows(replace(p, value=-p.value, free=False, lower=-9, upper=9) for p in rows))
    frame = Frame((TracedFlight(log, parts, wrong),), 2.0, tuple(log.measured))
    assert not any(e.found for e in instrument_errors(frame, {}, KEYS))
    assert instrument_errors(frame, {}, KEYS, replace(CRITERIA, follows=0.1)) == ()


@pytest.mark.parametrize("late", [0.0, 0.1, 0.4])
def test_equation_error_sees_when_a_surface_answers(late):
    """Guards against r' = -2 r + b V^2 delta(t - late), integrated exactly from sample to sample, under noise as large as the answer."""
    _, log, _ = short_flight({}, 31, 50.0, UNKNOWN)
    random = np.random.default_rng(3)
    busy = sosfiltfilt(butter(2, 4.0, fs=1 / log.dt, output="sos"), random.normal(0, 0.1, len(log.time)))
    moment = 0.05 * log["V_a"] ** 2 * np.interp(log.time - late, log.time, busy)
    a = np.exp(-2 * log.dt)
    r = lfilter([0.0, (1 - a) / 2], [1, -a], moment + random.normal(0, moment.std(), len(moment)))
    known = replace(log, inputs={**log.inputs, "rudder": busy}, measured={**log.measured, "r": r})
    # a held moment is half a sample late by itself
    assert lateness(known, "rudder") == pytest.approx(late + log.dt / 2, abs=0.6 * log.dt)


def test_a_surface_that_says_nothing_has_no_time():
    _, log, _ = short_flight({}, 31, 50.0, UNKNOWN)
    noise = np.random.default_rng(1).normal(0, 0.02, len(log.time))
    assert lateness(replace(log, inputs={**log.inputs, "rudder": noise}), "rudder") == 0.0
    assert lateness(log, "flaps") == 0.0
    assert lateness(replace(log, measured={n: s for n, s in log.measured.items() if n != "q"}), "rudder") == 0.0


def test_what_matters_is_a_parameter():
    effects = [make_effect(key, DEVELOPMENT) for key in candidates(DEVELOPMENT, MEASURED, SURFACES)]
    assert {"actuator_delay:rudder", "imu_bias:rates"} <= {e.key for e in effects if e.matters}
    for effect in effects:
        assert set(effect.matters) <= {p.name for p in effect.parameters}
        assert all(size > 0 for size in effect.matters.values())
        # what kinematics call too small to matter is no larger here
        name = effect.target if effect.target in MATTERS else effect.name
        assert all(size == pytest.approx(MATTERS.get(name, size), rel=0.05) for size in effect.matters.values())
