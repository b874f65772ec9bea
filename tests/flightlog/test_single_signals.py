"""Errors of single signals by kinematics, against what was put in: told where they are, and nothing else in their place."""

from dataclasses import replace

import numpy as np
import pytest
from free_flight import free_flight
from injection import biased, turned, with_iron
from kites import flight
from sensors import ACCELERATION, POSITION, RATES, Sensors

from awescli.flightlog.reconstruction import single_signals
from awescli.flightlog.reconstruction.flight_path import reconstruct
from awescli.flightlog.reconstruction.identities import attitude_of_rates, velocity_of_acceleration
from awescli.flightlog.reconstruction.motion_of import motion_of
from awescli.flightlog.reconstruction.tables import said
from awescli.notation.errors import NumericalFailure

DEG = np.pi / 180
SCALED = {
    "a position": ({"p_n": 1.1}, 0.002), "a position in feet": (dict.fromkeys(POSITION[:2], 1 / 0.3048), 0.02),
    "a velocity": ({"v_n": 0.85}, 0.15), "an acceleration": ({"a_z": 1.15}, 0.2), "a gyro": ({"p": 0.9}, 0.15),
    "three gyros": (dict.fromkeys(RATES, 1.08), 0.15), "a roll angle": ({"phi": 1.08}, 0.1),
}  # fmt: skip
"""What is scaled, by how much; share of the error to which it is to be known."""
AIR = {"calm": {}, "rough": {"gusts": (0.3, 3.0), "attitude": (0.2 * DEG, 2.0), "outliers": 0.003, "gap": 1.5}}


@pytest.fixture(scope="module")
def true():
    """150 s of loops as they truly were."""
    return flight(3, 150.0).log


def scaled(log, factors):
    return replace(log, measured={**log.measured, **{n: f * log[n] for n, f in factors.items()}})


@pytest.mark.parametrize("air", AIR)
@pytest.mark.parametrize("what", SCALED)
def test_a_scale_is_told_and_nothing_in_its_place(true, what, air):
    """Guards against wrong names: a velocity that reads too much was an accelerometer that is off, a gyro two of them."""
    factors, known = SCALED[what]
    path = reconstruct(scaled(Sensors(**AIR[air]).record(true, 7), factors))
    assert [(e.name, e.acts_on) for e in path.findings] == [("scale", (n,)) for n in factors], path.findings
    for e in path.findings:
        assert e.size == pytest.approx(factors[e.acts_on[0]] - 1, rel=known), e


def test_a_gyro_that_is_off_by_a_constant_has_no_scale(true):
    """The yaw rate of a circle is nearly constant: its scale and its bias say much the same."""
    path = reconstruct(Sensors(bias={"r": 1.5 * DEG}).record(true, 7))
    assert [(e.name, e.acts_on[0]) for e in path.findings] == [("imu_bias", "r")], path.findings


def test_what_is_measured_after_it_is_compared_without_it(true):
    """Attitude is what velocity and acceleration are compared through: a roll angle of the wrong scale, taken out, leaves their errors."""
    log = scaled(Sensors(bias={"a_z": 1.2}).record(true, 7), {"phi": 1.08})
    assert {(e.name, e.acts_on[0]) for e in reconstruct(log).findings} == {("scale", "phi"), ("imu_bias", "a_z")}


def test_small_scales_are_not_told(true):
    """Nor is what they do to others: a roll angle that reads 2 % too little makes an accelerometer seem off."""
    path = reconstruct(scaled(Sensors().record(true, 7), {"p": 1.02, "p_e": 0.97, "phi": 0.98}))
    assert not path.findings, path.findings


def test_noise_of_a_small_motion_is_no_scale():
    """Guards against a wrong name: white noise of an angle is in what is compared and in the angle itself, and where an aircraft flies
    straight it passed for a pitch angle that reads too much."""
    log = free_flight(seconds=60.0, seed=3)
    path = reconstruct(log)
    assert np.std(log["theta"]) < 10 * DEG and not any(e.name == "scale" for e in path.errors), path.errors


@pytest.mark.parametrize("air", AIR)
@pytest.mark.parametrize("by", [5 * DEG, -8 * DEG])
@pytest.mark.parametrize("angle", ["phi", "theta"])
def test_an_angle_with_a_constant_added_is_told_and_nothing_in_its_place(true, angle, by, air):
    """Guards against wrong names: a pitch angle 5 deg off was an accelerometer that reads 19 % high, or a roll gyro that is off."""
    path = reconstruct(biased(angle, Sensors(**AIR[air]).record(true, 7), None, by)[0])
    assert [(e.name, e.acts_on) for e in path.findings] == [("attitude_bias", (angle,))], path.findings
    assert path.findings[0].size == pytest.approx(by, abs=0.3 * DEG)
    words = said(path.findings[0])
    assert words.startswith(f"{angle} off by {'-' if by < 0 else ''}") and ("IMU turned" in words) == (angle == "phi")


@pytest.mark.parametrize("by", [10 * DEG, -25 * DEG])
def test_a_heading_far_off_is_told_and_nothing_in_its_place(true, by):
    """Guards against a wrong name: what is linear in the heading left an accelerometer that is off."""
    path = reconstruct(biased("psi", Sensors().record(true, 7), None, by)[0])
    assert [e.name for e in path.findings] == ["heading_bias"] and path.findings[0].size == pytest.approx(by, abs=0.5 * DEG)


@pytest.mark.parametrize("by", [4 * DEG, -3 * DEG])
def test_iron_beside_a_compass_is_told(true, by):
    path = reconstruct(with_iron(Sensors().record(true, 7), None, by)[0])
    assert [e.name for e in path.findings] == ["compass_deviation"], path.findings
    assert path.findings[0].size == pytest.approx(abs(by), rel=0.1)
    assert "(compass deviation)" in said(path.findings[0])


@pytest.mark.parametrize("seed", range(3))
def test_an_attitude_that_drifts_is_off_by_nothing(true, seed):
    """Guards the room of a drift: of one of 1 deg that forgets in 20 s the mean over a flight of 150 s is 0.4 deg, by chance 1 deg."""
    path = reconstruct(Sensors(attitude=(1.0 * DEG, 20.0)).record(true, seed))
    assert not [e for e in path.findings if set(e.acts_on) & {"phi", "theta", "psi"}], path.findings


@pytest.mark.parametrize("axis", ["y", "z"])
@pytest.mark.parametrize(("names", "by"), [(RATES, 5 * DEG), (ACCELERATION, 8 * DEG)])
def test_a_sensor_that_is_turned_against_the_attitude_is_told(true, names, by, axis):
    path = reconstruct(turned(names, axis, Sensors().record(true, 7), None, by)[0])
    assert [(e.name, e.target, e.acts_on) for e in path.findings] == [("imu_misalignment", axis, tuple(names))], path.findings
    # of accelerations a drifting attitude leaves less certain what they are turned by
    assert path.findings[0].size == pytest.approx(by, rel=0.1 if names is RATES else 0.3)
    assert said(path.findings[0]).startswith(f"{', '.join(names)} turned about {axis} by ")


@pytest.mark.parametrize("build", [attitude_of_rates, velocity_of_acceleration])
def test_the_shape_of_an_offset_is_that_of_a_finite_difference(true, build):
    log, by = true, 1e-4
    before, after = (build(motion_of(biased("theta", log, None, sign * by)[0])) for sign in (-1, 1))
    motion = motion_of(log)
    found = (after.series.y - before.series.y) / (2 * by)
    begin = np.maximum.accumulate(np.where(motion.restart, np.arange(len(motion)), 0))
    shape = build(motion).singly["offset theta"]
    seen = before.series.seen & after.series.seen
    assert np.abs(shape)[seen].max() > 0.3
    np.testing.assert_allclose((found - found[begin])[seen], (shape - shape[begin])[seen], atol=0.02 * np.abs(shape[seen]).max())


def test_a_scale_in_words(true):
    path = reconstruct(scaled(Sensors().record(true, 7), {"p_n": 0.8}))
    assert [said(e).split(" % ")[1].split(" +- ")[0] for e in path.findings] == ["low against the velocity"]


def test_a_scale_that_cannot_be_solved_for_leaves_what_is_said_without(true, monkeypatch):
    """`solve` fails where a scale stands beside the biases: what they are without it is said, and no number of it."""
    plain = single_signals.solve

    def solve(identity):
        if any(c.startswith("scale ") for c in identity.series.columns):
            raise NumericalFailure("singular", "shapes cannot be distinguished", do="Look.")
        return plain(identity)

    monkeypatch.setattr(single_signals, "solve", solve)
    path = reconstruct(scaled(Sensors(bias={"psi": 3 * DEG}).record(true, 7), {"p_n": 1.2}))
    assert {e.name for e in path.findings} == {"heading_bias"} and not path.notes and not any(e.name == "scale" for e in path.errors)
