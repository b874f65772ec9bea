"""What a model leaves beside noise and the processes that are known to be there: is it worth anything, where does it stand, does it repeat
from loop to loop?"""

from dataclasses import dataclass

import numpy as np

from awescli.estimation.levels import noise_factors
from awescli.flightlog.loops import Loops, find_loops
from awescli.tracing.criteria import CRITERIA, Criteria
from awescli.tracing.models import FittedModel, Frame, fit_bare

BINS = 12
"""Parts of a loop."""
DRAWS = 999
"""Permutations of the phase."""
FEWEST = 4
"""With fewer loops a permutation says nothing."""


@dataclass(frozen=True)
class Repetition:
    """share: of the variance of the smoothed model error that repeats from loop to loop, p: with which chance would make it as large, by
    axis; loops: that were compared."""

    share: dict[str, float]
    p: dict[str, float]
    loops: int

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
    degree of freedom; channels: the same per channel, over the noise that was found; levels: of the model error; repetition: of it, None
    where there is none or too few loops; samples: of all channels on validation."""

    worth: float
    chi2: float
    channels: dict[str, float]
    levels: dict[str, float]
    repetition: Repetition | None
    samples: int

    def floors(self, criteria: Criteria = CRITERIA) -> tuple[float, float]:
        """(chi-square of all channels, of one) up to which nothing but noise is left."""
        of_all, of_one = (criteria.sampling * np.sqrt(2 / max(n, 1.0)) for n in (self.samples, self.samples / max(len(self.channels), 1)))
        return 1 + criteria.floor_error + float(of_all), 1 + criteria.channel_error + float(of_one)

    @property
    def largest(self) -> str:
        """The channel with the largest chi-square."""
        return max(self.channels, key=lambda n: self.channels[n], default="")


def rest_of(frame: Frame, model: FittedModel) -> tuple[FittedModel, Rest]:
    """(the model without model error, what is left)."""
    bare = fit_bare(frame, model) if model.rest else model
    samples = int(sum(f.information.dof.sum() for f in bare.judged))
    repetition = repetition_of(model, find_loops(frame.flights[0].log)) if model.rest else None
    return bare, Rest(bare.deviance - model.deviance if model.rest else 0.0, bare.chi2, channels_of(bare), model.rest, repetition, samples)


def channels_of(model: FittedModel) -> dict[str, float]:
    """Channel -> mean square of the whitened residual on the validation loops, what is not known of starts, processes and parameters
    included: 1 is noise alone. Of several flights the mean, by their samples."""
    squares, samples = {}, {}
    for judged, place in zip(model.judged, model.fit.places, strict=True):
        if not len(judged.heard):
            continue
        count = float(judged.information.dof.sum())
        factors = noise_factors(judged.misfit, judged.information, judged.links, judged.heard, change=model.step[place])
        for name, factor in factors.items():
            squares[name] = squares.get(name, 0.0) + count * factor**2
            samples[name] = samples.get(name, 0.0) + count
    return {name: square / samples[name] for name, square in squares.items()}


def repetition_of(model: FittedModel, loops: Loops) -> Repetition | None:
    """How much of the first flight's smoothed model error repeats over the phase of a loop. None with too few loops."""
    if loops.kind != "loops":
        return None
    share, p, used = {}, {}, 0
    for axis in model.rest:
        times, values = _path(model, axis)
        table = _by_loop(times, values, loops)
        used = len(table)
        if used < FEWEST:
            return None
        share[axis], p[axis] = repeated(table)
    return Repetition(share, p, used)


def repeated(table: np.ndarray, seed: int = 0) -> tuple[float, float]:
    """(share of the variance of the rows' mean, probability that rows turned by chance reach it). table: (loops, bins). Turning keeps how
    smooth a row is."""
    random, (rows, bins) = np.random.default_rng(seed), table.shape
    table = table - table.mean(axis=1, keepdims=True)
    total = float((table**2).mean()) or 1.0

    def mean_square(t: np.ndarray) -> np.ndarray:
        return (t.mean(axis=-2) ** 2).mean(axis=-1)

    seen = float(mean_square(table))
    shifts = random.integers(0, bins, (DRAWS, rows, 1))
    turned = mean_square(table[np.arange(rows)[:, None], (np.arange(bins) - shifts) % bins])
    # a mean of rows that do not repeat still has a rows-th of their variance
    share = (seen / total - 1 / rows) / (1 - 1 / rows)
    return float(np.clip(share, 0.0, 1.0)), float((1 + np.count_nonzero(turned >= seen)) / (1 + DRAWS))


def _path(model: FittedModel, axis: str) -> tuple[np.ndarray, np.ndarray]:
    """(samples, smoothed values) of one axis of the model error at all nodes of the first flight."""
    samples, values = [], []
    for f in (model.fit.flights[0], model.judged[0]):
        at = [i for i, (group, _) in enumerate(f.misfit.labels) if group == axis]
        if not at:
            continue
        nodes = f.misfit.observed.segments.first[f.heard][:, None] + f.misfit.nodes
        samples.append(nodes.ravel())
        values.append(f.own.path[f.heard][..., at[0]].ravel())
    return np.concatenate(samples), np.concatenate(values)


def _by_loop(samples: np.ndarray, values: np.ndarray, loops: Loops) -> np.ndarray:
    """(loops, BINS) means over each part of each loop; loops with an empty part are left out."""
    rows = []
    for first, last in loops.bounds:
        inside = (samples >= first) & (samples < last)
        place = ((samples[inside] - first) * BINS // (last - first)).astype(int)
        count = np.bincount(place, minlength=BINS)
        if (count > 0).all():
            rows.append(np.bincount(place, values[inside], BINS) / count)
    return np.array(rows).reshape(-1, BINS)
