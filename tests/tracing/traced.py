"""Trace a short synthetic flight, for the tests of this folder."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import pytest
from kites import DEVELOPMENT

from awescli.estimation.prediction import predict
from awescli.flightlog.log import FlightLog
from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import Split, split
from awescli.notation.parameters import ParameterTable
from awescli.physics.declaration import KiteDeclaration
from awescli.simulation.campaign_flights import dev_like
from awescli.tracing.flight import trace_flight
from awescli.tracing.frame import Frame, TracedFlight
from awescli.tracing.models import fit_null
from awescli.tracing.summary import summary

GUESSED = ("CL0", "CLa", "CD0", "CDa2", "CYb", "Clb", "Clp", "Cma", "Cmq", "Cnb", "Cnr", "Cndr", "CtD", "dl")
"""What the user of a short test flight does not know; the rest is declared as it is, which keeps a test to seconds."""


def short_flight(effects: Mapping[str, Mapping[str, float]], seed: int, duration: float = 80.0, guessed=GUESSED) -> tuple[
    KiteDeclaration, FlightLog, Split
]:  # fmt: skip
    """(kite as its user declares it, log, parts) of a flight with `effects` that the declaration lacks."""
    flight = dev_like(DEVELOPMENT, seed, effects, duration=duration)
    truth, guess = flight.flown.table(), flight.declared.table()
    rows = [guess[n] if n in guessed else replace(guess[n], value=truth[n].value, free=False) for n in guess]
    return flight.declared.with_parameters(ParameterTable(rows)), flight.log, split(find_loops(flight.log), log=flight.log)


def traced(effects: Mapping[str, Mapping[str, float]], seed: int, horizon: float = 5.0, duration: float = 80.0, guessed=GUESSED, **how):
    """(effects.json, finding) of a `short_flight`; how: arguments of `trace_flight`."""
    return traced_flight(*short_flight(effects, seed, duration, guessed), horizon, **how)


def traced_flight(declared: KiteDeclaration, log: FlightLog, parts: Split, horizon: float, *, kinematics: bool = False, **how):
    """(effects.json, finding) of a flight. kinematics: does the trace ask first whether sensors contradict each other? That takes seconds,
    and test_instruments.py is about it."""
    with pytest.MonkeyPatch.context() as patch:
        if not kinematics:
            patch.setattr("awescli.tracing.flight.reconstruct", lambda log: SimpleNamespace(findings=()))
        finding = trace_flight(declared, log, parts, horizon=horizon, **how)
    before, after = (predict(model, log, parts.test, horizon) for model in (finding.before(), finding.after()))
    return summary(finding, log, horizon, before, after), finding


def thinned(log: FlightLog, every: int) -> FlightLog:
    """Every so many samples of a log, as a slower logger would have kept them."""
    cut = {"measured": {n: v[::every] for n, v in log.measured.items()}, "inputs": {n: v[::every] for n, v in log.inputs.items()}}
    return replace(log, dt=every * log.dt, time=log.time[::every], valid=log.valid[::every], **cut)


def with_errors(frame: Frame, errors) -> Frame:
    """The frame with `errors`: channel -> {sample: standard deviations of its noise} put into the log."""
    (flight,) = frame.flights
    measured, noise = dict(flight.log.measured), flight.declared.noise.channels()
    for name, those in errors.items():
        measured[name] = measured[name].copy()
        for row, size in those.items():
            measured[name][row] += size * noise[name][0]
    return replace(frame, flights=(replace(flight, log=replace(flight.log, measured=measured)),))


@cache
def null_model(effects: tuple = (), seed: int = 31, duration: float = 50.0, horizon: float = 2.0):
    """(frame, fitted declared model) of a short flight of few unknowns. effects: ((key, ((short name, value), ...)), ...)"""
    declared, log, parts = short_flight({k: dict(v) for k, v in effects}, seed, duration, ("CL0", "CD0", "Cma", "Cndr", "dl"))
    frame = Frame((TracedFlight(log, parts, declared),), horizon, tuple(log.measured))
    return frame, fit_null(frame, {}, (1.0,))
