"""The shapes of an effect: from where they are freed, and when they are let go of again."""

from types import SimpleNamespace

import numpy as np
import pytest
from kites import DEVELOPMENT
from tracing.fits import SEGMENTS, fitted
from tracing.traced import null_model

from awescli.estimation.gauss_newton import OutOfReach
from awescli.notation.parameters import Parameter
from awescli.physics.kite import make_effect
from awescli.tracing import shapes
from awescli.tracing.criteria import CRITERIA
from awescli.tracing.models import fit_added

STALL = make_effect("lift_stall", DEVELOPMENT)


@pytest.mark.parametrize("gain, tried", [(4.9, ["part", "part"]), (5.1, ["part", "part", "whole"]), (None, ["part", "part"])])
def test_a_shape_is_freed_first_on_what_told_candidates_apart(monkeypatch, gain, tried):
    """Guards the time in gusts: the inertia of a lag that has none was fitted on the whole flight, every node of its gusts, for nothing.
    What gains half of what is decisive on a part of the flight, for as much as the whole has more of it, is fitted to the whole; what comes
    nowhere near is given up."""
    asked, effect = [], SimpleNamespace(
        key="actuator_lag:rudder", shapes=("inertia",), probes={}, refinements={"inertia": (0.25,)},
        parameters=(Parameter("tau", 0.0, "s", 0.0, 1.0), Parameter("inertia", 0.0, "-", 0.0, 1.0)),
    )  # fmt: skip

    def fit_on(frame, model, values=None, free=(), reach=None):
        asked.append("part" if model.segments < SEGMENTS else "whole")
        if values and gain is None:
            raise OutOfReach
        better = fitted(gain / 2 if values else 0.0)
        better.keys, better.table, better.segments = model.keys, model.table, model.segments
        return better

    monkeypatch.setattr(shapes, "fit_on", fit_on)
    monkeypatch.setattr(shapes, "part_of", lambda frame: frame)
    monkeypatch.setattr(shapes, "begins_nowhere", lambda model, name, value: False)
    monkeypatch.setattr(shapes, "make_effect", lambda key, declared: effect)
    whole, part = fitted(0.0), fitted(0.0)
    for model in (whole, part):
        model.keys, model.table = (effect.key,), {f"{effect.key}.inertia": effect.parameters[1]}
    part.segments = SEGMENTS // 2
    assert shapes.refined(SimpleNamespace(declared=None), whole, CRITERIA, part) is whole
    assert asked == tried
    monkeypatch.setattr(shapes, "begins_nowhere", lambda model, name, value: True)
    assert shapes.refined(SimpleNamespace(declared=None), whole, CRITERIA, part) is whole
    assert asked == tried  # nowhere near the flight nothing is begun


@pytest.mark.parametrize(
    "ended, fits, begun", [(2.0, False, [1.0, 1.0, 3.0, 2.5, 3.5]), (2.0, True, [1.0]), (4.0, False, [1.0])],
    ids=["unseen", "fitted", "at an end"],
)  # fmt: skip
def test_unseen_loops_choose_an_onset_that_lies_in_none_that_are_fitted(monkeypatch, ended, fits, begun):
    """Within its range they are asked, by halves of a segment, and it is held there: fitted loops left it uncertain by hours. Not of one
    that fitted loops tell, nor (guards the time in gusts) of one that has come to an end of its range, where nothing depends on it."""
    name, asked = "drift.at", []

    def model(value, gain):
        found = fitted(gain)
        found.table = {name: Parameter(name, value, "s", 0.0, 4.0, free=True)}
        found.fit.names, found.fit.parameters, found.fit.covariance = (name,), found.table, np.array([[4.0]])
        return found

    def fit_on(frame, before, values, free=(), how=None, reach=None):
        asked.append(values[name])
        return model(ended, 10.0) if len(asked) == 1 else model(values[name], 20.0 if values[name] == 3.0 else 0.0)

    held: list[dict[str, float]] = []
    monkeypatch.setattr(shapes, "fit_on", fit_on)
    monkeypatch.setattr(shapes, "fit_held", lambda frame, model, values: held.append(values) or model)
    monkeypatch.setattr(shapes, "UNSEEN", 0.2)
    effect = SimpleNamespace(key="drift", onset="at")
    found = shapes._freed(SimpleNamespace(horizon=2.0, fits=lambda moment: fits), model(1.0, 0.0), effect, "at", CRITERIA)
    assert found.table[name].value == (3.0 if len(begun) > 1 else ended) and asked == begun
    assert held == ([{name: 3.0}] if len(begun) > 1 else [])


def test_a_fit_that_came_to_no_end_takes_no_place(monkeypatch):
    """Guards a stall in gusts (JSBSim): freed from one of its probes, its onset stopped at a kink, ahead by 228 of deviance that were
    promised from there; and as no fit that has not ended is an answer, the stall was none."""
    model, converged, stopped = fitted(215.0), fitted(216.0), fitted(440.0)
    for each, ended in ((model, True), (converged, True), (stopped, False)):
        each.fit.ended, each.fit.names, each.fit.covariance, each.fit.parameters = ended, ["lift_stall.alpha_0"], np.zeros((1, 1)), None
        each.table = {"lift_stall.alpha_0": SimpleNamespace(value=0.07, unit="rad")}
    results = {0.07: converged, 0.06: stopped, 0.09: stopped, 0.12: stopped, 0.16: stopped}
    monkeypatch.setattr(shapes, "fit_on", lambda frame, model, values, free, how, reach: results[values["lift_stall.alpha_0"]])
    monkeypatch.setattr(shapes, "begins_nowhere", lambda model, name, value: False)
    assert shapes._freed(None, model, STALL, "alpha_0", CRITERIA) is converged
    results[0.07] = stopped
    assert shapes._freed(None, model, STALL, "alpha_0", CRITERIA) is model


@pytest.mark.parametrize("first_ended", [True, False])
def test_a_probe_from_which_nothing_can_come_is_given_up(monkeypatch, first_ended):
    """Guards the time in gusts: of the probes of a shape most are nowhere near. What is given up is no model, and how far others must come
    is said by a fit that came to its end."""
    reaches = []

    def fit_on(frame, model, values, free, how, reach):
        reaches.append(reach)
        if reach < np.inf and values["lift_stall.alpha_0"] > 0.1:
            raise OutOfReach
        found = fitted(50.0)
        found.fit.ended = first_ended or len(reaches) > 1
        found.fit.names, found.fit.covariance, found.fit.parameters = ["lift_stall.alpha_0"], np.zeros((1, 1)), None
        found.table = {"lift_stall.alpha_0": SimpleNamespace(value=values["lift_stall.alpha_0"], unit="rad")}
        return found

    model = fitted(0.0)
    model.table = {"lift_stall.alpha_0": SimpleNamespace(value=0.05, unit="rad")}
    monkeypatch.setattr(shapes, "fit_on", fit_on)
    monkeypatch.setattr(shapes, "begins_nowhere", lambda model, name, value: False)
    found = shapes._freed(None, model, STALL, "alpha_0", CRITERIA)
    near = 50.0 + CRITERIA.finalists
    assert found.table["lift_stall.alpha_0"].value == (0.05 if first_ended else 0.06)
    assert reaches == [np.inf, *([near] * 4 if first_ended else [np.inf, *[near] * 3])]


def test_where_a_shape_is_freed_from_is_chosen_on_a_part(monkeypatch):
    """Guards the time in gusts: each of the five places from which a stall's onset was freed took half a minute on the whole flight."""
    asked = []

    def model(segments, value, gain):
        found = fitted(gain)
        found.segments, found.table = segments, {"lift_stall.alpha_0": SimpleNamespace(value=value, unit="rad")}
        found.fit.names, found.fit.covariance, found.fit.parameters = ["lift_stall.alpha_0"], np.zeros((1, 1)), None
        return found

    def fit_on(frame, before, values, free, how=None, reach=None):
        start = values["lift_stall.alpha_0"]
        asked.append((frame, start))
        return model(before.segments, start + 0.005, 20.0 if start == 0.09 else 10.0)

    monkeypatch.setattr(shapes, "fit_on", fit_on)
    monkeypatch.setattr(shapes, "part_of", lambda frame: "part")
    monkeypatch.setattr(shapes, "begins_nowhere", lambda model, name, value: False)
    found = shapes._freed("whole", model(SEGMENTS, 0.06, 0.0), STALL, "alpha_0", CRITERIA, model(1, 0.06, 0.0))
    assert asked == [*(("part", start) for start in (0.06, 0.09, 0.12, 0.16)), ("whole", 0.095)]
    assert found.table["lift_stall.alpha_0"].value == pytest.approx(0.1)


@pytest.mark.parametrize("rate, there", [(0.0021, True), (0.002, False), (1.0, True), (49.99, False)])
def test_a_range_over_decades_does_not_end_in_its_middle(rate, there):
    """Guards a slow trim motor: its limit of 0.005 rad/s lay "at the end" of a range from 0.002 to 50, by a thousandth of that."""
    row = Parameter("actuator_lag:elevator.rate", rate, "rad/s", 0.002, 50.0)
    model = SimpleNamespace(strengths=(row.name,), table={row.name: row})
    assert shapes.plausible(model, "actuator_lag:elevator") is there


def test_a_limit_that_comes_to_none_is_no_part_of_an_effect():
    """Guards a rudder's lag of 0.1 s (blind flight of half size, twice): fitted first with a limit of its rate, whose fit then ran to no
    limit, the end of its range, it was "no plausible size", and terms without a name took its place."""
    frame, null = null_model((("actuator_lag:rudder", (("tau", 0.1),)),))
    limited = fit_added(frame, null, "actuator_lag:rudder", {"actuator_lag:rudder.tau": 0.1}, {"actuator_lag:rudder.rate": 0.8}, True)
    model = shapes.refined(frame, limited)
    assert model.strengths == ("actuator_lag:rudder.tau",) and model.table["actuator_lag:rudder.rate"].value == 50.0
    assert shapes.plausible(model, "actuator_lag:rudder")
    assert model.table["actuator_lag:rudder.tau"].value == pytest.approx(0.1, abs=0.02)
