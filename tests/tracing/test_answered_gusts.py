"""Effects of surfaces in gusty air: what a controller that answers gusts makes of a lag is no name, and stands in no other's way."""

from types import SimpleNamespace

import numpy as np
import pytest
from kites import DEVELOPMENT
from tracing.fits import fitted

from awescli.notation.parameters import Parameter
from awescli.tracing import answered_gusts, investigate
from awescli.tracing import search as searching
from awescli.tracing.answered_gusts import SET_ASIDE, beside_answers, set_aside
from awescli.tracing.criteria import CRITERIA
from awescli.tracing.search import Round, Search
from awescli.tracing.tried import Tried

FRAME, BASE = SimpleNamespace(declared=DEVELOPMENT, answering=("rudder",)), fitted(0.0)
BASE.keys = ()
LAG, BIAS = "actuator_lag:rudder", "heading_bias"


def tried(key: str, gain: float, **how) -> Tried:
    model = fitted(gain)
    row = Parameter(f"{key}.tau", 0.03, "s", 0.0, 1.0)
    rows = {row.name: row, f"{key}.rate": Parameter(f"{key}.rate", 50.0, "rad/s"), f"{key}.inertia": Parameter(f"{key}.inertia", 0.1, "-")}
    model.keys, model.strengths, model.table = (key,), (row.name,), rows
    return Tried(SimpleNamespace(key=key, p_value=1e-9, drop=gain), True, "converged", model, gain, **how)


@pytest.mark.parametrize("lag, both, named", [
    (62.0, 121.0, True), (120.0, 175.0, True), (62.0, 85.0, False), (120.0, 140.0, False), (5.0, 57.0, True),
])  # fmt: skip
def test_what_gains_as_much_beside_a_lag_is_found_in_its_place(monkeypatch, lag, both, named):
    """Guards a heading bias in JSBSim's gusts: it gained 57, and a rudder that follows at once seemed 35 ms late, worth 62; both together
    gained 121. What has next to nothing to gain beside a rudder's lag may be that lag. A lag that gains nothing is not asked."""
    begun, ends = [], []

    def fit_added(frame, base, key, strengths, shapes):
        begun.append((base.keys, key, strengths, shapes))
        return fitted(both - 20.0)

    def fit_on(frame, model):
        ends.append(model)
        return fitted(both)

    monkeypatch.setattr(answered_gusts, "fit_added", fit_added)
    monkeypatch.setattr(answered_gusts, "fit_on", fit_on)
    found = [tried(LAG, lag), tried(BIAS, 57.0)]
    best = beside_answers(FRAME, BASE, [t.model for t in found], found, CRITERIA)
    assert (best is found[1].model) is named and (best is None) is not named
    started = ((BIAS,), LAG, {f"{LAG}.tau": 0.03}, {f"{LAG}.rate": 50.0, f"{LAG}.inertia": 0.1})
    assert begun == ([started] if lag > CRITERIA.decisive else [])
    # a quick fit that says enough is not fitted any further
    assert len(ends) == (both - 20.0 < lag + CRITERIA.in_gusts if begun else 0)


def test_what_gains_little_or_is_a_clear_lag_is_judged_as_ever():
    assert beside_answers(FRAME, BASE, [tried(BIAS, 29.0).model], [tried(LAG, 62.0), tried(BIAS, 29.0)], CRITERIA) is None
    assert beside_answers(FRAME, BASE, [tried(LAG, 62.0).model], [tried(LAG, 62.0)], CRITERIA) is None
    clear = tried(LAG, 151.0)
    assert beside_answers(FRAME, BASE, [clear.model, tried(BIAS, 57.0).model], [clear], CRITERIA) is clear.model


def test_a_surface_that_a_plan_moves_is_not_doubted():
    """Guards a trim motor in JSBSim's gusts: its elevator wanders by a plan, and its rate limit gained 64."""
    planned, steered = tried("actuator_lag:elevator", 64.0), tried(LAG, 64.0)
    assert [t.outcome for t in set_aside(FRAME, [planned, steered], CRITERIA)] == ["converged", SET_ASIDE]
    assert beside_answers(FRAME, BASE, [planned.model], [planned], CRITERIA) is planned.model


@pytest.mark.parametrize("gain, again, named", [
    (198.0, 172.0, False), (202.0, 64.0, False), (198.0, 30.0, True), (477.0, 128.0, True), (198.0, 0.0, True),
])  # fmt: skip
def test_a_lag_that_gusts_make_again_is_no_name(monkeypatch, gain, again, named):
    """Guards a rudder in JSBSim's gusts that follows at once: a lag of 40 ms gained 198, more than had been seen of any, and hardly less
    in the same flight flown again without it. It is no name, not even the first; and what else is there is found in its place."""
    monkeypatch.setattr("awescli.tracing.rest.gusts_of", lambda model: [SimpleNamespace(level=0.5)])
    monkeypatch.setattr(searching, "fit_on", lambda frame, model: model)
    monkeypatch.setattr(searching, "refined", lambda frame, model, criteria, partly: model)
    monkeypatch.setattr(searching, "admissible", lambda *given: True)
    monkeypatch.setattr(searching, "plausible", lambda model, key: True)
    monkeypatch.setattr(answered_gusts, "gain_under_null", lambda frame, here, tried: again)
    monkeypatch.setattr(answered_gusts, "fit_added", lambda frame, base, key, strengths, shapes: fitted(gain + 60.0))
    frame = SimpleNamespace(declared=DEVELOPMENT, answering=("rudder",), flights=())
    alone, _ = searching._best(frame, BASE, (tried(LAG, gain),), CRITERIA, lambda text: None)
    assert (alone is not None) is named
    best, _ = searching._best(frame, BASE, (tried(LAG, gain), tried(BIAS, 57.0)), CRITERIA, lambda text: None)
    assert best.keys == ((LAG,) if named else (BIAS,))


def test_controllers_are_asked_once_for_a_surface_and_not_far_beyond_gusts(monkeypatch):
    """Guards the time: the likeliest effect of a surface stands for all of them, and what gains five times what gusts make is none."""
    asked = []
    monkeypatch.setattr(answered_gusts, "gain_under_null", lambda frame, here, tried: asked.append(tried.key) or 100.0)
    frame = SimpleNamespace(declared=DEVELOPMENT, answering=("rudder", "elevator"), flights=())
    found = [tried("actuator_delay:rudder", 180.0), tried(LAG, 200.0), tried("actuator_lag:elevator", 1500.0), tried(BIAS, 300.0),
             tried("hinge_blowback:rudder", 90.0)]  # fmt: skip
    said = answered_gusts.with_gains_under_null(frame, BASE, found, CRITERIA)
    assert asked == [LAG] and [t.under_null for t in said] == [100.0, 100.0, 0.0, 0.0, 0.0]


def test_a_candidate_set_aside_contends_no_more():
    """Guards an answer in gusts against a lag beside it that was none: it would be "another effect that leads", what the lead of an answer
    is measured by, and its rival."""
    found = [tried(LAG, 105.0), tried("actuator_delay:rudder", 150.0), tried(BIAS, 57.0)]
    round_ = Round(BASE, set_aside(FRAME, found, CRITERIA), BIAS, ())
    assert [t.key for t in round_.contenders] == ["actuator_delay:rudder", BIAS]
    assert [(t.outcome, t.gain) for t in round_.tried][0] == (SET_ASIDE, 105.0)
    assert Search(BASE, BASE, (round_,)).set_aside == (LAG,)
    # it is fitted in nobody's place: not beside one answer, and not beside two
    final = tried(BIAS, 57.0).model
    assert investigate._ranked(Search(BASE, final, (round_,)))[0] == (LAG,)
    assert investigate._ranked(Search(BASE, final, (round_, round_))) == ((LAG,), ())


@pytest.mark.parametrize("level, least", [(0.5, 0.0), (0.1, 105.0)])
def test_no_lead_is_measured_by_a_lag_that_gusts_make(monkeypatch, level, least):
    """Guards an answer in gusts: a lag that is fitted beside it says nothing of how well forms are known."""
    bias, lag = tried(BIAS, 57.0), tried(LAG, 105.0)
    lag.model.keys = (BIAS, LAG)
    ends = iter([(bias.model, (bias,)), (lag.model, (lag,))])
    bias.model.train = BASE.train
    monkeypatch.setattr("awescli.tracing.rest.gusts_of", lambda model: [SimpleNamespace(level=level)])
    monkeypatch.setattr(searching, "screen", lambda frame, model, keys: SimpleNamespace(scores=(), untestable=()))
    monkeypatch.setattr(searching, "_race", lambda *given: ())
    monkeypatch.setattr(searching, "_best", lambda *given: next(ends))
    monkeypatch.setattr(searching, "slight", lambda frame, record, *rest: bool(record))
    monkeypatch.setattr(searching, "finer_than_samples", lambda model: False)
    found = searching.search(FRAME, BASE, (BIAS, LAG), rounds=2)
    assert [r.accepted for r in found.rounds] == [BIAS, ""] and found.passed_over == least


@pytest.mark.parametrize("level, first, kept", [(0.5, BIAS, (BIAS,)), (0.1, LAG, (LAG, BIAS))])
def test_the_search_sets_lags_aside_in_gusty_air_alone(monkeypatch, level, first, kept):
    monkeypatch.setattr("awescli.tracing.rest.gusts_of", lambda model: [SimpleNamespace(level=level)])
    monkeypatch.setattr(searching, "fit_on", lambda frame, model: model)
    monkeypatch.setattr(searching, "refined", lambda frame, model, criteria, partly: model)
    monkeypatch.setattr(searching, "admissible", lambda *given: True)
    monkeypatch.setattr(searching, "plausible", lambda model, key: True)
    monkeypatch.setattr(answered_gusts, "fit_added", lambda frame, base, key, strengths, shapes: fitted(160.0))
    # a bias that gains less than half of the lag is fitted to the end all the same, and both in their own order
    best, found = searching._best(FRAME, BASE, (tried(LAG, 110.0), tried(BIAS, 45.0)), CRITERIA, lambda text: None)
    assert best.keys == (first,) and tuple(t.key for t in found if t.model) == kept
    assert [t.finalist for t in found] == [True, level == 0.5]


def test_in_gusty_air_others_are_fitted_beside_the_surfaces(monkeypatch):
    """Guards kinds that came sixth behind five effects of the rudder (JSBSim): none of them was fitted, and none was there. How near others
    must come to be fitted any further is a matter among themselves."""
    reaches = {}

    def entered(frame, here, screening, score, sure, reach):
        reaches[score.key] = reach
        return tried(score.key, 200.0 if ":" in score.key else 45.0)

    keys = [f"{name}:rudder" for name in ("actuator_lag", "actuator_delay", "surface_backlash", "surface_dead_band", "hinge_blowback")]
    scores = tuple(
        SimpleNamespace(key=k, p_value=1e-30, drop=5.0 if k == BIAS else 100.0) for k in (*keys, "surface_effectiveness:rudder", BIAS)
    )
    screening = SimpleNamespace(scores=scores, rows={}, cosine=lambda a, b: 0.0)
    monkeypatch.setattr(searching, "_entered", entered)
    monkeypatch.setattr(searching, "fit_on_part", lambda frame, model: (frame, model))
    for level, fits in ((0.1, False), (0.5, True)):
        reaches.clear()
        monkeypatch.setattr("awescli.tracing.rest.gusts_of", lambda model, level=level: [SimpleNamespace(level=level)])
        searching._race(FRAME, BASE, screening, 0.0, CRITERIA, lambda text: None)
        assert (BIAS in reaches) is fits
    assert reaches[BIAS] == np.inf and reaches[keys[1]] < np.inf
