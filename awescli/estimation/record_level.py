"""How wrong the wind's record is, as the fitted loops show it: the declared accuracy is its prior.

A fit holds the record's level as declared while everything else is sought (`processes/wind_record.py`: half a flight knows few entries, and
what a model lacks is not to hide in them). Bands say how far off a prediction may be: a record that is twice as good as declared makes them
too wide, one that is half as good too narrow. So the likeliest level is asked for once parameters are known: the slope of the marginal
likelihood with a log-normal prior about what was declared (`levels.py`; empirical Bayes).
"""

from collections.abc import Sequence
from dataclasses import replace

from awescli.estimation.fit import Fit, fit
from awescli.estimation.levels import relevelled
from awescli.estimation.power_interval import Known
from awescli.estimation.problem import build
from awescli.estimation.processes.base import Prior, Process
from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import Split
from awescli.notation.quantities import MEASURED
from awescli.simulation.rollout import Simulator

SPREAD = 0.7
"""Of the logarithm: a declared accuracy is within a factor of two."""
SPACING = 0.05
"""[s] between nodes at least, where only the level is asked for."""


def record_relevelled(fitted: Fit) -> tuple[Process, ...]:
    """The processes of a fit with the record's likeliest level beside all that it has; others as they are."""
    processes = fitted.misfit.processes
    if not fitted.flies.any() or not any(g.level > 0 for p in processes if p.certain for g in p.groups):
        return processes
    misfit = fitted.misfit.with_processes(_asked(processes))
    found = relevelled(misfit, fitted.gram, fitted.own, fitted.counted)[0]
    return tuple(p.at(new.levels) if p.certain else p for p, new in zip(processes, found, strict=True))


def with_record_level(simulator: Simulator, log: FlightLog, parts: Split, horizon: float, known: Known) -> Known:
    """What is known of a model, with the record's likeliest level on the train loops; parameters and other processes as they are."""
    declared = tuple(replace(p, spacing=max(p.spacing, SPACING)) for p in known.processes)
    table = simulator.kite.parameters
    found = {n: table[n].value + f for n, f in zip(known.names, known.found, strict=True) if n in simulator.kite.record}
    held = simulator.holding(table.with_values(found))
    problem = build(held, log, parts, horizon, tuple(n for n in MEASURED if n in log)).at_noise(known.factors).with_processes(declared)
    new = record_relevelled(fit(replace(problem.misfit(held), names=()), held.kite.parameters, prior=False))
    return replace(known, processes=tuple(p.at(q.levels) for p, q in zip(known.processes, new, strict=True)))


def _asked(processes: Sequence[Process]) -> tuple[Process, ...]:
    """The processes with levels held, but those of the record, about what was declared of it."""
    return tuple(
        replace(p, groups=tuple(replace(g, of_level=Prior(g.of_level.median, SPREAD if p.certain else 0.0)) for g in p.groups))
        for p in processes
    )
