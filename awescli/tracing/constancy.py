"""Does an effect keep its size while a flight goes on, and however the kite flies? Ice grows, a zero drifts, a gyro feels acceleration: a
model with one size for all of it is then not what is there, however little it leaves.

Score tests (Rao): to each strength a second one is added that goes with time through the flight, -1 at its beginning and +1 at its end, or
with a predicted channel less its mean, over its standard deviation. It is asked for what it would gain at once, everything else free to
answer. Of a size that stays, the gain is chi-square distributed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from awescli.estimation.fitted import Fit
from awescli.estimation.information_filter import Information
from awescli.estimation.laplace import APART, differences
from awescli.estimation.links import Gram, joined
from awescli.notation.parameters import ParameterTable
from awescli.tracing.criteria import CRITERIA, Criteria
from awescli.tracing.fitted_model import FittedModel
from awescli.tracing.screen import firm

FEWEST = 3
"""Segments of which no course is asked."""


def steadiness(model: FittedModel, criteria: Criteria = CRITERIA) -> float:
    """Probability that chance makes the sizes of a model's effects drift so much through a flight; the least of its flights."""
    found = [1.0]
    for fit, strengths, prior in _fits(model):
        begins = fit.misfit.begins
        late = 2 * (begins - begins.min()) / max(float(np.ptp(begins)), 1e-9) - 1
        info = fit.misfit.eliminated(_grown(fit.gram, strengths, late), fit.own, fit.counted)
        p = _by_chance(fit, info, prior, fit.slope[strengths] * late[fit.counted].mean())
        found.append(p if p >= criteria.steady else _by_chance(fit, info, prior, _integrated(fit, strengths, late)))
    return min(found)


def _by_chance(fit: Fit, info: Information, prior: ParameterTable, integrated: np.ndarray) -> float:
    """Probability that chance gains what the strengths behind the parameters of a fit would gain; integrated: as of `_gain`."""
    return float(stats.chi2.sf(_gain(fit, info, prior, slice(len(fit.names), None), integrated), len(integrated)))


def _integrated(fit: Fit, strengths: Sequence[int], late: np.ndarray) -> np.ndarray:
    """What integrating the nuisances out adds to the slope of strengths that grow with `late` (K,): not as much in every segment where an
    effect acts in some. A stall in a gusty flight, all of it there, seemed to grow (p of 1e-34) as long as every segment was given the
    mean, as one still is of which that is all that is known."""
    found, x = fit.slope[strengths] * late[fit.counted].mean(), fit.parameters.vector(fit.names)
    for place, i in enumerate(strengths):
        step = APART * np.sqrt(fit.covariance[i, i]) * np.eye(len(x))[i]
        either = differences(fit.misfit, x, fit.own, fit.information, fit.counted, step) if step[i] > 0 else None
        if either is not None:
            each = -0.5 * (either[0] - either[1]) / (2 * step[i])
            found[place] += float((each - each.mean()) @ late[fit.counted])
    return found


def gains_along(model: FittedModel) -> dict[str, float]:
    """Output channel -> deviance that sizes of a model's effects which go with it would gain; the most of its flights. Empty without an
    effect. What integrating the nuisances out adds to their slope is not known sample by sample: the least of what they gain without it,
    and with what it adds to the parameters that do the same, which have theirs from the fit. (The zero of a load cell that grows with
    tension is its scale; without, it seemed to gain 12000 in gusts. A pitot's scale that grew with tension seemed to gain 134 with it, 5
    without.)"""
    found: dict[str, float] = {}
    for fit, strengths, prior in _fits(model):
        info = fit.misfit.eliminated(_along_outputs(fit, strengths), fit.own, fit.counted)
        n, m = len(fit.names), len(strengths)
        for place, channel in enumerate(fit.misfit.observed.outputs):
            asked = slice(n + place * m, n + (place + 1) * m)
            gain = min(_gain(fit, info, prior, asked, added) for added in (None, np.zeros(m)))
            found[channel] = max(found.get(channel, 0.0), gain)
    return found


def _fits(model: FittedModel) -> Iterator[tuple[Fit, list[int], ParameterTable]]:
    """(fit, where the strengths stand among its names, prior of its names) of every flight that can be asked."""
    for fit, place in zip(model.fit.flights, model.fit.places, strict=True):
        strengths = [i for i, name in enumerate(fit.names) if name in model.strengths]
        prior = ParameterTable(replace(model.fit.prior[model.fit.names[i]], name=name) for i, name in zip(place, fit.names, strict=True))
        if strengths and len(fit.counted) > FEWEST:
            yield fit, strengths, prior


def _gain(fit: Fit, info: Information, prior: ParameterTable, asked: slice, integrated: np.ndarray | None = None) -> float:
    """Deviance that some further strengths would gain beside the parameters of a fit, to first order. integrated: what integrating the
    nuisances out adds to their slope; None: what it adds to the parameters that do the same."""
    n = len(fit.names)
    away, slope = prior.deviations(fit.names, fit.parameters.vector(fit.names))
    absorbed = np.linalg.solve(info.H[:n, :n] + np.diag(slope**2), info.H[:n, asked])
    added = absorbed.T @ fit.slope if integrated is None else integrated
    left = info.b[asked] + added - absorbed.T @ (info.b[:n] + fit.slope - slope * away)
    A = firm(info.H[asked, asked] - info.H[asked, :n] @ absorbed)
    return float(left @ np.linalg.solve(A, left))


def _grown(gram: Gram, which: Sequence[int], late: np.ndarray) -> Gram:
    """Gram matrices with the columns of some globals a second time behind all others, times `late` (K,) in each segment."""
    order = np.r_[: gram.n, which, gram.n].astype(int)
    times = np.ones((len(gram), len(order)))
    times[:, gram.n : -1] = late[:, None]
    y = gram.y[:, order[:, None], order] * times[:, :, None] * times[:, None, :]
    return replace(gram, xy=gram.xy[..., order] * times[:, None, None, :], y=y)


def _along_outputs(fit: Fit, which: Sequence[int]) -> Gram:
    """Gram matrices with the columns of some globals again behind all others, once for every output channel, times that channel as it is
    predicted there."""
    misfit, x = fit.misfit, fit.parameters.vector(fit.names)
    r, counted = misfit.whitened(x, fit.own)
    seen = np.maximum(counted.sum(axis=(0, 1)), 1)
    residual = np.multiply(r, misfit.observed.sigma, out=np.zeros(r.shape), where=counted)
    predicted = np.where(counted, misfit.observed.measured - residual, 0.0)
    course = np.where(counted, predicted - predicted.sum(axis=(0, 1)) / seen, 0.0)
    course /= np.maximum(np.sqrt((course**2).sum(axis=(0, 1)) / seen), 1e-12)
    grams = []
    for some, links, _ in misfit.parts(x, fit.own, columns=len(which) * r.shape[2]):
        # (K, N, n_out, channels, strengths), the strengths of one channel side by side
        further = links.J[..., None, links.ends.shape[3] + np.asarray(which)] * course[some][:, :, None, :, None]
        J = np.concatenate([links.J, further.reshape(*links.J.shape[:3], -1)], axis=-1)
        grams.append(replace(links, J=J).gram())
    return joined(grams)
