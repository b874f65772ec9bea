"""Trace a flight from its declaration to a finding: what the stage, the campaigns and the tests all call."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from awescli.estimation.prediction import predict
from awescli.flightlog.log import FlightLog
from awescli.flightlog.reconstruction.flight_path import reconstruct
from awescli.flightlog.reconstruction.result import SensorError
from awescli.flightlog.reconstruction.tables import said
from awescli.flightlog.split import Split
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects import EFFECTS
from awescli.physics.kite import Kite
from awescli.tracing.by_prediction import better_by_prediction
from awescli.tracing.criteria import CRITERIA, Criteria
from awescli.tracing.frame import Frame, Levels, TracedFlight
from awescli.tracing.instruments import instrument_errors
from awescli.tracing.investigate import Finding, investigate, library_keys
from awescli.tracing.models import Say, fit_null
from awescli.tracing.outliers import without_outliers

CURRICULUM = (1.0, 2.5)
"""[s] horizons fitted before the whole one: a guess that is 30 % off cannot follow the flight for five seconds."""


def trace_flight(
    declared: KiteDeclaration,
    log: FlightLog,
    parts: Split,
    *,
    horizon: float = 5.0,
    curriculum: Sequence[float] = CURRICULUM,
    start: Mapping[str, float] | None = None,
    levels: Levels | None = None,
    identified_error: float | None = None,
    candidates: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    rounds: int = CRITERIA.effects,
    also: Sequence[TracedFlight] = (),
    per_flight: Sequence[str] = (),
    closes: Callable[[Kite], Callable] | None = None,
    progress: Say = lambda text: None,
) -> Finding:
    """The finding on a flight cut into `parts` (train, validation, test; test is not touched).

    declared gives the prior; start: name -> value to start the fit from; levels: of processes and noise, as an identification left them:
    the fit begins where that one ended; identified_error: its mean NRMSE on validation loops, `horizon` ahead; candidates: keys of effects
    (default: the whole library that the flight could show); also: further flights of the same kite, with labels: parameters and effects are
    shared, but for those that patterns in per_flight name; nuisances are every flight's own; closes: as of TracedFlight.
    """
    keys = library_keys(declared, log, candidates)
    flights = (TracedFlight(log, parts, declared, closes=closes), *also)
    frame = Frame(flights, horizon, tuple(outputs or log.measured), tuple(per_flight))
    progress("fitting the model as it is declared")
    null = fit_null(frame, dict(start or {}), [h for h in curriculum if h < horizon], () if levels is None or also else (levels,))
    frame, null, many = without_outliers(frame, null)
    if many:
        progress(f"left out: {sum(many.values())} values that are far off for a moment")
    seen = [reconstruct(f.log).findings for f in flights]
    error = predict(null.simulator, log, parts.validation, horizon).nrmse()["mean"]
    known = {"null_error": error, "identified_error": identified_error, "contradictions": contradictions(seen, frame.outputs)}
    finding = investigate(frame, null, keys, rounds=rounds, progress=progress, **known)
    finding = replace(finding, outliers=many, kinematics=seen[0])
    if finding.evidence.contradictions:  # what else is said of a flight would be said for them
        return finding
    if finding.verdict == "not_testable" or _far_off(finding):
        finding = replace(finding, instruments=instrument_errors(frame, dict(start or {}), keys, progress=progress))
    if finding.verdict != "not_testable":
        return finding
    better = better_by_prediction(frame, dict(start or {}), keys, progress=progress)
    return replace(finding, model=better.model, by_prediction=better) if better else finding


def contradictions(seen: Sequence[Sequence[SensorError]], outputs: Sequence[str]) -> tuple[str, ...]:
    """What kinematics have seen, flight by flight, of the sensors that are compared, and no effect stands for: a sentence each."""
    found = [e for of_flight in seen for e in of_flight if e.name not in EFFECTS]
    return tuple(said(e) for e in found if set(e.acts_on) & set(outputs))


def _far_off(finding: Finding, criteria: Criteria = CRITERIA) -> bool:
    """Is a flight unexplained by far? What came nearest leaves more by itself than a model may leave with model error beside it."""
    return finding.verdict == "unexplained" and finding.evidence.rest.chi2 > criteria.follows
