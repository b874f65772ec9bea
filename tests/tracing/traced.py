"""Trace a short synthetic flight, for the tests of this folder."""

from collections.abc import Mapping

from kites import DEVELOPMENT

from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import split
from awescli.simulation.campaign_flights import dev_like
from awescli.tracing.account import account
from awescli.tracing.flight import trace_flight


def traced(effects: Mapping[str, Mapping[str, float]], seed: int, duration: float = 100.0, **how):
    """(effects.json, finding) of a flight with `effects` that its user does not declare; how: arguments of `trace_flight`."""
    flight = dev_like(DEVELOPMENT, seed, effects, duration=duration)
    parts = split(find_loops(flight.log))
    finding, before = trace_flight(flight.declared, flight.log, parts, **how)
    return account(finding, flight.log, parts, 5.0, before, finding.after()), finding
