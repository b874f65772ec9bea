"""What one of several flights shows and the others do not: no single size suits all, and nothing may be said to be missing nowhere."""

from types import SimpleNamespace

import pytest
from tracing.traced import short_flight, traced_flight

from awescli.tracing import when
from awescli.tracing.criteria import CRITERIA
from awescli.tracing.frame import TracedFlight


@pytest.mark.parametrize("effect, verdict", [
    ({}, "none"), ({"airspeed_scale": {"s": 0.94}}, "unexplained"), ({"sideslip_drag": {"k": 2.5}}, "unexplained"),
])  # fmt: skip
def test_what_the_second_flight_shows_is_said_with_its_name(effect, verdict):
    """Guards against "nothing is missing" where the pitot of one flight of two read 6 % low: a drift hides it there, and the other flight
    knows its scale so well that both together promise nothing. A drag that is there in one of them was unexplained without a word."""
    declared, log, parts = short_flight({}, 33)
    _, other, its_parts = short_flight(effect, 34)
    told, finding = traced_flight(declared, log, parts, 5.0, also=[TracedFlight(other, its_parts, declared, "second")])
    alone = finding.evidence.alone
    assert told["verdict"] == verdict and told["effects"] == []
    assert [(a.label, a.key) for a in alone] == [("second", key) for key in effect]
    assert all(a.drop > 2 * CRITERIA.in_one_flight for a in alone)
    assert all(f"{key} in second. Trace that flight by itself." in told["sentence"] for key in effect)


def test_one_flight_is_not_asked():
    told, finding = traced_flight(*short_flight({}, 33, 50.0), 5.0)
    assert finding.evidence.alone is None
    assert next(c for c in told["criteria"] if c["name"] == "flights_agree")["pass"] is None


def test_the_flight_that_shows_most_is_told_and_none_in_gusts(monkeypatch):
    """Guards a name for a score in gusts, where it lacks what gusts hide, and one for what parameters that suit all flights half leave."""
    promised = {"a": ("drag", 80.0), "b": ("pitot", 200.0), "c": ("pitot", 60.0), "d": ("pitot", 29.0), "gusty": ("mass", 900.0)}
    frame = SimpleNamespace(flights=[SimpleNamespace(label="", log=SimpleNamespace(name=name)) for name in promised])
    found = [SimpleNamespace(scores=[SimpleNamespace(key=k, drop=drop, p_value=1e-9)]) for k, drop in promised.values()]
    monkeypatch.setattr(when, "screen_apart", lambda frame, model, keys: found)
    monkeypatch.setattr(when, "gusts_of", lambda model, place: [SimpleNamespace(level=0.6 if place == len(promised) - 1 else 0.1)])
    told = when.shown_alone(frame, SimpleNamespace(keys=()), ("drag", "pitot", "mass"))
    assert [(a.label, a.key, a.drop) for a in told] == [("b", "pitot", 200.0), ("c", "pitot", 60.0)]
