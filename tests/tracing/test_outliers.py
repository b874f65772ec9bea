"""Values that are far off for a moment: left out once a model is fitted, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest
from tracing.traced import null_model, with_errors

from awescli.estimation.outliers import outliers
from awescli.tracing.models import fit_null
from awescli.tracing.outliers import without_outliers


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
    assert "q" not in outliers([null.fit.flights[0], null.judged[0]])


def test_a_model_that_flies_no_loop_says_nothing_of_them():
    """Guards UMN's Thor: no validation loop counts under its declared model, and a trace ended there."""
    frame, null = null_model()
    lost = replace(null.judged[0], counted=np.zeros(0, int), information=replace(null.judged[0].information, _back=None))
    assert without_outliers(frame, replace(null, judged=(lost,)))[2] == {}
