"""The campaign on measured flights: what is new beyond the untouched log, whether sizes hold, and that an injected effect can be found."""

import measured_campaign as campaign
import pytest
from injection import TETHERED
from tracing.traced import short_flight, traced_flight


def effect(name: str, acts_on: str = "", std: float = 0.01, **sizes) -> dict:
    return {"name": name, "acts_on": acts_on, "rivals": [], "parameters": {n: {"value": v, "std": std} for n, v in sizes.items()}}


def said(verdict: str, *effects: dict, **case) -> dict:
    return {"flight": "thor", "set": "full", "case": "thor-x", "commit": "c", "verdict": verdict, "effects": list(effects), **case}


PUT_IN = {"key": "actuator_lag:aileron", "parameter": "tau", "value": 0.1, "null": 0.0, "floors": 4.0}
LAG, BIAS = effect("actuator_lag", "aileron", tau=0.11), effect("heading_bias", "attitude", b=0.03)
OWN = said("found", BIAS, set="untouched", case="thor-untouched")


@pytest.mark.parametrize(
    ("result", "outcome"),
    [
        (said("found", LAG, BIAS, **PUT_IN), "right"),
        (said("found", LAG, **PUT_IN), "right"),
        (said("found", LAG, effect("airspeed_scale", "airspeed", s=0.9), **PUT_IN), "wrong"),
        (said("found", BIAS, **PUT_IN), "silent"),
        (said("found", LAG, effect("heading_bias", "attitude", b=0.2), **PUT_IN), "wrong"),
        (said("cannot_tell", {**BIAS, "rivals": []}, {**LAG, "rivals": [{"name": "actuator_delay", "acts_on": "aileron"}]}, **PUT_IN),
         "among rivals"),
        (said("unexplained", **PUT_IN), "unexplained"),
        (said("not_testable", **PUT_IN), "silent"),
        (said("not_testable", LAG, BIAS, **PUT_IN), "right"),
        (said("not_testable", {**LAG, "rivals": [{"name": "actuator_delay", "acts_on": "aileron"}]}, **PUT_IN), "among rivals"),
        (said("unexplained", effect("air_density", "atmosphere", c=1.1), **PUT_IN), "wrong"),
        (said("failed", **PUT_IN), "failed"),
        (said("found", effect("actuator_lag", "elevator", tau=0.1), **PUT_IN), "wrong"),
        (said("found", BIAS, set="copy", copy="first 70 %"), "right"),
        (said("not_testable", set="copy", copy="first 70 %"), "silent"),
        (said("found", LAG, set="copy", copy="first 70 %"), "wrong"),
        (said("unexplained", set="copy", copy="first 70 %"), "false alarm"),
    ],
)  # fmt: skip
def test_only_what_is_new_counts(result, outcome):
    """Guards the judgement: what the untouched flight shows too, in the same size, is neither right nor wrong; a further name is wrong."""
    assert campaign.scored(result, OWN) == outcome


def test_all_that_names_an_effect_is_kept_with_its_size():
    """Guards answers without a verdict: every name that a user would read counts, by whatever means."""
    seen = {"name": "airspeed_scale", "acts_on": "airspeed", "size": -0.05, "std": 0.01}
    late = {"name": "actuator_lag", "acts_on": "aileron", "parameter": "tau", "size": 0.12, "std": 0.01, "found": True, "rivals": []}
    account = {"effects": [], "by_prediction": {"effects": [LAG]}, "kinematics": [seen], "instruments": [late, {**late, "found": False}]}
    told = campaign.named_by(account)
    assert told == [
        {**LAG, "by": "by_prediction"}, {**effect("airspeed_scale", "airspeed", size=-0.05), "by": "kinematics"},
        {**effect("actuator_lag", "aileron", tau=0.12), "by": "instruments"},
    ]  # fmt: skip
    assert campaign.named_by({"effects": [BIAS], "by_prediction": None, "kinematics": []}) == [{**BIAS, "by": "effects"}]


def test_a_size_is_compared_with_what_the_same_means_said():
    """Guards effects that two of them name with sizes of their own: each must have grown by itself; a name counts once."""
    by = {"by_prediction": 0.12, "instruments": 0.07}
    before = said("not_testable", *({**effect("actuator_lag", "aileron", tau=tau), "by": of} for of, tau in by.items()), set="untouched")
    beside = said("not_testable", {**effect("actuator_lag", "aileron", tau=0.075), "by": "instruments"}, **PUT_IN)
    assert campaign.scored(beside, before) == "silent"
    grown = [{**effect("actuator_lag", "aileron", tau=tau + 0.1), "by": of} for of, tau in by.items()]
    assert campaign.scored(said("not_testable", *grown, **PUT_IN), before) == "right"
    assert campaign.inside(said("not_testable", *grown, **PUT_IN), before) is True
    assert campaign.inside(said("not_testable", grown[1], **PUT_IN), before) is True
    # what the untouched flight has too little of for a name is taken off as well
    unnamed = {**effect("actuator_lag", "aileron", tau=0.05), "by": "instruments"}
    late = said("not_testable", {**effect("actuator_lag", "aileron", tau=0.15), "by": "instruments"}, **PUT_IN)
    assert campaign.inside(late, said("not_testable", set="untouched")) is False
    assert campaign.inside(late, said("not_testable", set="untouched", measured=[unnamed])) is True
    alone = {**effect("airspeed_scale", size=-0.07), "by": "kinematics"}
    put_in = {"key": "airspeed_scale", "parameter": "s", "value": 0.93, "null": 1.0, "floors": 4.0}
    assert campaign.inside(said("not_testable", alone, **put_in), before) is True


def test_an_effect_that_was_there_before_must_have_grown_by_what_was_put_in():
    before = said("found", effect("actuator_lag", "aileron", tau=0.05), set="untouched")
    grown, same = (said("found", effect("actuator_lag", "aileron", tau=tau), **PUT_IN) for tau in (0.155, 0.06))
    assert campaign.scored(grown, before) == "right" and campaign.inside(grown, before) is True
    assert campaign.scored(same, before) == "silent"
    assert campaign.inside(said("found", effect("actuator_lag", "aileron", tau=0.2), **PUT_IN), before) is False
    assert campaign.inside(said("none", **PUT_IN), before) is None


def test_an_effect_that_changes_its_place_with_a_rival_says_nothing_new():
    rival, lag = ({"name": name, "acts_on": "aileron"} for name in ("actuator_delay", "actuator_lag"))
    before = said("not_testable", {**effect("actuator_delay", "aileron", tau=0.12), "rivals": [lag]})
    put_in = {**PUT_IN, "key": "actuator_lag:elevator"}
    assert campaign.scored(said("not_testable", {**LAG, "rivals": [rival]}, **put_in), before) == "silent"
    assert campaign.scored(said("not_testable", LAG, **put_in), before) == "wrong"


def test_the_table_counts_what_was_said(tmp_path):
    told = campaign.table([OWN, said("found", LAG, **PUT_IN), said("none", case="thor-y", set="copy", copy="every second")])
    assert "| thor | full | 1 | 1 |  |  |  |  |  |  | 1 of 1 |" in told and "| thor-x | tau = 0.1 | 4.00 | right | found |" in told
    assert "- thor: `found`, heading_bias:attitude" in told and "| thor | copy | 1 | 1 |" in told


def test_there_are_enough_cases(tmp_path):
    """Guards the plan: 12 kinds and more, three sizes, two flights, 20 copies and more; the untouched flight of each comes first."""
    every = campaign.cases({"thor": tmp_path, "ap2": tmp_path}, "c")
    for flight in ("thor", "ap2"):
        own = [c for c in every.values() if c["flight"] == flight]
        assert own[0]["set"] == "untouched" and len({c["key"] for c in own if "key" in c}) >= 12
        assert all(sum(c["set"] == size for c in own) == sum(c["set"] == "full" for c in own) for size in campaign.FLOORS)
    assert sum(c["set"] == "copy" for c in every.values()) >= 20


@pytest.mark.slow
def test_what_is_put_into_a_simulated_flight_is_found():
    """Guards the whole idea where everything else is known: a pitot that reads 8 % low, put into the log of a flight that has nothing the
    declaration lacks, is named, alone, and its interval holds the size."""
    declared, log, parts = short_flight({}, seed=41, duration=60.0, guessed=("CL0", "CD0", "Cma", "Cndr", "dl"))
    log, declared = TETHERED["airspeed_scale"].inject(log, declared, 0.92)
    told, _ = traced_flight(declared, log, parts, 3.0, candidates=("airspeed_scale", "actuator_lag:rudder", "position_latency"))
    result = said(told["verdict"], *told["effects"], key="airspeed_scale", parameter="s", value=0.92, null=1.0, floors=4.0)
    untouched = said("none", set="untouched")
    assert campaign.scored(result, untouched) == "right" and campaign.inside(result, untouched)


def alone(of: str, size: float, std: float, named: bool, **case) -> dict:
    """What kinematics alone says of one error, and whether it names it."""
    name, _, target = of.partition(":")
    effects = [effect(name, target, size=size)] if named else []
    return {"flight": "thor", "set": "full", "case": "thor-x", "commit": "c", "verdict": "found" if named else "none", "effects": effects,
            "sizes": [[of, size, std]], **case}  # fmt: skip


def test_the_table_of_kinematics_counts_names_by_kind_and_size():
    """A size is judged by what it has changed by; a name where nothing was put in, or another one, is wrong."""
    put = {"key": "airspeed_scale", "parameter": "s", "value": 0.9, "null": 1.0, "floors": 4.0}
    told = campaign.table_of_kinematics(
        [
            alone("airspeed_scale", -0.03, 0.01, False, set="untouched", case="thor-untouched"),
            alone("airspeed_scale", -0.125, 0.01, True, **put),
            alone("airspeed_scale", -0.04, 0.01, False, **put | {"set": "half", "value": 0.97}),
            alone("airspeed_lag", 0.6, 0.01, True, **put | {"set": "quarter", "value": 0.98}),
            alone("airspeed_scale", -0.03, 0.01, False, set="copy", copy="every second"),
        ]
    )
    assert "| thor | airspeed_scale | right |  | **wrong** | 1 of 1 |" in told
    assert "untouched copies: 1 of 1 without a name" in told and "wrong names: 1 of 4" in told


def test_kinematics_says_of_a_record_what_was_put_into_it():
    """A pitot that reads 8 % low in a short flight of our own world: named, with the size that the table judges by."""
    kite, log, _ = short_flight({}, seed=41, duration=60.0)
    changed, _ = TETHERED["airspeed_scale"].inject(log, kite, 0.92)
    untouched, told = campaign.seen_alone(log), campaign.seen_alone(changed)
    assert untouched["verdict"] == "none" and [e["name"] for e in told["effects"]] == ["airspeed_scale"]
    sizes = {key: size for key, size, _ in told["sizes"]}
    before = {key: size for key, size, _ in untouched["sizes"]}
    assert sizes["airspeed_scale"] - before["airspeed_scale"] == pytest.approx(-0.08, abs=0.01)
