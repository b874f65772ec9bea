"""Exact scoring: the one right effect on the right target, and nothing else."""

import pytest
from exact_scoring import OUTCOMES, Answer, Truth, answer_of, counted, outcome

LAG = Truth("library", ("actuator_lag:rudder",))
NOISE = Truth("library", ("airspeed_scale", "airspeed_lag"))
PAIR = Truth("library", ("actuator_lag:rudder + airspeed_scale",))
OUTSIDE, CLEAN, GUSTY = Truth("outside"), Truth("clean"), Truth("clean", gusty=True)

RUDDER, ELEVATOR = ("actuator_lag", "rudder"), ("actuator_lag", "elevator")
DELAY, SCALE, LOAD = ("actuator_delay", "rudder"), ("airspeed_scale", "report"), ("load_cell_scale", "report")


def said(verdict: str, *named):
    """An answer; each of `named` an effect, or a list of an effect and its rivals."""
    return Answer(verdict, tuple(tuple(n) if isinstance(n, list) else (n,) for n in named))


@pytest.mark.parametrize(
    "truth, answer, expected",
    [
        (LAG, said("found", RUDDER), "right"),
        (LAG, said("found", ELEVATOR), "wrong"),  # the right name on the wrong target
        (LAG, said("found", DELAY), "wrong"),
        (LAG, said("found", RUDDER, SCALE), "wrong"),  # a further name
        (LAG, said("found"), "wrong"),
        (LAG, said("cannot_tell", [DELAY, RUDDER]), "among rivals"),
        (LAG, said("cannot_tell", [RUDDER, DELAY]), "among rivals"),
        (LAG, said("cannot_tell", [DELAY, ELEVATOR]), "wrong"),
        (LAG, said("cannot_tell", [RUDDER, DELAY], SCALE), "wrong"),
        (LAG, said("unexplained"), "unexplained"),
        (LAG, said("unexplained", RUDDER), "unexplained"),
        (LAG, said("unexplained", SCALE), "wrong"),
        (LAG, said("none"), "silent"),
        (LAG, said("not_deterministic"), "silent"),
        (LAG, said("not_testable"), "silent"),
        (LAG, said("failed"), "failed"),
        (NOISE, said("found", SCALE), "right"),
        (NOISE, said("found", ("airspeed_lag", "report")), "right"),
        (NOISE, said("found", SCALE, ("airspeed_lag", "report")), "wrong"),
        (PAIR, said("found", SCALE, RUDDER), "right"),
        (PAIR, said("found", SCALE), "wrong"),
        (PAIR, said("found", RUDDER, RUDDER), "wrong"),
        (PAIR, said("cannot_tell", [LOAD, SCALE], RUDDER), "among rivals"),
        (PAIR, said("cannot_tell", [RUDDER, SCALE]), "wrong"),  # one entry cannot be both
        (OUTSIDE, said("unexplained"), "right"),
        (OUTSIDE, said("unexplained", SCALE), "wrong"),
        (OUTSIDE, said("found", SCALE), "wrong"),
        (OUTSIDE, said("cannot_tell", [SCALE, LOAD]), "wrong"),
        (OUTSIDE, said("cannot_tell"), "silent"),
        (OUTSIDE, said("none"), "silent"),
        (OUTSIDE, said("not_deterministic"), "silent"),
        (CLEAN, said("none"), "right"),
        (CLEAN, said("not_deterministic"), "false alarm"),
        (CLEAN, said("unexplained"), "false alarm"),
        (CLEAN, said("cannot_tell", [SCALE, LOAD]), "wrong"),
        (CLEAN, said("not_testable"), "silent"),
        (GUSTY, said("not_deterministic"), "right"),
        (GUSTY, said("none"), "right"),
        (GUSTY, said("unexplained"), "false alarm"),
        (GUSTY, said("not_deterministic", SCALE), "wrong"),
    ],
)
def test_outcomes(truth, answer, expected):
    assert outcome(truth, answer) == expected and expected in OUTCOMES


def test_reads_effects_json():
    told = {
        "verdict": "cannot_tell",
        "effects": [{"name": "mass_offset", "acts_on": "body", "rivals": [{"name": "Cm_0", "acts_on": "parameter"}], "parameters": {}}],
    }
    answer = answer_of(told)
    assert answer == Answer("cannot_tell", ((("mass_offset", "body"), ("Cm_0", "parameter")),))
    assert answer.first == [("mass_offset", "body")]
    assert answer_of({"verdict": "failed"}) == Answer("failed")


def test_counts_in_the_order_of_the_columns():
    assert counted(["wrong", "right", "right"]) == [2 if o == "right" else 1 if o == "wrong" else 0 for o in OUTCOMES]


def test_the_projects_own_campaign_scores_exactly():
    """Guards a campaign that took the first name for the answer, whatever it acted on and whoever stood beside it."""
    from tracing_campaign import cases, scored

    every = cases(0)

    def result(case, verdict, *effects):
        entries = [{"name": n, "acts_on": a, "rivals": []} for n, a in effects]
        return {**every[case], "verdict": verdict, "effects": entries}

    lag = "calm-actuator_lag:rudder-1-0"
    assert scored(result(lag, "found", RUDDER)) == "right"
    assert scored(result(lag, "found", ELEVATOR)) == scored(result(lag, "found", RUDDER, SCALE)) == "wrong"
    assert scored(result("turbulent-airspeed_scale", "found", SCALE)) == "right"
    assert scored(result("wrong-wind-airspeed_scale", "found", SCALE)) == "wrong"
    assert scored(result("wrong-wind-airspeed_scale", "found", SCALE, ("wind_offset", "airflow"))) == "right"
    assert scored(result("form-second-order_lag-0", "found", RUDDER)) == "right"
    assert scored(result("bounds-0-clean", "unexplained")) == "right" and scored(result("clean-00", "unexplained")) == "false alarm"
    bounds = {"beside": ["CLa"], "told": ["CLa"]}
    assert scored({**result("bounds-0-clean", "none"), "bounds": bounds}) == "right"
    assert scored({**result("bounds-0-clean", "none"), "bounds": {**bounds, "told": []}}) == "silent"
    assert scored(result("turbulent-clean-0", "not_deterministic")) == "right"


def test_flights_of_the_own_campaign_have_seeds_of_their_own():
    """No two flights of a family share a seed, and no family one with another."""
    from tracing_campaign import cases

    seeds = [case["seed"] for family in (0, 1, 5) for case in cases(family).values()]
    sizes = [name for name in cases(0) if name.startswith("calm-")]
    assert len(set(seeds)) == len(seeds) - 3 * (len(sizes) - len(sizes) // 3)  # the same flight at three sizes
