"""What a model leaves beside noise and the processes that are known to be there: is it worth anything, where does it stand, does it repeat
from loop to loop, or go on from one to the next?"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from awescli.estimation.levels import mean_squares
from awescli.estimation.processes.base import Group
from awescli.estimation.processes.drift import Drift
from awescli.flightlog.loops import Loops, find_loops
from awescli.notation.quantities import UNITS
from awescli.physics.disturbances import GUSTS
from awescli.tracing.criteria import CRITERIA, Criteria
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.frame import Frame
from awescli.tracing.models import fit_bare

BINS = 12
"""Parts of a loop."""
DRAWS = 999
"""Permutations of the phase."""
FEWEST = 4
"""With fewer loops a permutation says nothing."""


@dataclass(frozen=True)
class Repetition:
    """share: of the variance of a smoothed process that repeats from loop to loop (or goes on from one to the next), p: with which chance
    would make it as large, by axis; loops: that were compared; worth: deviance that the process pays for what repeats (`paid`)."""

    share: dict[str, float]
    p: dict[str, float]
    loops: int
    worth: float = 0.0

    def repeats(self, criteria: Criteria = CRITERIA) -> bool:
        """Does a good part of an axis repeat, and not by chance?"""
        return self.least < criteria.repeats and max(self.share.values(), default=0.0) >= criteria.repeated_share

    @property
    def least(self) -> float:
        """p of all axes together (Bonferroni)."""
        return min(1.0, len(self.p) * min(self.p.values(), default=1.0))


@dataclass(frozen=True)
class Rest:
    """worth: deviance that model error is worth to a model (negative: nothing); chi2: of the model without it, on validation loops, per
    degree of freedom; channels: the same per channel, over the noise that was found; levels: of the model error; repetition: of it, and
    lasting: what of it goes on from loop to loop, None where there is none or too few loops; samples: of all channels on validation;
    by_channel: of each (a slow sensor has fewer), evenly where nothing is said."""

    worth: float
    chi2: float
    channels: dict[str, float]
    levels: dict[str, float]
    repetition: Repetition | None
    samples: int
    lasting: Repetition | None = None
    by_channel: Mapping[str, float] = field(default_factory=dict)

    def floor(self, criteria: Criteria = CRITERIA) -> float:
        """Chi-square of all channels up to which nothing but noise is left."""
        return 1 + criteria.floor_error + criteria.sampling * _by_chance(self.samples)

    def floor_of(self, channel: str, criteria: Criteria = CRITERIA) -> float:
        """The same of one channel."""
        samples = self.by_channel.get(channel, self.samples / max(len(self.channels), 1))
        return 1 + criteria.channel_error + criteria.sampling * _by_chance(samples)

    @property
    def largest(self) -> str:
        """The channel that is farthest above its floor."""
        return max(self.channels, key=lambda n: self.channels[n] - self.floor_of(n), default="")


def _by_chance(samples: float) -> float:
    """Standard deviation of a mean square of as many samples of noise."""
    return float(np.sqrt(2 / max(samples, 1.0)))


def rest_of(frame: Frame, model: FittedModel) -> tuple[FittedModel, Rest]:
    """(the model without model error, what is left)."""
    bare = fit_bare(frame, model) if model.rest else model
    samples = int(sum(f.information.dof.sum() for f in bare.judged))
    worth = bare.deviance - model.deviance if model.rest else 0.0
    axes = [(axis, axis) for axis in model.rest]
    again, on = (repetition_of(frame, model, axes, of) if axes else None for of in (repeated, lasting))
    channels, by_channel = channels_of(bare)
    return bare, Rest(worth, bare.chi2, channels, model.rest, again, samples, on, by_channel)


def channels_of(model: FittedModel) -> tuple[dict[str, float], dict[str, float]]:
    """(channel -> mean square of the whitened residual on the validation loops, what is not known of starts, processes and parameters
    included: 1 is noise alone; channel -> samples). Of several flights the mean, by their samples."""
    squares, samples = {}, {}
    for judged, place in zip(model.judged, model.fit.places, strict=True):
        if not len(judged.counted):
            continue
        for name, (square, count) in mean_squares(judged, change=model.step[place]).items():
            squares[name] = squares.get(name, 0.0) + count * square
            samples[name] = samples.get(name, 0.0) + count
    return {name: square / samples[name] for name, square in squares.items()}, samples


def gusts_of(model: FittedModel, place: int | None = None) -> list[Group]:
    """The gusts that move the kite, wind record aside: in one of the flights, or the strongest of each kind in any."""
    strongest: dict[str, Group] = {}
    for problem in model.problems if place is None else [model.problems[place]]:
        for group in (g for p in problem.processes if not p.certain for g in p.groups if g.level > 0 and set(g.axes) <= set(GUSTS)):
            if group.name not in strongest or group.level > strongest[group.name].level:
                strongest[group.name] = group
    return list(strongest.values())


def gusty(model: FittedModel, criteria: Criteria = CRITERIA) -> bool:
    """Is a model's air gusty, in any of the flights?"""
    return any(g.level >= criteria.gusty for g in gusts_of(model))


def repetition_of_gusts(frame: Frame, model: FittedModel) -> Repetition | None:
    """How much of the smoothed gusts repeats from loop to loop: air does not know where in its loop a kite is; what repeats is no gust."""
    axes = [(g.name, axis) for g in gusts_of(model) for axis in g.axes]
    return repetition_of(frame, model, axes, repeated) if axes else None


def offsets_of_drifts(model: FittedModel) -> dict[str, tuple[float, str]]:
    """Group of drifts -> (size of the mean of its smoothed drift over a flight, that in words), of the channel and flight where that is
    largest, and larger than the drift's level: a drift wanders about zero, a sensor that is off does not."""
    found: dict[str, tuple[float, str]] = {}
    for place, problem in enumerate(model.problems):
        groups = [g for p in problem.processes if p.name == Drift.name for g in p.groups if g.level > 0]
        for group, axis in ((g, axis) for g in groups for axis in g.axes):
            values = _path(model, place, (group.name, axis))[1]
            mean = float(values.mean()) if len(values) else 0.0
            if abs(mean) > max(group.level, found.get(group.name, (0.0, ""))[0]):
                found[group.name] = abs(mean), f"{axis} is off by {mean:.3g} {UNITS[axis]} on average"
    return found


def steps_of_drifts(frame: Frame, model: FittedModel) -> dict[str, float] | None:
    """Channel -> how large the largest step of its sensor's smoothed drift is (`step_of`), in the flight where its drift is largest: a
    drift wanders, a sensor that changes in flight steps. None where there is no drift, or no flight by loops."""
    axes = dict.fromkeys(
        label
        for problem, judged in zip(model.problems, model.judged, strict=True)
        for group in (g for p in problem.processes if p.name == Drift.name for g in p.groups)
        for label in ((group.name, axis) for axis in group.axes)
        if group.level > 0 and label in judged.misfit.labels
    )
    found: dict[str, float] = {}
    for label in axes:
        place, _ = _largest(model, label[0])
        loops = find_loops(frame.flights[place].log)
        table = _by_loop(*_path(model, place, label), loops)
        if loops.kind == "loops" and len(table) >= FEWEST:
            found[label[1]] = step_of(table)
    return found or None


def step_of(table: np.ndarray) -> float:
    """The largest change of a path from the mean over the loop before any moment to the mean over the loop behind it, over the usual one
    (median absolute change, as a standard deviation). table: as in `repeated`. Of an Ornstein-Uhlenbeck process 2 to 4, whatever its
    level and its memory (`tests/tracing/test_rest.py`)."""
    length, path = table.shape[1], table.ravel()
    windows = np.lib.stride_tricks.sliding_window_view(path, length)
    seen = np.isfinite(windows).sum(axis=1)
    means = np.where(2 * seen >= length, np.nansum(windows, axis=1) / np.maximum(seen, 1), np.nan)
    changes = np.abs(means[length:] - means[:-length])
    changes = changes[np.isfinite(changes)]
    usual = 1.4826 * float(np.median(changes)) if len(changes) else 0.0
    return float(changes.max()) / usual if usual > 0 else 0.0


def repetition_of(
    frame: Frame, model: FittedModel, axes: Sequence[tuple[str, str]], of: Callable[[np.ndarray], tuple[float, float]]
) -> Repetition | None:
    """How much of smoothed processes repeats over the phase of a loop (`repeated`), or goes on from loop to loop (`lasting`): of each in
    the flight where it is largest. axes: (group, axis). None with too few loops."""
    share, p, used, worth = {}, {}, [], 0.0
    for label in axes:
        place, group = _largest(model, label[0])
        log = frame.flights[place].log
        loops = find_loops(log)
        if loops.kind != "loops":
            return None
        axis, table = label[1], _by_loop(*_path(model, place, label), loops)
        if len(table) < FEWEST:
            return None
        used.append(len(table))
        share[axis], p[axis] = of(table)
        worth += paid(table, log.dt * float(np.diff(loops.bounds).mean()) / BINS, group)
    return Repetition(share, p, min(used), worth)


def _largest(model: FittedModel, name: str) -> tuple[int, Group]:
    """(place of the flight, group of a process) where it is largest: another flight may hold nothing of it."""
    found = [(i, g) for i, p in enumerate(model.problems) for process in p.processes for g in process.groups if g.name == name]
    return max(found, key=lambda each: each[1].level)


def repeated(table: np.ndarray, seed: int = 0) -> tuple[float, float]:
    """(share of the variance that the parts' means explain, beyond chance; probability that rows turned by chance reach it). table: (loops,
    bins), nan where a part of a loop was not flown in a segment. Turning keeps how smooth a row is, and what of it was seen."""
    random, (rows, bins) = np.random.default_rng(seed), table.shape
    table = table - np.nanmean(table, axis=1, keepdims=True)
    there, values = np.isfinite(table), np.nan_to_num(table)
    total = float((values**2).sum()) or 1.0

    def explained(values: np.ndarray, there: np.ndarray) -> np.ndarray:
        return (values.sum(axis=-2) ** 2 / np.maximum(there.sum(axis=-2), 1)).sum(axis=-1) / total

    turns = np.arange(rows)[:, None], (np.arange(bins) - random.integers(0, bins, (DRAWS, rows, 1))) % bins
    seen, turned = float(explained(values, there)), explained(values[turns], there[turns])
    by_chance = float(turned.mean())
    share = (seen - by_chance) / max(1 - by_chance, 1e-9)
    return float(np.clip(share, 0.0, 1.0)), float((1 + np.count_nonzero(turned >= seen)) / (1 + DRAWS))


def paid(table: np.ndarray, step: float, group: Group) -> float:
    """Deviance that an Ornstein-Uhlenbeck process pays for a path through parts of loops, `step` [s] apart, beyond what it would with the
    parts' means given: what a term that says them would gain. Of chance it is zero on average. table: as in `repeated`."""
    there, bins = np.isfinite(table), table.shape[1]
    values = np.nan_to_num(table - np.nanmean(table, axis=1, keepdims=True))
    pattern, kept = values.sum(axis=0) / np.maximum(there.sum(axis=0), 1), np.exp(-step / group.memory)
    innovations = (np.roll(pattern, -1) - kept * pattern) / (group.level * np.sqrt(1 - kept**2))
    return max(float(there.sum() / bins * (innovations**2).sum()) - (bins - 1), 0.0)


def lasting(table: np.ndarray, seed: int = 0) -> tuple[float, float]:
    """(share of the variance that a loop hands on to the next one, beyond chance; probability that loops in any other order reach it).
    table: as in `repeated`. The share is the covariance of the means of successive loops: it shows what grows, wears or breaks."""
    random, means = np.random.default_rng(seed), np.nanmean(table, axis=1)
    means = means - means.mean()
    orders = random.permuted(np.tile(means, (DRAWS, 1)), axis=1)
    seen, by_chance = float(np.mean(means[1:] * means[:-1])), np.mean(orders[:, 1:] * orders[:, :-1], axis=1)
    share = (seen - by_chance.mean()) / (float(np.nanvar(table)) or 1.0)
    return float(np.clip(share, 0.0, 1.0)), float((1 + np.count_nonzero(by_chance >= seen)) / (1 + DRAWS))


def _path(model: FittedModel, place: int, label: tuple[str, str]) -> tuple[np.ndarray, np.ndarray]:
    """(samples, smoothed values) of one (group, axis) of the processes at all nodes of a flight; none where it has none."""
    samples, values = [np.zeros(0, int)], [np.zeros(0)]
    for f in (model.fit.flights[place], model.judged[place]):
        if label not in f.misfit.labels:
            continue
        axis = f.misfit.labels.index(label)
        nodes = f.misfit.observed.segments.first[f.counted][:, None] + f.misfit.nodes
        samples.append(nodes.ravel())
        values.append(f.own.path[f.counted][..., axis].ravel())
    return np.concatenate(samples), np.concatenate(values)


def _by_loop(samples: np.ndarray, values: np.ndarray, loops: Loops) -> np.ndarray:
    """(loops, BINS) means over each part of each loop, nan where it was not flown in a segment; of loops that were flown for the most."""
    rows = []
    for first, last in loops.bounds:
        inside = (samples >= first) & (samples < last)
        place = ((samples[inside] - first) * BINS // (last - first)).astype(int)
        count = np.bincount(place, minlength=BINS)
        if 2 * np.count_nonzero(count) > BINS:
            rows.append(np.where(count > 0, np.bincount(place, values[inside], BINS) / np.maximum(count, 1), np.nan))
    return np.array(rows).reshape(-1, BINS)
