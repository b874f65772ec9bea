"""Trace one flight from its declaration to a finding: what the stage, the campaign and the tests all call."""

from collections.abc import Callable, Sequence

from awescli.estimation.question import ask, simulator_of, without_record
from awescli.estimation.staged_fit import fit_in_stages
from awescli.physics.declaration import KiteDeclaration
from awescli.simulation.rollout import Simulator
from awescli.tracing.race import contest_of, run
from awescli.tracing.verdict import Finding, investigate, library_keys

CURRICULUM = (1.0, 2.5)
"""[s] horizons fitted before the whole one: a guess that is 30 % off cannot follow the flight for five seconds."""


def trace_flight(
    declared: KiteDeclaration,
    log,
    parts,
    *,
    horizon: float = 5.0,
    curriculum: Sequence[float] = CURRICULUM,
    start: dict[str, float] | None = None,
    candidates: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    rounds: int = 3,
    progress: Callable[[str], None] = lambda text: None,
) -> tuple[Finding, Simulator]:
    """(finding, simulator of the null model at its fit) of a flight cut into `parts` (train, validation, test; test is not touched).

    declared gives the prior; start: name -> value to start the fit from; candidates: keys of effects (default: the whole library that
    the flight could show).
    """
    keys = library_keys(declared, log, candidates)
    progress(f"compiling the model with {len(keys)} candidates")
    simulator = simulator_of(declared, log, keys)
    question = ask(simulator, log, parts, horizon, outputs or tuple(log.measured))
    progress("fitting the model as it is declared")
    fitted, question = fit_in_stages(question, log, parts, [h for h in curriculum if h < horizon], start=start)
    null = run(contest_of(question), fitted.parameters, (), question.names, start=fitted)
    finding = investigate(question, null, keys, log, parts, horizon, rounds=rounds, progress=progress)
    return finding, simulator.holding(without_record(simulator.kite, null.table))
