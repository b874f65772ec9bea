"""The verdict is made of its criteria and of nothing else; probabilities are probabilities."""

import itertools
import random
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from awescli.estimation.processes.base import Group, Prior
from awescli.estimation.processes.drift import Drift
from awescli.tracing.classes import Rival
from awescli.tracing.criteria import CRITERIA
from awescli.tracing.evidence import AbsorbedEffect, BoundsLeft, Evidence
from awescli.tracing.rest import Repetition, Rest
from awescli.tracing.search import Search, crowded
from awescli.tracing.verdict import NULL, VERDICTS, Criterion, probabilities, reason, table, verdict
from awescli.tracing.when import Alone

ANSWER = ("effect_likelier", "effect_on_unseen_loops")
PREDICTS = "effect_predicts"
REST = ("rest_is_noise", "floor", "floor_by_channel", "sensors_plausible")
ALONE = ("no_better_empirical_term", "effect_leads", "effect_steady", "effect_constant", "signs_plausible", "bounds_hold")
OTHERS = ("no_rival", "all_candidates_fitted", "no_parameter_hides_it", "calm_air", *ALONE)
LITTLE, AGREE, PASS = "rest_is_small", "flights_agree", "sensors_steady"
REPEATS = ("rest_repeats", "rest_lasts", "gusts_do_not_repeat")
ROWS = {
    (name, passed): Criterion(name, 0.0, 0.0, passed, "", "")
    for name in (*NULL, *ANSWER, PREDICTS, LITTLE, AGREE, PASS, *REST, *REPEATS, *OTHERS)
    for passed in (True, False, None)
}


def rows(**passed: bool | None) -> list[Criterion]:
    """A table: a flight of a flawless model with nothing missing, but for what is said."""
    not_asked = dict.fromkeys((PREDICTS, LITTLE, AGREE, PASS, *REPEATS))
    clean = {**dict.fromkeys((*NULL, *REST, *OTHERS), True), **dict.fromkeys(ANSWER, False), **not_asked}
    return [ROWS[item] for item in {**clean, **passed}.items()]


FOUND = dict.fromkeys(ANSWER, True)
LEFT = dict.fromkeys(REST, False)


@pytest.mark.parametrize(
    "expected, passed",
    [
        ("none", {}),
        ("none", {"null_as_identified": None}),
        ("none", {"rest_is_noise": False}),  # model error is worth something, and yet nothing is left above the noise
        ("found", FOUND),
        ("found", {**FOUND, "calm_air": False}),
        ("found", {**FOUND, "calm_air": False, PREDICTS: True}),
        ("not_deterministic", {**FOUND, "calm_air": False, PREDICTS: False}),
        ("not_deterministic", {**FOUND, **LEFT, "calm_air": False, PREDICTS: False, "rest_repeats": False}),
        ("found", {**FOUND, "all_candidates_fitted": False}),
        ("cannot_tell", {**FOUND, "no_rival": False}),
        ("cannot_tell", {"all_candidates_fitted": False}),
        ("cannot_tell", {"no_parameter_hides_it": False}),
        ("none", {AGREE: True, PASS: True}),
        ("unexplained", {PASS: False}),
        ("not_deterministic", {PASS: False, "calm_air": False}),
        ("found", {**FOUND, PASS: False}),
        ("unexplained", {AGREE: False}),
        ("unexplained", {AGREE: False, "no_parameter_hides_it": False}),
        ("found", {**FOUND, AGREE: False}),
        ("unexplained", {**FOUND, "no_better_empirical_term": False}),
        ("unexplained", {**FOUND, LITTLE: False}),
        ("found", {**FOUND, LITTLE: True, "rest_repeats": True, "rest_is_noise": False}),
        ("unexplained", {**FOUND, "effect_steady": False}),
        ("unexplained", {**FOUND, "effect_constant": False}),
        ("unexplained", {**FOUND, "effect_leads": False}),
        ("unexplained", {**FOUND, "signs_plausible": False}),
        ("unexplained", {**FOUND, "bounds_hold": False}),
        ("none", {"signs_plausible": False}),
        ("none", {"bounds_hold": False}),
        ("none", {"effect_steady": False}),
        ("unexplained", LEFT),
        ("unexplained", {**FOUND, **LEFT}),
        ("unexplained", {**LEFT, "rest_repeats": True}),
        ("unexplained", {"rest_is_noise": False, "floor_by_channel": False}),
        ("not_deterministic", {**LEFT, "rest_repeats": False}),
        ("not_deterministic", {**LEFT, "rest_repeats": False, "rest_lasts": False}),
        ("unexplained", {**LEFT, "rest_repeats": False, "rest_lasts": True}),
        ("unexplained", {**FOUND, **LEFT, "rest_repeats": False}),
        ("unexplained", {**LEFT, "rest_repeats": False, "no_better_empirical_term": False}),
        ("not_deterministic", {"calm_air": False}),
        ("not_deterministic", {"calm_air": False, "gusts_do_not_repeat": True}),
        *(("unexplained", {**rest, "gusts_do_not_repeat": False}) for rest in ({}, FOUND, {**LEFT, "rest_repeats": False})),
        *(("not_testable", {**FOUND, name: False}) for name in NULL),
        *(("not_testable", {name: False}) for name in NULL),
    ],
)
def test_every_verdict_is_reached_by_its_table(expected, passed):
    """Guards the rules by hand-made tables; what stands in a row beside `passed`, and the rows' order, do not matter."""
    assert verdict(rows(**passed)) == expected
    other = [Criterion(c.name, random.random(), 1.0, c.passed, "other", "other") for c in rows(**passed)]
    assert verdict(other[::-1]) == expected


@pytest.mark.parametrize(
    "passed, said",
    [
        ({**FOUND, "effect_steady": False}, "its size drifts"),
        ({**FOUND, "effect_constant": False}, "its size changes with the way the kite flies"),
        ({**FOUND, "effect_leads": False}, "another effect"),
        ({**FOUND, "signs_plausible": False}, "a sign that hardly any aircraft has"),
        ({**FOUND, "bounds_hold": False}, "do not hold the truth"),
        ({**FOUND, "no_better_empirical_term": False}, "empirical terms"),
        ({**FOUND, "sensors_plausible": False}, "a sensor"),
        ({**FOUND, **LEFT}, "more than noise"),
        ({**FOUND, "gusts_do_not_repeat": False}, "no gust"),
    ],
)
def test_what_came_nearest_is_told_with_every_objection(passed, said):
    """Guards an `unexplained` that does not say why an effect which explains so much is no answer: the engineer would name it himself."""
    assert verdict(rows(**passed)) == "unexplained"
    told = reason(rows(**passed), "pitot_position")
    assert told.startswith("pitot_position comes nearest") and said in told
    drifts = reason(rows(**{**passed, "effect_steady": False}), "pitot_position")
    assert said in drifts and "its size drifts" in drifts
    assert reason(rows(**passed)) == "" and reason(rows(**LEFT), "pitot_position") == ""
    assert reason(rows(**FOUND), "pitot_position") == "" and reason(rows(), "pitot_position") == ""


def test_what_gusts_may_gain_as_well_is_told_without_a_name():
    """Guards against a silence that does not say what came nearest (JSBSim: a rudder that seemed late in gusts alone)."""
    gusty = rows(**{**FOUND, "calm_air": False, PREDICTS: False})
    assert reason(gusty, "actuator_lag:rudder").startswith("actuator_lag:rudder comes nearest, but gusts may gain as much")
    assert reason(rows(calm_air=False), "actuator_lag:rudder") == ""
    stepping = rows(**{PASS: False, "calm_air": False})
    assert reason(stepping).startswith("Beside gusts ") and reason(stepping).endswith("look at it.")


@pytest.mark.parametrize(
    "passed, said", [
        ({"sensors_plausible": False}, "the noise in the kite file too small"), ({"gusts_do_not_repeat": False}, "no gust"),
        ({PASS: False}, "Nothing but noise and drift is left"),
        ({AGREE: False}, "Trace that flight by itself"), ({**LEFT, AGREE: False, "rest_repeats": False}, "Trace that flight by itself"),
    ],
)  # fmt: skip
def test_unexplained_without_a_candidate_says_why(passed, said):
    """Guards an `unexplained` of a clean flight with a pitot three times as noisy as declared, which said nothing at all."""
    assert verdict(rows(**passed)) == "unexplained" and said in reason(rows(**passed))


def test_a_flight_that_is_not_testable_says_which_criterion_failed():
    failed = [Criterion("null_follows", 3.14159, 2.0, False, "chi-square", "") if c.name == "null_follows" else c for c in rows()]
    assert reason(failed) == "chi-square: 3.14 (at most 2)"


def test_what_holds_for_every_table():
    """Guards the promises of each verdict over all tables: `found` and `none` promise a null model that stands, a rest that is noise, and
    no other explanation; `none` also that every significant candidate was fitted (A2, A3, A4). Of those whose null model does not stand
    every 97th, its rows one by one: what else fails runs through all its values."""
    reached = set()
    names = (*ANSWER, *REST, *REPEATS, *OTHERS)
    nulls = [dict.fromkeys(NULL, True), *({**dict.fromkeys(NULL, True), name: False} for name in NULL)]
    every = [itertools.product((null,), *[(True, False)] * len(names)) for null in nulls]
    for null, *values in itertools.chain(every[0], *(itertools.islice(tables, k, None, 97) for k, tables in enumerate(every[1:]))):
        p = {**null, PREDICTS: None, LITTLE: None, AGREE: None, PASS: None, **dict(zip(names, values, strict=True))}
        said = verdict([ROWS[item] for item in p.items()])
        reached.add(said)
        stands = all(p[n] for n in NULL)
        at_floor = p["sensors_plausible"] and (p["rest_is_noise"] or (p["floor"] and p["floor_by_channel"]))
        effect = all(p[n] for n in ANSWER)
        assert (said == "not_testable") == (not stands)
        if said in ("found", "cannot_tell", "none"):
            assert at_floor
        if said == "found":
            assert effect and p["no_rival"] and all(p[n] for n in ALONE)
        if said == "none":
            assert not effect and p["all_candidates_fitted"] and p["no_parameter_hides_it"] and p["calm_air"]
        if said == "unexplained" and at_floor:
            assert (effect and not all(p[n] for n in ALONE)) or not p["gusts_do_not_repeat"]
    assert reached == set(VERDICTS)


def sensors(drift=0.0, factor=1.0):
    """A flight's problem with a drift of position [m] and a factor on the noise of tension."""
    group = Group("position drift", ("p_n",), drift, 6.0, Prior(0.5, 0.8), Prior(6.0))
    return SimpleNamespace(processes=(Drift((group,), 1.25),), factors={"tension": factor})


def model(deviance=0.0, keys=(), validation=0.0, flies=100, still_to_gain=0.0, rest=None, problem=None, chi2=1.0):
    """What a table needs to know of a model: two segments, one strength for each key."""
    fitted = SimpleNamespace(solution=SimpleNamespace(outcome="no_progress"), still_to_gain=still_to_gain)
    return SimpleNamespace(
        keys=tuple(keys), strengths=tuple(f"{k}.k" for k in keys), deviance=deviance,
        validation=np.array([validation, 0.0]), unseen=validation, flies=flies, chi2=chi2,
        segments=100, fit=fitted, rest=rest or {}, problems=(problem or sensors(),),
    )  # fmt: skip


MANY = 10**10  # samples: nothing is left of chance
GUSTY = {"vertical gusts": 0.5}
NOISE = Rest(0.0, 1.0, {"p": 1.01, "tension": 0.99}, {}, None, MANY)
NULL_MODEL = model(1000.0, validation=300.0, rest={"force_z": 0.3})


def evidence(answer=None, null=NULL_MODEL, bare=None, rest=NOISE, failed=(), beside=None, **more) -> Evidence:
    """Evidence of a search that ended with `answer` (default: with nothing); failed: significant candidates that could not be fitted;
    beside: gain of an implausible one that was fitted too."""
    bare = bare or model(1200.0, validation=400.0)
    tried = [SimpleNamespace(key=k, significant=True, outcome="failed", model=None, gain=0.0) for k in failed]
    if answer is not None:
        gain = null.deviance - answer.deviance
        tried.append(SimpleNamespace(key=answer.keys[-1], significant=True, outcome="converged", model=answer, gain=gain))
    if beside is not None:
        tried.append(SimpleNamespace(key="air_density", significant=True, outcome="converged", model=bare, gain=beside))
    contenders = [t for t in tried if t.model is not None]
    record = SimpleNamespace(base=null, tried=tried, contenders=contenders, accepted=answer.keys[-1] if answer else "")
    return Evidence(Search(null, answer or null, (record,)), bare, answer or bare, rest, **more)


def passed(e: Evidence) -> dict:
    return {c.name: c.passed for c in table(e)}


GOOD = model(900.0, ("sideslip_drag",), validation=250.0)
LARGE = model(600.0, ("sideslip_drag",), validation=100.0)
AGAIN = Repetition({"force_z": 0.5}, {"force_z": 0.001}, 8)
SMALL, CLEAR, ALMOST_SURE, SURE = (model(deviance, ("sideslip_drag",), validation=250.0) for deviance in (970.1, 970.0, 850.1, 850.0))
LATE, CLEARLY_LATE = (model(deviance, ("actuator_lag:rudder",), validation=250.0) for deviance in (850.1, 850.0))


def test_a_table_has_every_row_with_its_threshold_and_source():
    """Guards the public table: all rows, each with what it says and where its threshold comes from."""
    found = table(evidence(GOOD))
    assert {c.name for c in found} == {name for name, _ in ROWS} and len(found) == 29
    assert all(c.says and c.source for c in found) and verdict(found) == "found"


@pytest.mark.parametrize(
    "name, good, bad",
    [
        ("sensors_agree", {}, {"contradictions": ("rates late by 0.0402 s against the attitude +- 0.0006",)}),
        ("null_flew", {"null": model(1000.0, flies=90)}, {"null": model(1000.0, flies=89)}),
        ("null_converged", {"null": model(1000.0, still_to_gain=0.9e-3)}, {"null": model(1000.0, still_to_gain=1.1e-3)}),
        ("null_converged", {}, {"null": model(1000.0, still_to_gain=np.inf)}),
        ("null_follows", {"null": model(1000.0, chi2=1.9)}, {"null": model(1000.0, chi2=2.1)}),
        ("null_follows", {}, {"null": model(1000.0, chi2=-70.0)}),
        ("null_near", {"bare": model(1200.0, chi2=999.0)}, {"bare": model(1200.0, chi2=1001.0)}),
        ("null_as_identified", {"null_error": 0.0124, "identified_error": 0.01}, {"null_error": 0.0126, "identified_error": 0.01}),
        ("effect_likelier", {"answer": model(987.9, ("a",), 250.0)}, {"answer": model(988.1, ("a",), 250.0)}),
        ("effect_on_unseen_loops", {"answer": GOOD}, {"answer": model(900.0, ("a",), 300.5)}),
        ("sensors_plausible", {"bare": model(1200.0, problem=sensors(2.4))}, {"bare": model(1200.0, problem=sensors(2.6))}),
        ("sensors_plausible", {"bare": model(1200.0, problem=sensors(0.0, 2.9))}, {"bare": model(1200.0, problem=sensors(0.0, 3.1))}),
        ("sensors_plausible", {"bare": model(1200.0, problem=sensors(0.6)), "drift_offsets": {"position drift": (2.4, "p_n is off")}},
         {"bare": model(1200.0, problem=sensors(0.6)), "drift_offsets": {"position drift": (2.6, "p_n is off")}}),
        ("rest_is_noise", {"rest": Rest(19.9, 1.0, {}, {}, None, MANY)}, {"rest": Rest(20.1, 1.0, {}, {}, None, MANY)}),
        ("floor", {"rest": Rest(50.0, 1.019, {}, {}, None, MANY)}, {"rest": Rest(50.0, 1.021, {}, {}, None, MANY)}),
        ("floor_by_channel", {"rest": Rest(50.0, 1.0, {"p": 1.09}, {}, None, MANY)},
         {"rest": Rest(50.0, 1.0, {"p": 1.0, "q": 1.11}, {}, None, MANY)}),
        *(
            ("rest_is_small", {"answer": LARGE, "rest": Rest(39.0, 1.0, {}, {}, *on, MANY, *goes)},
             {"answer": LARGE, "rest": Rest(41.0, 1.0, {}, {}, *on, MANY, *goes)})
            for on, goes in (((AGAIN,), ()), ((None,), (AGAIN,)))
        ),
        (
            "rest_repeats", {"rest": Rest(50.0, 2.0, {}, {}, Repetition({"force_z": 0.5}, {"force_z": 0.001}, 8), MANY)},
            {"rest": Rest(50.0, 2.0, {}, {}, Repetition({"force_z": 0.5}, {"force_z": 0.02}, 8), MANY)},
        ),
        (
            "rest_lasts", {"rest": Rest(50.0, 2.0, {}, {}, None, MANY, Repetition({"force_z": 0.5}, {"force_z": 0.001}, 8))},
            {"rest": Rest(50.0, 2.0, {}, {}, None, MANY, Repetition({"force_z": 0.19}, {"force_z": 0.001}, 8))},
        ),
        ("no_rival", {"answer": GOOD}, {"answer": GOOD, "rivals": {"sideslip_drag": (Rival("parasitic_drag", model(903.0), 3.0),)}}),
        ("all_candidates_fitted", {}, {"failed": ("pitch_curvature",)}),
        (AGREE, {"alone": ()}, {"alone": (Alone("second", "airspeed_scale", 72.0),)}),
        (PASS, {"drift_steps": {"V_a": 9.9, "psi": 3.0}}, {"drift_steps": {"V_a": 3.0, "psi": 10.1}}),
        ("no_parameter_hides_it", {}, {"absorbed": (AbsorbedEffect("surface_bias:yaw", "Cndr", 9.0, GOOD),)}),
        (
            "no_better_empirical_term", {"answer": GOOD, "empirical": Search(NULL_MODEL, model(891.0, ("custom_term:f_x*beta",)), ())},
            {"answer": GOOD, "empirical": Search(NULL_MODEL, model(889.0, ("custom_term:f_x*beta",)), ())},
        ),
        *(
            ("effect_predicts", {"answer": a, "gusts": GUSTY, "error_ratio": 0.89}, {"answer": a, "gusts": GUSTY, "error_ratio": 0.91})
            for a in (SMALL, LATE)
        ),
        *(
            ("effect_predicts", {"answer": a, "gusts": GUSTY, "error_ratio": 0.97}, {"answer": a, "gusts": GUSTY, "error_ratio": 0.99})
            for a in (CLEAR, ALMOST_SURE)
        ),
        ("effect_leads", {"answer": GOOD, "beside": 109.0}, {"answer": GOOD, "beside": 111.0}),
        ("effect_steady", {"answer": GOOD, "steadiness": 2e-4}, {"answer": GOOD, "steadiness": 5e-5}),
        ("effect_constant", {"answer": GOOD, "along": {"V_a": 3.0, "a_y": 99.0}}, {"answer": GOOD, "along": {"V_a": 3.0, "a_y": 101.0}}),
        ("signs_plausible", {"answer": GOOD}, {"answer": GOOD, "doubted": ("Cma",)}),
        ("bounds_hold", {"answer": GOOD, "bounds_left": BoundsLeft("sideslip_drag", ("CD0",), 910.5)},
         {"answer": GOOD, "bounds_left": BoundsLeft("sideslip_drag", ("CD0",), 909.5)}),
        ("calm_air", {"gusts": {"vertical gusts": 0.19}}, {"gusts": {"vertical gusts": 0.21}}),
        (
            "gusts_do_not_repeat", {"gusts": GUSTY, "gusts_repeat": Repetition({"gust_d": 0.19}, {"gust_d": 0.001}, 8)},
            {"gusts": GUSTY, "gusts_repeat": Repetition({"gust_d": 0.21}, {"gust_d": 0.001}, 8)},
        ),
        (
            "gusts_do_not_repeat", {"answer": LARGE, "gusts": GUSTY, "gusts_repeat": replace(AGAIN, worth=39.0)},
            {"answer": LARGE, "gusts": GUSTY, "gusts_repeat": replace(AGAIN, worth=41.0)},
        ),
    ],
)  # fmt: skip
def test_every_row_fails_beyond_its_threshold(name, good, bad):
    """Guards that each criterion is tested at all: just inside it passes, just outside it does not."""
    assert passed(evidence(**good))[name] is True and passed(evidence(**bad))[name] is False


def test_what_a_flight_does_not_allow_to_test_is_neither_passed_nor_failed():
    found = passed(evidence())
    assert found["null_as_identified"] is None and found["rest_repeats"] is None and found["gusts_do_not_repeat"] is None
    assert found["effect_predicts"] is None
    calm = {"vertical gusts": 0.1}
    for answer, gusts in ((SMALL, calm), (LATE, calm), (SURE, GUSTY), (CLEARLY_LATE, GUSTY)):
        assert passed(evidence(answer, gusts=gusts, error_ratio=1.1))["effect_predicts"] is None
    # what does not repeat may be as large as it likes, and what is too little to be seen repeats by chance
    for rest in (Rest(50.0, 1.0, {}, {}, replace(AGAIN, p={"force_z": 0.02}), MANY), Rest(19.0, 1.0, {}, {}, AGAIN, MANY)):
        assert passed(evidence(GOOD, rest=rest))["rest_is_small"] is None
    little = evidence(gusts={"vertical gusts": 0.1}, gusts_repeat=Repetition({"gust_d": 0.9}, {"gust_d": 0.001}, 8))
    assert passed(little)["gusts_do_not_repeat"] is None


def test_more_empirical_terms_than_effects_do_not_beat_them():
    """Guards a name against terms that only are more: two terms lead one effect by 100, and are no reason."""
    more = Search(NULL_MODEL, model(800.0, ("custom_term:f_x*beta", "custom_term:m_y*beta")), ())
    assert passed(evidence(GOOD, empirical=more))["no_better_empirical_term"] is True


def test_more_names_than_empirical_terms_must_be_worth_it():
    """Guards against names that only mend the form of another one: three effects that two empirical terms lead, be it by little, are not
    found (a rudder rigged beside neutral, flown by JSBSim: surface_bias, load_cell_scale and reynolds_drag)."""
    three = model(900.0, ("surface_bias:yaw", "load_cell_scale", "reynolds_drag"), validation=250.0)
    for terms, holds in ((894.0, False), (901.0, True)):
        two = Search(NULL_MODEL, model(terms, ("custom_term:m_z*1", "custom_term:f_y*1")), ())
        assert passed(evidence(three, empirical=two))["no_better_empirical_term"] is holds, terms


RIVALLED = {"sideslip_drag": (Rival("parasitic_drag", model(901.0), 1.0),)}


@pytest.mark.parametrize(
    "e, answer, likeliest",
    [
        (evidence(), "none", "none"),
        (evidence(null=model(1195.0), bare=model(1195.0)), "none", "none"),
        (evidence(GOOD), "found", "sideslip_drag"),
        (evidence(GOOD, rivals=RIVALLED), "cannot_tell", "sideslip_drag"),
        (evidence(GOOD), "unexplained", "something_else"),
        (evidence(), "not_testable", "something_else"),
        (evidence(), "not_deterministic", "something_else"),
    ],
)
def test_probabilities_are_probabilities(e, answer, likeliest):
    """Guards their sum, that something else is never ruled out, and that the answer is the likeliest cause."""
    found = probabilities(e, answer)
    assert sum(found.values()) == pytest.approx(1.0) and all(0 <= p <= 1 for p in found.values())
    assert found["something_else"] >= 0.99 * CRITERIA.unknown and "none" in found
    assert next(iter(found)) == likeliest == max(found, key=found.get)


def test_a_lead_becomes_odds_at_the_temperature():
    """Guards the arithmetic: two explanations 10 apart in deviance have odds of exp(10 / 2 / temperature)."""
    rivals = {"sideslip_drag": (Rival("parasitic_drag", model(910.0), 10.0),)}
    found = probabilities(evidence(GOOD, rivals=rivals), "cannot_tell")
    assert found["sideslip_drag"] / found["parasitic_drag"] == pytest.approx(np.exp(10.0 / 2 / CRITERIA.temperature))


def test_what_gusts_may_gain_as_well_is_hardly_likelier():
    """Guards against a name at 97 % beside a verdict that gives none."""
    said = evidence(model(941.0, ("actuator_lag:rudder",), 282.0), gusts=GUSTY, error_ratio=0.97)
    assert verdict(table(said)) == "not_deterministic" and max(probabilities(said, "not_deterministic").values()) < 0.7


def test_what_is_unexplained_has_most_likely_no_name():
    """Guards the probability that is said of `unexplained`: a library's effect that leads by hundreds, but leaves too much, is not the
    cause with one half."""
    found = probabilities(evidence(model(500.0, ("pitch_curvature",), 100.0)), "unexplained")
    assert found["something_else"] > 0.9


def test_a_race_is_crowded_where_many_gain_alike():
    """Guards the look back at the declared model: three that gain about the same have in common what they gain by; one or two that lead do
    not, nor do candidates that were never fitted."""

    def tried(*gains):
        return [SimpleNamespace(gain=g, model=object()) for g in gains] + [SimpleNamespace(gain=0.0, model=None)] * 3

    assert crowded(tried(490.0, 488.0, 470.0, 3.0)) and crowded(tried(470.0, 300.0, 490.0))
    assert not crowded(tried(490.0, 480.0, 20.0)) and not crowded(tried(490.0)) and not crowded(tried())
