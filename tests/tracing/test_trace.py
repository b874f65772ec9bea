"""Tracing whole flights: nothing where nothing is missing, the right name where something is, and no wrong name for the unknown."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from kites import DEVELOPMENT
from tracing.annotated import wrongly_annotated
from tracing.traced import short_flight, thinned, traced, traced_flight

from awescli.estimation import staged_fit
from awescli.estimation.processes.base import spacing
from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import split
from awescli.physics.kite import Kite
from awescli.tracing import investigate, models, search

RIVALS = ("actuator_lag:rudder", "actuator_delay:rudder", "sideslip_drag", "airspeed_scale", "position_latency", "surface_bias:yaw",
          "tether_attachment", "pitch_curvature")  # fmt: skip
"""Enough of the library to go wrong in, few enough for a test of seconds."""
SHORT = {"candidates": RIVALS, "horizon": 3.0, "curriculum": (1.0,), "duration": 50.0}
FEW = ("CL0", "CD0", "Cma", "Cndr", "dl")
"""What is not known of a kite where the test asks for something else than what parameters take up."""


def named(account) -> list[tuple[str, str]]:
    return [(e["name"], e["acts_on"]) for e in account["effects"]]


def passed(account) -> dict:
    return {row["name"]: row["pass"] for row in account["criteria"]}


def test_a_clean_flight_has_nothing_missing():
    """Guards the false alarm on the whole library: nothing accepted, chi-square at 1, and the sizes that would have been seen."""
    account, finding = traced({}, seed=42, kinematics=True)
    assert account["verdict"] == "none" and account["effects"] == [] and account["unexplained"] is None
    assert account["chi2"]["validation_before"] == pytest.approx(1.0, abs=0.05)
    assert account["error"]["before"]["mean"] < 1.15 * account["error"]["noise_floor"]["mean"]
    assert 0 < account["detectable"]["sideslip_drag"] < 1.0 and len(account["ranking"]) > 20
    assert max(account["probability"], key=account["probability"].get) == "none" and finding.model is finding.null


@pytest.mark.parametrize(
    "key, values, seed",
    [("sideslip_drag", {"k": 2.5}, 13), ("actuator_lag:rudder", {"tau": 0.2}, 12),
     pytest.param("position_latency", {"tau": 0.15}, 14, marks=pytest.mark.slow),
     pytest.param("airspeed_scale", {"s": 0.94, "b": 0.5}, 16, marks=pytest.mark.slow)],
)  # fmt: skip
def test_one_missing_effect_is_named_with_its_size(key, values, seed):
    """Guards the heart of the product: name, place and size of one undeclared effect, and the error back at the noise."""
    account, finding = traced({key: values}, seed, **SHORT)
    assert not list(wrongly_annotated(finding))
    assert account["verdict"] in ("found", "cannot_tell")
    ranked = [(e["name"], e["acts_on"]) for e in account["ranking"]]
    assert {(e["name"], e["acts_on"]) for e in account["effects"]} <= set(ranked)  # one name for one effect, with and without a target
    best = account["effects"][0]
    assert best["name"] == key.partition(":")[0] and len(best["rivals"]) <= 2
    for name, value in values.items():
        size = best["parameters"][name]
        assert abs(size["value"] - value) < 3.5 * size["std"] and size["std"] < 0.5 * max(abs(value), 1.0), (name, size)
    before, after, floor = (account["error"][k]["mean"] for k in ("before", "after", "noise_floor"))
    assert after < 1.5 * floor and after < (0.5 * before if before > 3 * floor else 1.02 * before), (before, after, floor)
    assert account["chi2"]["validation_after"] == pytest.approx(1.0, abs=0.08)  # of 16 seeds: standard deviation 0.021, lowest 0.937
    assert account["probability"][key] > 0.5 and account["ranking"][0]["name"] == best["name"]


def test_a_load_in_another_unit_is_no_physics():
    """Guards a unit mistake (A10): a clean flight whose load is in lbf, read as kgf, gets no name, and is asked for the unit in words. The
    load cell's scale is far outside what any has, where its fit must go all the same."""
    declared, log, parts = short_flight({}, seed=11, duration=50.0)
    log = replace(log, measured={**log.measured, "tension": log["tension"] / 0.45359237})
    candidates = ("load_cell_scale", "tether_attachment", "sideslip_drag", "actuator_lag:rudder")
    account, finding = traced_flight(declared, log, parts, 3.0, candidates=candidates, curriculum=(1.0,))
    assert account["verdict"] not in ("found", "cannot_tell", "none") and account["effects"] == []
    assert "load_cell_scale" in account["sentence"] and "is the load in lbf, and read as kgf?" in account["sentence"]
    ((_, model),) = finding.implausible
    assert model.table["load_cell_scale.s"].value == pytest.approx(1 / 0.45359237, rel=0.05)


def test_a_rudder_of_the_wrong_sign_is_no_effect():
    """Guards a mistake that leaves more than any effect does, and yet can be searched: no name, and what comes nearest says where."""
    declared, log, parts = short_flight({}, seed=11, duration=50.0)
    log = replace(log, inputs={**log.inputs, "rudder": -log["rudder"]})
    candidates = ("hinge_blowback:rudder", "sideslip_drag", "airspeed_scale")
    account, finding = traced_flight(declared, log, parts, 3.0, candidates=candidates, curriculum=(1.0,))
    assert account["verdict"] == "unexplained" and account["effects"] == []
    assert finding.evidence.bare.chi2 > 100 and "hinge_blowback:rudder" in account["sentence"]


def test_what_may_hide_in_a_bound_is_fitted_from_where_it_does_nothing(monkeypatch):
    """Guards a trace that ended with an error: the air's density was to begin at a factor of 0, beyond its bounds."""
    keys = ("air_density", "surface_bias:yaw")
    begun = {}

    def fit_added(frame, base, key, strengths, shapes, alone):
        assert Kite(DEVELOPMENT, extra=(key,)).parameters.with_values(strengths)
        begun.update(strengths)
        return SimpleNamespace(at_bound=["CLa"], fit=base.fit)

    monkeypatch.setattr(investigate, "fit_added", fit_added)
    monkeypatch.setattr(investigate, "informed", lambda frame, null, keys, columns, horizon: [np.ones((1 + len(columns.names),) * 2)])
    null = SimpleNamespace(at_bound=["CLa"], fit=SimpleNamespace(names=("CLa",), solution=SimpleNamespace(cost=1.0)))
    assert investigate.absorbed_effects(SimpleNamespace(declared=DEVELOPMENT, horizon=2.0), null, keys) == ()
    assert begun == {"air_density.c": 1.0, "surface_bias:yaw.b": 0.0}


@pytest.mark.slow
def test_the_verdict_does_not_depend_on_the_loggers_rate():
    """Guards logs of every rate (A1): every second and every fifth sample of a flight give the verdict and the size of all of them."""
    declared, log, _ = short_flight({"actuator_lag:rudder": {"tau": 0.2}}, seed=12, duration=50.0)
    found = []
    for every in (2, 5):
        slow = thinned(log, every)
        account, _ = traced_flight(declared, slow, split(find_loops(slow)), 3.0, candidates=RIVALS, curriculum=(1.0,))
        assert account["verdict"] in ("found", "cannot_tell") and named(account)[0] == ("actuator_lag", "rudder")
        size = account["effects"][0]["parameters"]["tau"]
        assert abs(size["value"] - 0.2) < 3.5 * size["std"], (every, size)
        found.append(account["verdict"])
    assert len(set(found)) == 1


@pytest.mark.slow
def test_candidates_of_a_long_flight_are_told_apart_on_a_part_of_it(monkeypatch):
    """Guards long flights: with 12 s instead of two minutes, candidates are fitted to a share of the segments, and the answer, its size and
    its interval come from all of them. A rival that model error helps yet would be fitted to all as well, and one that comes nowhere near
    to none of it."""
    for module in (staged_fit, models):
        monkeypatch.setattr(module, "SETTLED_ON", 12.0)
    monkeypatch.setattr(search, "HELPED", 1.0)
    monkeypatch.setattr(search, "_reach", lambda *given: float("inf"))
    account, finding = traced({"actuator_lag:rudder": {"tau": 0.2}}, 12, **{**SHORT, "candidates": RIVALS[:3]})
    assert named(account) == [("actuator_lag", "rudder")] and account["verdict"] in ("found", "cannot_tell")
    size = account["effects"][0]["parameters"]["tau"]
    assert abs(size["value"] - 0.2) < 3.5 * size["std"] and size["std"] < 0.02
    best, *others = finding.evidence.search.rounds[0].contenders
    assert best.fitted.segments == finding.null.segments and all(t.gain < best.gain for t in others)
    assert any(t.fitted.segments < finding.null.segments for t in others)


@pytest.mark.slow
def test_a_missing_effect_is_named_in_gusts():
    """Guards tracing in turbulence, where an abrupt effect leaves a residual that gusts could explain: name, size, and no effect made up
    for the gusts."""
    keys = ("tether_elasticity", "tether_drag", "mass_offset")
    truth = {"tether_elasticity": {"EA": 6e5, "zeta": 120.0}, "turbulence": {"sigma": 0.6, "L": 150.0}}
    account, finding = traced(truth, seed=21, candidates=keys, horizon=3.0, curriculum=(1.0,), kinematics=True)
    assert named(account) == [("tether_elasticity", "line")]
    best, *others = finding.evidence.search.rounds[0].contenders
    whole, *apart = (spacing(t.fitted.problems[0].processes) for t in (best, *others))
    assert whole == finding.frame.flights[0].log.dt and not best.partly
    assert others and all(t.partly for t in others) and set(apart) == {models.TOLD_APART}
    size = account["effects"][0]["parameters"]["EA"]
    assert abs(size["value"] - 6e5) < 3.5 * size["std"] and size["std"] < 0.05 * 6e5
    assert account["chi2"]["train_after"] == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_roll_gusts_are_found_where_they_are():
    """Guards the one finding in air that hides all else: gusts that roll the kite show on unseen segments with their level, and none are
    made up for gusts that only move it."""
    air = {"sigma": 0.8, "L": 150.0}
    how = {"candidates": ("tether_drag", "wind_offset"), "horizon": 3.0, "curriculum": (1.0,), "duration": 50.0, "guessed": FEW}
    account, _ = traced({"turbulence": {**air, "roll": 0.12}}, seed=23, **how)
    found = account["roll_gusts"]
    assert account["verdict"] == "not_deterministic" and account["effects"] == []
    assert found["std_rad_s"] == pytest.approx(0.12, rel=0.25)
    assert found["chi2"]["after"] < found["chi2"]["before"] and found["channels"]["p"]["after"] < found["channels"]["p"]["before"]
    account, _ = traced({"turbulence": air}, seed=23, **how)
    assert account["verdict"] == "not_deterministic" and account["roll_gusts"] is None


@pytest.mark.slow
def test_two_missing_effects_are_both_named():
    """Guards the stepwise search: the second effect is found once the first is in the model."""
    account, _ = traced({"sideslip_drag": {"k": 2.5}, "position_latency": {"tau": 0.15}}, 17, **SHORT)
    assert {n for n, _ in named(account)} == {"sideslip_drag", "position_latency"}
    assert account["verdict"] in ("found", "cannot_tell")


def test_what_is_not_in_the_library_gets_no_wrong_name():
    """Guards honesty (A3): a pitching moment that the library does not have is `unexplained`, with its channel and an empirical term, and
    most likely something else."""
    account, _ = traced({"custom_term:m_y*beta": {"k": 0.06}}, 15, **{**SHORT, "candidates": ("pitch_curvature", "surface_bias:yaw")})
    assert account["verdict"] == "unexplained" and account["effects"] == []
    assert account["unexplained"]["channel"] == "m_y" and account["unexplained"]["expression"]
    assert account["error"]["after"]["mean"] < account["error"]["before"]["mean"]
    assert account["probability"]["something_else"] > 0.9 and not passed(account)["rest_is_noise"]


def test_a_model_that_does_not_fly_is_not_asked():
    """Guards A2: where the declared model diverges there is no verdict but `not_testable`, no error "before", and no effect."""
    declared, log, parts = short_flight({}, 18, 40.0, ("CL0",))
    tumbling = {n: declared.parameters[n].model_copy(update={"value": -8 * declared.parameters[n].value, "lower": None, "upper": None})
                for n in ("Cma", "Cmq")}  # fmt: skip
    declared = declared.model_copy(update={"parameters": {**declared.parameters, **tumbling}})
    account, finding = traced_flight(declared, log, parts, 3.0, candidates=RIVALS, curriculum=())
    assert account["verdict"] == "not_testable" and account["effects"] == [] and "before" not in account["error"]
    assert finding.reason and finding.reason in account["sentence"] and account["ranking"] == []
    assert account["probability"]["something_else"] > 0.9


@pytest.mark.parametrize("promised, fitted", [(49.0, False), (51.0, True)])
def test_bounds_that_promise_little_are_not_left(monkeypatch, promised, fitted):
    """Guards the time of a trace: where an answer leads by 1000 and the bounds of the model without it promise a twentieth of that, nobody
    fits that model without them; what is told is what they promise."""
    null = SimpleNamespace(deviance=2000.0, at_bound=["CD0", "sideslip_drag.k"])
    answer = SimpleNamespace(deviance=1000.0, keys=("sideslip_drag",))
    monkeypatch.setattr(investigate, "promised_beyond", lambda model, names: promised)
    monkeypatch.setattr(investigate, "fit_beyond", lambda frame, model, names: SimpleNamespace(deviance=1800.0))
    found = investigate.bounds_left(SimpleNamespace(declared=DEVELOPMENT), null, answer)
    assert (found.gone, found.parameters) == ("sideslip_drag", ("CD0",))
    assert found.deviance == (1800.0 if fitted else 2000.0 - promised)


def with_a_wrong_bound(effects):
    """(declared, log, parts) of a flight with effects, CD0 declared a fifth too large at least."""
    declared, log, parts = short_flight(effects, 47, 40.0, ("CL0", "CLa", "CD0", "CDa2", "Cma"))
    wrong = replace(declared.table()["CD0"], value=0.125, lower=0.106, upper=0.163, std=None)
    return declared.with_parameters(declared.table().with_rows([wrong])), log, parts


@pytest.mark.parametrize("effects", [pytest.param({}, marks=pytest.mark.campaign), {"load_cell_lag": {"tau": 0.3}}])
def test_bounds_that_do_not_hold_the_truth_are_told(effects):
    """Guards blind flights on which nothing was named, or the air's density, for bounds that were wrong: these are told, and what is
    there beside them; the error before is that within the bounds."""
    declared, log, parts = with_a_wrong_bound(effects)
    account, finding = traced_flight(declared, log, parts, 2.0, candidates=("air_density", "load_cell_lag"))
    assert finding.within.verdict == "unexplained" and finding.before().kite.parameters["CD0"].value == pytest.approx(0.106, rel=1e-5)
    assert (account["verdict"], {n for n, _ in named(account)}) == ("found" if effects else "none", set(effects))
    (name,) = account["outside_bounds"]
    told, truth = account["outside_bounds"][name], DEVELOPMENT.parameters["CD0"].value
    assert name == "CD0" and abs(told["value"] - truth) < 3 * told["std"] and (told["lower"], told["upper"]) == (0.106, 0.163)
    assert told["sentence"] in account["sentence"] and account["error"]["after"]["mean"] < account["error"]["before"]["mean"]
    handed_on = finding.declaration().parameters["CD0"]
    assert handed_on.value == told["value"] and 0 <= handed_on.lower < told["value"] < handed_on.upper


@pytest.mark.campaign
@pytest.mark.parametrize("effects", [{}, {"load_cell_lag": {"tau": 0.3}}])
def test_bounds_are_not_told_where_an_effect_does_what_they_forbid(effects):
    """Guards against either answer where both do as well: a drag of no lift is CD0 by another name, and may be what is missing."""
    declared, log, parts = with_a_wrong_bound(effects)
    account, finding = traced_flight(declared, log, parts, 2.0, candidates=("parasitic_drag", "air_density", "load_cell_lag"))
    row = next(c for c in finding.table if c.name == "bounds_hold")
    assert account["verdict"] == "unexplained" and not account["effects"] and row.passed is False
    assert account["outside_bounds"] == {} and "CD0" in account["reason"] and "CD0" in finding.evidence.bounds_left.parameters


def test_no_arm_is_sought_where_a_receiver_is_slower_than_the_log():
    """Guards against an antenna 0.2 m off in a receiver of 4 Hz whose values stand in rows of 50 Hz: they are late by a part of a row.
    Missing rows are none of that."""
    declared, log, _ = short_flight({}, 31, 20.0, ("CL0",))
    every = np.arange(len(log))
    slow, gaps = (replace(log, fresh={"p_n": new}) for new in (every % 12 == 0, every % 12 > 0))
    assert [("antenna_arm" in investigate.library_keys(declared, x)) for x in (log, gaps, slow)] == [True, True, False]
