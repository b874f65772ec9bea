"""What a flight cannot tell apart is said to be so, whether or not it was beaten."""

from dataclasses import replace

import pytest
from kites import DEVELOPMENT
from tracing.traced import traced

from awescli.tracing import classes
from awescli.tracing.classes import rivals

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
