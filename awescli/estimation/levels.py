"""Levels of processes, their memories where nobody knows them, and white noise, from the likelihood with everything else integrated out.

With M the squared steps of an axis at their best and V their variances, both in units of the axis' noise, n of them, the slope of the
deviance is

    d(-2 log L) / d log level = 2 (n - V) - 2 M,

so level^2 is multiplied by M / (n - V) until it stays (MacKay, Neural Computation 4, 1992: n - V is the number of steps that the flight
determines). From a level that is too small the first factor says whether there is anything at all: below 1 the likelihood is largest at
zero. A memory moves while the noise from node to node, level^2 / memory, stays: that is what a flight shows best. With w(t + dt) = F w + e,
the deviance falls by twice sum(F' E[e w] / Q) as log memory grows, F' = dF / d log memory, and what the flight determines of that is
sum(F'^2 w^2 / Q): one Newton step.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from awescli.estimation.fitted import Fit
from awescli.estimation.information_filter import Information
from awescli.estimation.links import Gram, Links
from awescli.estimation.misfit import Misfit, NuisanceValues
from awescli.estimation.processes.base import Group, Process, labels_of
from awescli.estimation.smoother import Innovations

FACTOR = 5.0
"""A level changes at most by so much at once."""
LONGER = 1.5
"""A memory changes at most by this factor between two fits of the parameters: at those of a poor guess it stands for what these miss."""
ENTERS = 0.05
"""Share of its prior's median with which a level that is zero is tried."""
NOTHING = 1e-5
"""Share of its prior's median that is as good as no level."""
MOST = 4.0
"""Spreads of its prior by which a level may exceed the median: more is a fit that has lost its way."""
WORTH = 4.0
"""Deviance that a group must be worth to stay: chance reaches it with one level in 2 % of flights (half a chi-square of one degree)."""
SETTLED = 0.5
"""Deviance below which a round has changed nothing."""
ROUNDS = 8
DRAWS = 4
"""Draws of the nuisances from which the variance is taken that they give a channel."""
UNSURE = 3.0
"""Standard errors of what the draws say that nuisances determine: so many samples keep the noise that they have, for of a channel that is
determined nearly whole what is left says nothing."""


def relevelled(
    misfit: Misfit, gram: Gram, own: NuisanceValues, which: np.ndarray, rounds: int = ROUNDS
) -> tuple[tuple[Process, ...], float]:
    """(processes at their likeliest levels and memories, deviance that this gains) at a fixed linearisation, without the groups that are
    worth nothing.

    gram: of `misfit` about `own`; which: segments that count. The globals are held, so their columns are left out.
    """
    gram = gram.of(np.zeros(0, int))

    def at(processes: Sequence[Process]) -> tuple[Information, float]:
        info = misfit.eliminated(gram, own, which, processes)
        return info, float(info.deviance.sum()) + prior_deviance(processes)

    processes, began = misfit.processes, {g.name: g.memory for p in misfit.processes for g in p.groups}
    info, deviance = at(processes)
    before = deviance
    for _ in range(rounds):
        trials = ((trial, *at(trial)) for trial in _stepped(processes, misfit, info, began))
        better = next((t for t in trials if t[-1] < deviance), None)
        if better is None:
            break
        gain, (processes, info, deviance) = deviance - better[-1], better
        if gain < SETTLED:
            break
    found, deviance = _pruned(misfit.processes, processes, deviance, lambda p: at(p)[1])
    return found, before - deviance


def prior_deviance(processes: Sequence[Process]) -> float:
    """-2 log of the priors of all levels that are there, and of their memories."""
    return sum(g.of_level.deviance(g.level) + g.of_memory.deviance(g.memory) for p in processes for g in p.groups if g.level > 0)


def _stepped(
    processes: Sequence[Process], misfit: Misfit, info: Information, began: Mapping[str, float]
) -> tuple[tuple[Process, ...], ...]:
    """The processes after one step of the fixed point: of levels and memories, and of levels alone. began: memories at the last fit."""
    seen, labels = info.innovations(), [name for name, _ in labels_of(processes, misfit.disturbances, misfit.drifts)]
    places = {name: [i for i, label in enumerate(labels) if label == name] for name in labels}
    groups = [g for p in processes for g in p.groups if g.name in places and g.of_level.spread]
    levels = {g.name: _most(g, g.level * _louder(g, seen, places[g.name])) for g in groups}
    open_ = [g for g in groups if g.of_memory.spread]
    memories = {g.name: _longer(g, seen, places[g.name], began[g.name]) for g in open_}
    along = {g.name: _most(g, levels[g.name] * np.sqrt(memories[g.name] / g.memory)) for g in open_}
    alone = tuple(p.at({**p.levels, **levels}) for p in processes)
    both = tuple(p.at({**p.levels, **levels, **along}, memories) for p in processes)
    return (both, alone) if memories else (alone,)


def _most(g: Group, level: float) -> float:
    """A level, or the largest that a group may have."""
    return float(min(level, g.of_level.median * np.exp(MOST * g.of_level.spread)))


def _louder(g: Group, seen: Innovations, rows: Sequence[int]) -> float:
    """The factor on a group's level, its axes at `rows`."""
    determined, square = seen.steps * len(rows) - seen.spread[rows].sum(), seen.mean[rows].sum()
    pull = np.log(g.level / g.of_level.median) / g.of_level.spread**2
    ratio = (square + max(-pull, 0.0)) / max(determined + max(pull, 0.0), 1e-3)
    return float(np.clip(np.sqrt(ratio), 1 / FACTOR, FACTOR))


def _longer(g: Group, seen: Innovations, rows: Sequence[int], began: float) -> float:
    """A group's next memory, its axes at `rows`."""
    precision = g.of_memory.spread**-2
    asked = seen.longer[rows].sum() - precision * np.log(g.memory / g.of_memory.median)
    step = np.clip(asked / (seen.known[rows].sum() + precision), -1.0, 1.0)
    return float(np.clip(g.memory * np.exp(step), began / LONGER, began * LONGER))


def _pruned(
    began: Sequence[Process], processes: Sequence[Process], deviance: float, at: Callable[[Sequence[Process]], float]
) -> tuple[tuple[Process, ...], float]:
    """Without the groups that are worth less than WORTH: first all at once whose level has only fallen since it `began`, then one by one.
    One that goes is tried at a level of next to nothing: its present values, about which the model is linearised, must come to zero too."""
    groups = {g.name: g for p in processes if not p.certain for g in p.groups if g.level > 0 and g.of_level.spread}
    fallen = {g.name for p in began for g in p.groups if g.name in groups and groups[g.name].level < g.level}

    def without(gone: set[str]) -> float:
        tried = tuple(p.at({g.name: NOTHING * g.of_level.median if g.name in gone else g.level for g in p.groups}) for p in processes)
        left = (groups[n] for n in gone)
        return at(tried) - sum(g.of_level.deviance(NOTHING * g.of_level.median) + g.of_memory.deviance(g.memory) for g in left)

    gone: set[str] = set()
    for trial in ([fallen] if len(fallen) > 1 else []) + [{n} for n in groups]:
        if trial <= gone:
            continue
        there = without(gone | trial)
        if there < deviance + WORTH:
            gone, deviance = gone | trial, there
    return tuple(p.at({g.name: 0.0 if g.name in gone else g.level for g in p.groups}) for p in processes), deviance


def opened(processes: Sequence[Process], kinds: Sequence[str], share: float = ENTERS) -> tuple[Process, ...]:
    """The processes with all groups of some kinds (names of processes) that are zero at a share of their prior's median."""
    return tuple(
        p.at({g.name: g.level or share * g.of_level.median for g in p.groups if g.of_level.spread}) if p.name in kinds else p
        for p in processes
    )


def noise_factors(fit: Fit) -> dict[str, float]:
    """Compared channel -> factor on the standard deviation of its noise, by one step of the fixed point that levels have (MacKay 1992): the
    root of the squares of the whitened residual over the samples, less those that the nuisances determine. Expectation-maximisation comes
    to the same noise in the end, but slowly where nuisances follow most of a channel."""
    square, spread, count = _whitened(fit, None)
    kept = UNSURE * np.sqrt(2 * spread / DRAWS) + 1e-9
    factor = np.sqrt((square + kept) / (np.maximum(count - spread, 0.0) + kept))
    return {n: float(factor[i]) for i, n in enumerate(fit.misfit.observed.outputs) if count[i] > 0}


def mean_squares(fit: Fit, change: np.ndarray | None = None) -> dict[str, tuple[float, float]]:
    """Compared channel -> (mean square of the whitened residual, what the nuisances' own uncertainty adds included; number of samples).
    change: (n,) of the globals before that."""
    square, spread, count = _whitened(fit, change)
    outputs = fit.misfit.observed.outputs
    return {n: (float((square[i] + spread[i]) / count[i]), float(count[i])) for i, n in enumerate(outputs) if count[i] > 0}


def smoothed_residual(fit: Fit) -> np.ndarray:
    """(K, N+1, Y) whitened residual of a fit of which segments count, its nuisances at their best; NaN where nothing was measured, and of
    segments that do not count. Raises LookupError where none do."""
    found = np.full(fit.misfit.observed.measured.shape, np.nan)
    for which, _, r in _smoothed(fit, None):
        found[which] = r
    return found


def _smoothed(fit: Fit, change: np.ndarray | None) -> Iterator[tuple[slice, Links, np.ndarray]]:
    """(segments, their links, their part of `smoothed_residual`), group by group. change: (n,) of the globals before that."""
    misfit, moved = fit.misfit, fit.information.nuisances(change)
    parameters, of_globals = ((), None) if change is None else (fit.names, change[:, None])
    counts = np.isin(np.arange(len(fit.alive)), fit.counted)
    for which, links, _ in misfit.parts(fit.parameters.vector(fit.names), fit.own, parameters):
        counting = (links.weight > 0) & counts[which, None, None]
        yield which, links, np.where(counting, links.r - misfit.changed(links, moved.of(which), of_globals)[..., 0], np.nan)


def _whitened(fit: Fit, change: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(squares of the whitened residual, variances that the nuisances give it, number of samples), each a sum by channel (Y,)."""
    around, found = fit.information.samples(DRAWS, seed=0), np.zeros((3, len(fit.misfit.observed.outputs)))
    for which, links, r in _smoothed(fit, change):
        spread = (fit.misfit.changed(links, around.of(which)) ** 2).mean(axis=-1)
        found += [np.where(np.isfinite(r), values, 0.0).sum(axis=(0, 1)) for values in (r**2, spread, 1.0)]
    return found[0], found[1], found[2]
