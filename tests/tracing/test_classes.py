"""What a flight cannot tell apart is said to be so, whether or not it was beaten."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from kites import DEVELOPMENT
from tracing.traced import traced

from awescli.tracing import classes
from awescli.tracing.classes import rivals
from awescli.tracing.investigate import _ranked
from awescli.tracing.tried import Tried

TWINS = ("load_cell_scale", "mass_offset")


def test_a_heavier_kite_and_a_load_cell_that_reads_high_are_one_flight(monkeypatch):
    """Guards exact twins (A6): a kite that is 6 % heavier pulls 6 % more with all its coefficients 6 % larger, which no flight can tell
    from a load cell that reads 6 % high. Both are named, whichever was accepted; an effect that does something else is not. A kite file of
    another kite (mass a third too large) had its load cell named alone: to first order so much mass looks like nothing else."""
    heavier = 0.06 * DEVELOPMENT.table()["m"].value
    how = {"horizon": 2.0, "curriculum": (1.0,), "guessed": DEVELOPMENT.table().free, "rounds": 1}
    account, finding = traced({"mass_offset": {"dm": heavier}}, 41, duration=60.0, candidates=(*TWINS, "sideslip_drag"), **how)
    assert account["verdict"] == "cannot_tell"
    (effect,) = account["effects"]
    assert {effect["name"], *(r["name"] for r in effect["rivals"])} == set(TWINS)
    sizes = {e["name"]: e["parameters"] for e in effect["class"]}
    mass, scale = sizes["mass_offset"]["dm"], sizes["load_cell_scale"]["s"]
    assert abs(mass["value"] - heavier) < 3.5 * mass["std"] and mass["value"] > 5 * mass["std"]
    assert abs(scale["value"] - 1.06) < 3.5 * scale["std"] and scale["value"] - 1 > 5 * scale["std"]
    both = account["probability"]
    named = finding.evidence.model.keys[0]
    assert 0.2 < both[named] < 0.9 and sum(both.get(k, 0.0) for k in TWINS) > 0.9
    # a twin that was never beaten is found all the same
    found = rivals(finding.frame, finding.evidence.model, TWINS, finding.evidence.search.gains)
    assert [r.key for r in found[named]] == [k for k in TWINS if k != named]
    assert found[named][0].lag == pytest.approx(0.0, abs=10.0)
    # one that is far to first order is tried where its own fit did as well, and only there
    near = classes._near
    monkeypatch.setattr(classes, "_near", lambda *arguments: [replace(score, drop=score.drop + 1000.0) for score in near(*arguments)])
    here = finding.frame, finding.evidence.model, TWINS, finding.evidence.search.gains
    twin = next(k for k in TWINS if k != named)
    assert [[r.key for r in rivals(*here, close=close)[named]] for close in ((), (twin,))] == [[], [twin]]
    # what got no name says how well leads are known: one that lags by less is a rival, though by more than is decisive
    last = finding.evidence.model
    monkeypatch.setattr(classes, "fit_instead", lambda *arguments: replace(last, deviance=last.deviance + 50.0))
    monkeypatch.setattr(classes, "refined", lambda frame, model, criteria: model)
    assert [[r.key for r in rivals(*here, close=(twin,), passed_over=p)[named]] for p in (0.0, 60.0)] == [[], [twin]]
    # a fit that came to no end has not fallen behind, where its own came to none either (play in a linkage, in gusts at 20 Hz)
    endless = replace(last.fit, solution=replace(last.fit.solution, kkt=0.1 * last.fit.solution.cost))
    monkeypatch.setattr(classes, "fit_instead", lambda *arguments: replace(last, fit=endless, deviance=last.deviance + 400.0))
    assert [[r.key for r in rivals(*here, close=close)[named]] for close in ((), (twin,))] == [[], [twin]]


@pytest.mark.parametrize("finalist, ended, where", [(True, True, "beaten"), (True, False, "close"), (False, False, ""), (False, True, "")])
def test_only_a_fit_to_the_end_has_lost_to_the_answer(finalist, ended, where):
    """Guards against a lag that is found because the fit of the play that is there went astray (JSBSim, gusts, 20 Hz), and a load cell
    that is found in the place of a heavy kite, its exact twin, because a quick fit in gusts had fallen 53 behind. What has neither lost
    nor come close is tried where it looks alike to first order."""

    def one(key, gain, ended, finalist):
        fitted = SimpleNamespace(fit=SimpleNamespace(ended=ended))
        return Tried(SimpleNamespace(key=key), True, "", fitted, gain, finalist=finalist)

    contenders = [one("actuator_lag:rudder", 274.0, True, True), one("surface_backlash:rudder", -159.0, ended, finalist)]
    last = SimpleNamespace(accepted="actuator_lag:rudder", contenders=contenders)
    ends = {"null": SimpleNamespace(deviance=274.0), "final": SimpleNamespace(deviance=0.0)}
    found = SimpleNamespace(rounds=[last], passed_over=0.0, set_aside=(), **ends)
    play = ("surface_backlash:rudder",)
    assert _ranked(found) == ((play if where == "beaten" else ()), (play if where == "close" else ()))
