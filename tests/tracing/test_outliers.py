"""Values that are far off for a moment: left out once a model is fitted, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest
from tracing.traced import null_model

from awescli.tracing.frame import Frame
from awescli.tracing.models import fit_null
from awescli.tracing.outliers import _bursts, _off, outliers, without_outliers

N = np.nan


def with_errors(frame: Frame, errors) -> Frame:
    """The frame with `errors`: channel -> {sample: standard deviations of its noise} put into the log."""
    (flight,) = frame.flights
    measured, noise = dict(flight.log.measured), flight.declared.noise.channels()
    for name, those in errors.items():
        measured[name] = measured[name].copy()
        for row, size in those.items():
            measured[name][row] += size * noise[name][0]
    return replace(frame, flights=(replace(flight, log=replace(flight.log, measured=measured)),))


@pytest.mark.parametrize(
    "r, dt, off",
    [
        ([0, 1, -9, 1, 0], 0.02, [2]),
        ([-1, 8, -9, 7, 2], 0.02, [1, 2, 3]),
        ([9, 0, 0, 0, 12], 0.02, [0, 4]),  # at the ends of a segment there is one side to ask
        ([0, 8, -9, 7, 8, 0], 0.02, []),  # too long for a moment,
        ([0, 8, -9, 7, 8, 0], 0.01, [1, 2, 3, 4]),  # and not where samples are twice as close
        ([0, 1, 8, 7, 0, 1], 0.05, []),  # two samples of 20 Hz are a tenth of a second
        ([0, 3.5, 5, 9, 5, 3.5, 0], 0.02, []),  # with shoulders: that is how something flies
        ([0, 3.5, 0, 9, 0, 1], 0.02, []),
        ([0, 1, 9, 0, 3.5, 0], 0.02, []),
        ([0, N, 1, N, 8, N, -9, N, 0, N, 1], 0.02, []),  # two values of a sensor of 25 Hz are 40 ms apart and last 80
        ([0, N, 1, N, 8, N, 0, N, 0, N, 1], 0.02, [4]),
        ([0, 1, 5, -25, 8, 0], 0.02, [2, 3, 4]),  # noise that holds the farthest makes the nearest look usual
        ([0, 1, 5.9, 1, 0], 0.02, []),
    ],
)  # fmt: skip
def test_what_is_far_off_for_a_moment_with_good_values_on_either_side(r, dt, off):
    assert _off(np.array(r, float), dt).tolist() == off


RISING = np.linspace(-0.5, -8.0, 10)
"""What a drift makes of the residual before a burst of 16 standard deviations."""


def residual(**changes) -> np.ndarray:
    """Noise of five seconds at 50 Hz, with `changes`: a slice as text -> what is added there."""
    r = np.random.default_rng(5).standard_normal(250)
    for where, size in changes.items():
        r[slice(*map(int, where.strip("_").split("_")))] += size
    return r


@pytest.mark.parametrize(
    "changes, dt, off",
    [
        ({}, 0.02, []),
        ({"_100_120": 14.0}, 0.02, range(100, 120)),
        ({"_100_120": 14.0, "_150_155": -20.0}, 0.02, [*range(100, 120), *range(150, 155)]),
        # a drift goes along
        ({"_90_100": RISING, "_100_110": -RISING[::-1], "_110_120": -RISING, "_120_130": RISING[::-1]}, 0.02, range(100, 120)),
        ({"_240_250": 14.0}, 0.02, range(240, 250)),  # beyond the end of the segment it may go on
        ({"_0_30": 14.0}, 0.02, range(30)),
        ({"_100_250": 14.0}, 0.02, []),  # a step is no burst
        ({"_100_160": 14.0}, 0.02, []),  # nor is what stays for longer than a second,
        ({"_100_160": 14.0}, 0.01, range(100, 160)),  # which is as many samples more at twice the rate
        ({"_100_108": 14.0}, 0.05, range(100, 108)),
        ({"_100_108": 14.0}, 0.1, []),  # at 10 Hz a kite moves between two values
        ({"_100_140": 14.0 * np.sin(np.linspace(0.0, np.pi, 40))}, 0.02, []),  # as slowly as something flies
        ({"_0_250": 200.0, "_100_120": 14.0}, 0.02, []),  # where a model has run away
        # a position that is corrected twice, before it ends
        ({"_228_236": np.linspace(0.0, 5.0, 8), "_236_244": np.linspace(-5.0, 7.0, 8), "_244_250": -9.0}, 0.02, []),
        ({"_100_101": 14.0}, 0.02, []),  # a single value is not for this rule
    ],
)  # fmt: skip
def test_what_goes_off_at_once_and_comes_back_at_once(changes, dt, off):
    assert sorted(_bursts(residual(**changes), dt)) == list(off)


def test_of_a_slow_sensor_no_burst_is_told():
    slow = np.full(250, N)
    slow[::5] = residual(_100_150=14.0)[::5]
    assert _bursts(slow, 0.02).size == 0 and _bursts(np.full(250, N), 0.02).size == 0


@pytest.mark.parametrize("name, size", [("V_a", 20.0), ("p_e", -40.0), ("phi", 60.0)])
def test_a_burst_is_left_out_and_the_noise_is_what_it_was(name, size):
    """Guards dirty logs: an airspeed 6 m/s off for half a second was a sensor that drifts, and hid a drag; a roll angle 12 deg off made its
    noise four times what it was. No reader tells them by the signal alone."""
    frame, clean = null_model()
    rows = [int(first) + 30 for first in clean.problems[0].fitted.segments.first[:2]]
    dirty = with_errors(frame, {name: {row + k: size for row in rows for k in range(25)}})
    before = fit_null(dirty, {}, (1.0,))
    assert before.problems[0].factors.get(name, 1.0) > 1.2 or any("drift" in level for level in before.levels)
    left, model, many = without_outliers(dirty, before)
    assert many == {name: 50}
    assert model.problems[0].factors.get(name, 1.0) == pytest.approx(clean.problems[0].factors.get(name, 1.0), rel=0.1)
    assert not any("drift" in level for level in model.levels)


def test_they_are_left_out_and_the_noise_is_what_it_was():
    """Guards dirty logs: errors of 8 to 40 standard deviations, three of them in a row, that no reader tells by the signal alone, made the
    noise of a channel twice what it is, and a rudder's lag `unexplained`."""
    frame, clean = null_model()
    rows = np.r_[clean.problems[0].fitted.segments.first + 20, clean.problems[0].validation.segments.first + 31]
    errors = {
        "theta": {int(rows[0]) + k: size for k, size in enumerate((9.0, -40.0, 12.0))}, "a_z": {int(rows[1]): 8.0},
        "v_d": {int(rows[-1]): -15.0},
    }  # fmt: skip
    dirty = with_errors(frame, errors)
    before = fit_null(dirty, {}, (1.0,))
    assert before.problems[0].factors["theta"] > 1.25
    left, model, many = without_outliers(dirty, before)
    assert many == {name: len(those) for name, those in errors.items()}
    assert {name: np.flatnonzero(~left.flights[0].log.is_new(name)).tolist() for name in many} == {n: list(e) for n, e in errors.items()}
    assert model.problems[0].factors.get("theta", 1.0) == pytest.approx(clean.problems[0].factors.get("theta", 1.0), rel=0.05)
    std = np.sqrt(np.diag(clean.fit.covariance))
    assert np.abs((model.fit.solution.x - clean.fit.solution.x) / std).max() < 0.3


def test_gross_ones_drag_those_beside_them_along():
    """Guards dirty logs: of three velocities in a row 50 m/s off, which no reader tells, those on either side are some standard deviations
    off, and the noise is five times what it was."""
    frame, clean = null_model()
    first = int(clean.problems[0].fitted.segments.first[0]) + 20
    dirty = with_errors(frame, {"v_d": {first + k: 1000.0 * share for k, share in enumerate((1.0, 0.9, 1.1))}})
    before = fit_null(dirty, {}, (1.0,))
    _, model, many = without_outliers(dirty, before)
    assert before.problems[0].factors["v_d"] == 5.0 and many == {"v_d": 3}
    assert model.problems[0].factors.get("v_d", 1.0) == pytest.approx(clean.problems[0].factors.get("v_d", 1.0), rel=0.05)


@pytest.mark.parametrize("effects", [(), (("actuator_lag:rudder", (("tau", 0.2),)),), (("turbulence", (("sigma", 1.0), ("L", 150.0))),)],
                         ids=["clean", "lag", "gusts"])  # fmt: skip
def test_what_flies_is_no_outlier(effects):
    """Not what a model lacks, and not what gusts do."""
    frame, null = null_model(effects)
    assert without_outliers(frame, null) == (frame, null, {})


def test_what_is_off_all_the_time_is_noise_of_another_kind():
    """Guards a sensor with heavy tails: one value in ten off is not what happens now and then."""
    frame, clean = null_model()
    (flight,) = frame.flights
    dirty = with_errors(frame, {"q": dict.fromkeys(range(10, len(flight.log), 10), 12.0)})
    null = fit_null(dirty, {}, (1.0,))
    assert "q" not in outliers(null.fit.flights[0], null.judged[0])


def test_a_model_that_flies_no_loop_says_nothing_of_them():
    """Guards UMN's Thor: no validation loop counts under its declared model, and a trace ended there."""
    frame, null = null_model()
    lost = replace(null.judged[0], counted=np.zeros(0, int), information=replace(null.judged[0].information, _back=None))
    assert without_outliers(frame, replace(null, judged=(lost,)))[2] == {}
