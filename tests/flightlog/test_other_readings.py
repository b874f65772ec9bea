"""Signs, axes, units and clocks as hypotheses: the bundled flight changed in a known way is read as just that, and left alone as it is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from awescli.flightlog.consistency import consistency_checks
from awescli.flightlog.other_readings import reading_checks
from awescli.flightlog.read import read_flight
from awescli.notation.angles import wrap

DEMO = Path(__file__).parents[2] / "data" / "km1_demo"


@pytest.fixture(scope="module")
def log():
    return read_flight(DEMO)


def checks(log):
    return {c.name: c for c in reading_checks(log, np.ones(len(log), bool))}


def measured(log, **channels):
    return replace(log, measured={**log.measured, **channels})


def test_a_good_log_is_left_alone(log):
    found = checks(log)
    assert set(found) == {
        "axes of the rates", "nose against airflow", "clock rate", "airspeed scale", "wind against airspeed", "downwind",
    }  # fmt: skip
    assert all(c.ok and not c.stops for c in found.values())
    assert abs(found["clock rate"].value) < 0.05 and abs(found["airspeed scale"].value) < 0.01 and found["downwind"].value < 5


@pytest.mark.parametrize(
    "change, says",
    [
        (lambda s: {"q": s["r"], "r": s["q"]}, "p, q, r read as p, r, q"),
        (lambda s: {"r": -s["r"]}, "p, q, r read as p, q, -r"),
        (lambda s: {"p": s["q"], "q": s["r"], "r": s["p"]}, "p, q, r read as r, p, q"),
        (lambda s: {"theta": -s["theta"]}, "pitch angle of the other sign"),
        (lambda s: {"phi": -s["phi"]}, "roll angle of the other sign"),
    ],
)
def test_axes_and_signs_are_named(log, change, says):
    """Guards gyro axes that are exchanged and attitude signs: identities of the kinematics find the one reading that holds."""
    check = checks(measured(log, **change(log)))["axes of the rates"]
    assert not check.ok and check.stops and says in check.sentence


@pytest.mark.parametrize("long", [1.01, 0.97])
def test_a_clock_that_runs_long_is_measured(log, long):
    """Positions and velocities are what they were; each interval is said to be `long` times as long."""
    check = checks(replace(log, dt=log.dt * long, time=log.time * long))["clock rate"]
    assert check.value == pytest.approx(100 * (1 / long - 1), abs=0.1) and not check.ok and not check.stops
    assert "clock" in check.sentence


def test_a_late_position_is_no_wrong_clock(log):
    """Guards the measured flight whose position lags: 0.3 s late in loops of 8 s, the clock's rate stays what it is to 0.4 %."""
    n = int(round(0.3 / log.dt))
    late = {name: np.concatenate([np.repeat(log[name][:1], n), log[name][:-n]]) for name in ("p_n", "p_e", "p_d")}
    assert checks(measured(log, **late))["clock rate"].ok


@pytest.mark.parametrize("factor, unit", [(3600 / 1852, "kt"), (3.6, "km/h"), (1852 / 3600, "m/s that were taken for kt")])
def test_airspeed_in_another_unit_is_named(log, factor, unit):
    check = checks(measured(log, V_a=factor * log["V_a"]))["airspeed scale"]
    assert check.stops and unit in check.sentence and check.value == pytest.approx(factor - 1, abs=0.05 * factor)


@pytest.mark.parametrize(
    "read, says",
    [
        (lambda d: d + np.pi, "to which it blows"),
        (lambda d: np.deg2rad(np.mod(d, 2 * np.pi)), "in rad that was taken for deg"),
        (lambda d: np.pi / 2 - d, "from east, counter-clockwise"),
    ],
)
def test_a_wind_that_is_read_otherwise_is_named(log, read, says):
    check = checks(replace(log, wind=replace(log.wind, direction=read(log.wind.direction))))["wind against airspeed"]
    assert not check.ok and says in check.sentence


def test_north_and_east_exchanged_in_position_and_velocity(log):
    """Each agrees with the other, so only the nose and the wind tell."""
    swapped = {"p_n": log["p_e"], "p_e": log["p_n"], "v_n": log["v_e"], "v_e": log["v_n"]}
    check = checks(measured(log, **swapped))["nose against airflow"]
    assert not check.ok and "north and east exchanged" in check.sentence
    mirrored = {**swapped, "psi": wrap(np.pi / 2 - log["psi"])}
    assert any(c.stops for c in checks(measured(log, **mirrored)).values())


@pytest.mark.parametrize("every", [2, 5])
def test_thinned_logs_are_left_alone(log, every):
    cut = slice(None, None, every)
    thin = replace(
        log, dt=every * log.dt, time=log.time[cut], valid=log.valid[cut], causes={}, fresh={},
        measured={n: s[cut] for n, s in log.measured.items()}, inputs={n: s[cut] for n, s in log.inputs.items()},
    )  # fmt: skip
    assert all(c.ok for c in checks(thin).values())


def reeling(log):
    return next(c for c in consistency_checks(log, np.ones(len(log), bool)) if c.name == "reel-out speed against length")


@pytest.mark.parametrize(
    "factor, says",
    [(-1.0, "with the other sign"), (3.6, "in km/h"), (100.0, "in cm/s"), (1 / 0.3048, "in ft/s"), (-0.98, "with the other sign")],
)
def test_a_reel_out_speed_of_another_sign_or_unit_is_refused(log, factor, says):
    """Guards a slow winch, whose flipped sign stayed below the limit in m/s: a clock that is off was named in its place."""
    check = reeling(replace(log, inputs={**log.inputs, "reel_out_speed": factor * log["reel_out_speed"]}))
    assert not check.ok and check.stops and says in check.sentence


@pytest.mark.parametrize("factor", [1.0, 1.05, 0.8])
def test_a_reel_out_speed_that_is_a_little_off_is_not_refused(log, factor):
    check = reeling(replace(log, inputs={**log.inputs, "reel_out_speed": factor * log["reel_out_speed"]}))
    assert not check.stops and "Read" not in check.sentence
