"""What acts beside a model that was fitted without it: levels of gusts, line, model error and noise, the parameters held.

A filter needs them (`filtered_start`), and output error leaves none. They are those under which the train loops are likeliest (`levels`),
as a fit in gusts finds them, but for the parameters: each model's filter is tuned to it, as the order of a linear model is. A minute of
them, spread over the flight, tells the levels; an hour would ask for an hour's time and memory.
"""

from dataclasses import replace

from awescli.estimation.known import Known
from awescli.estimation.levels_in_turn import LOOSE, fit_levels
from awescli.estimation.problem import build
from awescli.estimation.staged_fit import LEVEL_ROUNDS, wide_open
from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import Split
from awescli.notation.quantities import MEASURED
from awescli.simulation.rollout import Simulator

TOLD_BY = 60.0
"""[s] of train from which levels are estimated, at most. Set on the validation blocks of a measured flight (Thor), which more train does
not predict better."""


def with_levels(simulator: Simulator, log: FlightLog, parts: Split, horizon: float, known: Known) -> Known:
    """What is known of a model, with the levels of its fit, or where that left none, with those that the train loops of the flight show,
    cut into segments of `horizon` [s]. Raises BadInput where none fits."""
    if any(g.level > 0 for p in known.processes if not p.certain for g in p.groups):
        return known
    problem = build(simulator, log, parts, horizon, tuple(n for n in MEASURED if n in log))
    held = replace(problem.with_processes(wide_open(problem.processes)).spread_out(TOLD_BY), names=())
    _, (found,) = fit_levels([held], [""], [simulator.kite.parameters], (), False, LEVEL_ROUNDS, LOOSE)
    return replace(known, processes=found.processes, factors=found.factors)
