"""Trace a short synthetic flight, for the tests of this folder."""

from collections.abc import Mapping
from dataclasses import replace

from kites import DEVELOPMENT

from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import split
from awescli.notation.parameters import ParameterTable
from awescli.simulation.campaign_flights import dev_like
from awescli.tracing.account import account
from awescli.tracing.flight import trace_flight

GUESSED = ("CL0", "CLa", "CD0", "CDa2", "CYb", "Clb", "Clp", "Cma", "Cmq", "Cnb", "Cnr", "Cndr", "CtD", "dl")
"""What the user of a short test flight does not know; the rest is declared as it is, which keeps a test to seconds."""


def traced(effects: Mapping[str, Mapping[str, float]], seed: int, duration: float = 80.0, guessed=GUESSED, **how):
    """(effects.json, finding) of a flight with `effects` that its user does not declare; how: arguments of `trace_flight`."""
    flight = dev_like(DEVELOPMENT, seed, effects, duration=duration)
    truth, guess = flight.flown.table(), flight.declared.table()
    rows = [guess[n] if n in guessed else replace(guess[n], value=truth[n].value, free=False) for n in guess]
    declared = flight.declared.with_parameters(ParameterTable(rows))
    parts = split(find_loops(flight.log), log=flight.log)
    finding, before = trace_flight(declared, flight.log, parts, **how)
    return account(finding, flight.log, parts, 5.0, before, finding.after()), finding
