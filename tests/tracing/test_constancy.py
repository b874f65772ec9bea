"""An effect whose size drifts through a flight is not the one that has a size."""

from dataclasses import replace

import numpy as np
import pytest
from tracing.traced import short_flight, traced_flight

from awescli.tracing import constancy
from awescli.tracing.constancy import gains_along, steadiness
from awescli.tracing.criteria import CRITERIA

DELAY = 0.1


@pytest.fixture(scope="module")
def found():
    """A flight whose set-points were logged 0.1 s before they acted, and what a trace makes of it."""
    declared, log, parts = short_flight({}, seed=31, duration=60.0)
    early = np.interp(log.time + DELAY, log.time, log["rudder"])
    read = replace(log, inputs={**log.inputs, "rudder": early})
    return traced_flight(declared, read, parts, 3.0, candidates=("actuator_delay:rudder", "sideslip_drag"), curriculum=(1.0,))


def drifting(model, by: float):
    """The model on loops on which its effect would have grown by `by` from the middle of the flight to its end, and shrunk as much to its
    beginning, to first order."""
    (fit,) = model.fit.flights
    gram, i, n = fit.gram, fit.names.index(model.strengths[0]), len(fit.names)
    begins = fit.misfit.begins
    more = by * (2 * (begins - begins.min()) / np.ptp(begins) - 1)
    xy, y = gram.xy.copy(), gram.y.copy()
    xy[..., -1] += more[:, None, None] * gram.xy[..., i]
    y[:, n, n] += 2 * more * gram.y[:, i, n] + more**2 * gram.y[:, i, i]
    y[:, :n, n] += more[:, None] * gram.y[:, :n, i]
    y[:, n, :n] = y[:, :n, n]
    return replace(model, fit=replace(model.fit, flights=(replace(fit, gram=replace(gram, xy=xy, y=y)),)))


def test_a_size_that_stays_is_steady(found):
    """Guards true effects: a delay that was the same all through is found, and its criterion far from its threshold."""
    account, finding = found
    assert account["verdict"] == "found" and [e["name"] for e in account["effects"]] == ["actuator_delay"]
    assert steadiness(finding.evidence.model) > 100 * CRITERIA.steady


def test_a_size_that_drifts_is_not(found):
    """Guards names against what changes with time (a pitot that clogs was called one that reads low): the probability falls as the drift
    grows, below the threshold for one that takes the effect from nothing to twice its size."""
    _, finding = found
    model = finding.evidence.model
    seen = [steadiness(drifting(model, by)) for by in (0.0, 0.25 * DELAY, 0.5 * DELAY, DELAY)]
    assert seen == sorted(seen, reverse=True) and seen[0] == pytest.approx(steadiness(model))
    assert seen[-1] < CRITERIA.steady


def test_what_integrating_out_adds_is_no_drift(found):
    """Guards true effects in gusts (three of 24 blind flights were `unexplained` for it): what a fit's minimum owes to the log determinant
    of the nuisances, as much in every segment, is not there where only residuals are asked. Taken off both of them, it changes nothing."""
    _, finding = found
    model = finding.evidence.model
    (fit,) = model.fit.flights
    n, slope = len(fit.names), 3.0 * np.sqrt(np.diag(fit.information.H))
    y = fit.gram.y.copy()
    y[fit.counted, :n, n] -= slope / len(fit.counted)
    y[fit.counted, n, :n] = y[fit.counted, :n, n]
    other = replace(fit, gram=replace(fit.gram, y=y), slope=fit.slope + slope)
    late = fit.misfit.begins[fit.counted]
    assert late.mean() != pytest.approx((late.min() + late.max()) / 2)  # segments are not spread evenly
    assert steadiness(replace(model, fit=replace(model.fit, flights=(other,)))) == pytest.approx(steadiness(model), rel=1e-6)


def test_what_integrating_out_adds_in_some_loops_only_is_no_drift(found, monkeypatch):
    """Guards effects that act in some loops of a gusty flight (a stall of which all was there was `unexplained`, its size said to drift):
    what a fit's minimum owes to the log determinant stands in those loops. Put into the latest of them alone it looks like a drift, until
    each segment is asked for its own."""
    _, finding = found
    model = finding.evidence.model
    (fit,) = model.fit.flights
    i, n = fit.names.index(model.strengths[0]), len(fit.names)
    late = fit.misfit.begins[fit.counted]
    each = np.where(late > np.quantile(late, 0.7), 10 * np.sqrt(fit.information.H[i, i]) / len(late), 0.0)
    y, slope = fit.gram.y.copy(), fit.slope.copy()
    y[fit.counted, i, n] -= each
    y[fit.counted, n, i] = y[fit.counted, i, n]
    slope[i] += each.sum()
    other = replace(fit, gram=replace(fit.gram, y=y), slope=slope)
    there = replace(model, fit=replace(model.fit, flights=(other,)))
    monkeypatch.setattr(constancy, "differences", lambda *of: None)
    assert steadiness(there) < CRITERIA.steady
    monkeypatch.setattr(constancy, "differences", lambda *of: np.outer([-2.0, 2.0], each) * of[-1].sum())
    assert steadiness(there) == pytest.approx(steadiness(model), rel=1e-3)


def test_an_answer_without_effects_is_steady(found):
    _, finding = found
    assert steadiness(finding.null) == 1.0


def going_with(model, channel: str, by: float):
    """The model on loops on which its effect would have grown by `by` for each standard deviation of a channel, to first order."""
    (fit,) = model.fit.flights
    links, observed = fit.misfit.links(fit.parameters.vector(fit.names), fit.own)[0], fit.misfit.observed
    course = observed.measured[..., observed.outputs.index(channel)]
    column = links.J[..., links.ends.shape[3] + fit.names.index(model.strengths[0])]
    grown = replace(observed, measured=observed.measured + by * ((course - course.mean()) / course.std())[..., None] * column)
    return replace(model, fit=replace(model.fit, flights=(replace(fit, misfit=replace(fit.misfit, observed=grown)),)))


def test_a_size_that_stays_goes_with_no_channel(found):
    _, finding = found
    gains = gains_along(finding.evidence.model)
    assert set(gains) == set(finding.evidence.model.fit.flights[0].misfit.observed.outputs)
    assert max(gains.values()) < 0.3 * CRITERIA.constant


@pytest.mark.parametrize("channel", ["V_a", "a_y"])
def test_a_size_that_goes_with_a_channel_is_seen_there(found, channel):
    """Guards names against what changes with the way the kite flies (a gyro that feels acceleration was called a bias): the gain grows with
    the square of the change, and is the largest, but for channels that go the same way, with the channel that it goes with."""
    _, finding = found
    model = finding.evidence.model
    little, more = (gains_along(going_with(model, channel, by)) for by in (0.5 * DELAY, DELAY))
    assert more[channel] > CRITERIA.constant and more[channel] > 0.9 * max(more.values())
    assert more[channel] == pytest.approx(4 * little[channel], rel=0.2)


def test_what_integrating_out_adds_goes_with_no_channel(found):
    """Guards true effects in gusts (a load cell's scale was `unexplained`, its zero said to go with tension, which is the scale): a course
    that does what a parameter does has what integrating the nuisances out adds to that one."""
    _, finding = found
    model = finding.evidence.model
    (fit,) = model.fit.flights
    i, n = fit.names.index(model.strengths[0]), len(fit.names)
    size = 10 * np.sqrt(fit.information.H[i, i])
    y, slope = fit.gram.y.copy(), fit.slope.copy()
    y[fit.counted, i, n] -= size / len(fit.counted)
    y[fit.counted, n, i] = y[fit.counted, i, n]
    slope[i] += size
    other = replace(fit, gram=replace(fit.gram, y=y), slope=slope)
    (_, strengths, prior) = next(constancy._fits(model))
    same = constancy._grown(other.gram, strengths, np.full(len(fit.gram), 0.5))
    info = fit.misfit.eliminated(same, fit.own, fit.counted)
    alike, without = (constancy._gain(other, info, prior, slice(n, None), *of) for of in ([], [np.zeros(1)]))
    assert alike < 1 and without > 100


@pytest.mark.parametrize("with_slope, without", [(134.0, 5.0), (1.0, 37.0)])
def test_a_size_goes_with_a_channel_only_if_both_ways_say_so(found, monkeypatch, with_slope, without):
    """Guards true effects in weak gusts (a pitot's scale was `unexplained`, said to go with tension by what was added, not by what was
    seen): what integrating the nuisances out adds is known of a size, not of one that goes with a channel."""
    monkeypatch.setattr(constancy, "_gain", lambda *of: with_slope if of[-1] is None else without)
    assert set(gains_along(found[1].evidence.model).values()) == {min(with_slope, without)}


def test_an_answer_without_effects_goes_with_nothing(found):
    _, finding = found
    assert gains_along(finding.null) == {}
