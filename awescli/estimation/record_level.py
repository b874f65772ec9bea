"""How wrong the wind's record is, as the fitted loops show it: the declared accuracy is its prior.

A fit holds the record's level as declared while everything else is sought (`processes/wind_record.py`: half a flight knows few entries, and
what a model lacks is not to hide in them). Bands say how far off a prediction may be: a record that is twice as good as declared makes them
too wide, one that is half as good too narrow. So the likeliest level is asked for once parameters are known: the slope of the marginal
likelihood with a log-normal prior about what was declared (`levels.py`; empirical Bayes). What lasts the whole flight is an error of the
same record, so its prior is as many times as good, and parameters are known as a record of that level lets them be.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from awescli.estimation.fit import fit
from awescli.estimation.fitted import Fit
from awescli.estimation.known import Known
from awescli.estimation.levels import relevelled
from awescli.estimation.problem import build
from awescli.estimation.processes.base import Prior, Process
from awescli.estimation.processes.wind_record import WindRecord
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
    if not fitted.flies.any() or not any(g.level > 0 for p in processes if _is_record(p) for g in p.groups):
        return processes
    misfit = fitted.misfit.with_processes(_asked(processes))
    found = relevelled(misfit, fitted.gram, fitted.own, fitted.counted)[0]
    return tuple(p.at(new.levels) if _is_record(p) else p for p, new in zip(processes, found, strict=True))


def with_record_level(simulator: Simulator, log: FlightLog, parts: Split, horizon: float, known: Known) -> Known:
    """What is known of a model, with the record's likeliest level on the train loops, and with what a record that is better than declared
    tells more of parameters and of its own lasting errors; other processes as they are."""
    spaced = tuple(replace(p, spacing=max(p.spacing, SPACING)) for p in known.processes)
    table = simulator.kite.parameters
    found = {n: table[n].value + f for n, f in zip(known.names, known.found, strict=True) if n in simulator.kite.record}
    held = simulator.holding(table.with_values(found))
    problem = build(held, log, parts, horizon, tuple(n for n in MEASURED if n in log)).at_noise(known.factors).with_processes(spaced)
    fitted = fit(replace(problem.misfit(held), names=()), held.kite.parameters, prior=False)
    new = record_relevelled(fitted)
    levelled = replace(known, processes=tuple(p.at(q.levels) for p, q in zip(known.processes, new, strict=True)))
    told = [i for i, n in enumerate(known.names) if n in held.wrt]
    if not told or not fitted.flies.any() or _tighter(spaced, new) <= 0:
        return levelled  # in a level that has risen is also what the model lacks, and that says nothing of parameters
    return _told(levelled, np.array(told, int), fitted, spaced, new)


def _told(known: Known, which: np.ndarray, fitted: Fit, declared: Sequence[Process], new: Sequence[Process]) -> Known:
    """Covariance and found values, of the names `which`, after the likelihood of processes `declared` has given way to that of `new`, and
    the record's prior to one that is as many times as good: to first order, with the difference of both information matrices."""
    names, misfit = tuple(known.names[i] for i in which), fitted.misfit
    gram = replace(misfit, names=names).linear(fitted.parameters.vector(names), fitted.own).gram
    before, after = (misfit.eliminated(gram, fitted.own, fitted.counted, processes) for processes in (declared, new))
    stds = np.array([fitted.parameters[n].prior_std for n in names])
    tighter = _tighter(declared, new) * known.record[which] / stds**2
    C, found = known.covariance[np.ix_(which, which)], known.found[which]
    more = after.H - before.H + np.diag(tighter)
    # (C^-1 + more)^-1 = S (1 + S'more S)^-1 S' with C = S S', in units of the deviations; what rounding has made negative is nothing
    scale = np.sqrt(np.diag(C))
    values, vectors = np.linalg.eigh(C / np.outer(scale, scale))
    S = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    C = S @ np.linalg.inv(np.eye(len(S)) + S.T @ more @ S) @ S.T
    found = found + C @ (after.b - before.b - tighter * found)
    covariance, whole = known.covariance.copy(), known.found.copy()
    covariance[np.ix_(which, which)], whole[which] = C, found
    return replace(known, covariance=covariance, found=whole)


def _tighter(declared: Sequence[Process], new: Sequence[Process]) -> float:
    """(declared level / new one)^2 - 1 of the record."""
    levels = [(old.groups[0].level, q.groups[0].level) for old, q in zip(declared, new, strict=True) if _is_record(old)]
    return max((old / now) ** 2 - 1 for old, now in levels) if levels else 0.0


def _asked(processes: Sequence[Process]) -> tuple[Process, ...]:
    """The processes with levels held, but those of the record, about what was declared of it."""
    return tuple(
        replace(p, groups=tuple(replace(g, of_level=Prior(g.of_level.median, SPREAD if _is_record(p) else 0.0)) for g in p.groups))
        for p in processes
    )


def _is_record(process: Process) -> bool:
    """Is it the wind record's error?"""
    return isinstance(process, WindRecord)
