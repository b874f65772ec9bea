"""Does an effect keep its size while a flight goes on? Ice grows, a zero drifts, a line wears: a model with one size for all of it is then
not what is there, however little it leaves.

A score test (Rao): to each strength a second one is added that grows with time through the flight, -1 at its beginning and +1 at its
end, and asked for what it would gain at once, everything else free to answer. Of a size that stays, the gain is chi-square distributed.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from awescli.estimation.fit import Fit
from awescli.estimation.links import Gram
from awescli.notation.parameters import Parameter
from awescli.tracing.models import FittedModel
from awescli.tracing.screen import firm

FEWEST = 3
"""Segments of which no course in time is asked."""


def steadiness(model: FittedModel) -> float:
    """Probability that chance makes the sizes of a model's effects drift so much through a flight; the least of its flights."""
    found = [1.0]
    for fit, place in zip(model.fit.flights, model.fit.places, strict=True):
        strengths = [i for i, name in enumerate(fit.names) if name in model.strengths]
        prior = [replace(model.fit.prior[model.fit.names[i]], name=name) for i, name in zip(place, fit.names, strict=True)]
        if strengths and len(fit.counted) > FEWEST:
            found.append(float(stats.chi2.sf(_gain(fit, strengths, prior), len(strengths))))
    return min(found)


def _gain(fit: Fit, strengths: Sequence[int], prior: Sequence[Parameter]) -> float:
    """Deviance that strengths which grow with time would gain beside those of a fit, to first order."""
    misfit, n, begins = fit.misfit, len(fit.names), fit.misfit.begins
    precision = np.array([1 / p.prior_std**2 for p in prior])
    pull = precision * np.array([p.value - fit.parameters[p.name].value for p in prior])
    late = 2 * (begins - begins.min()) / max(float(np.ptp(begins)), 1e-9) - 1
    info = misfit.eliminated(_grown(fit.gram, strengths, late), fit.own, fit.counted)
    H, b = info.H.copy(), info.b.copy()
    H[:n, :n] += np.diag(precision)
    absorbed = np.linalg.solve(H[:n, :n], H[:n, n:])
    left = b[n:] - absorbed.T @ (b[:n] + pull)
    A = firm(H[n:, n:] - H[n:, :n] @ absorbed)
    return float(left @ np.linalg.solve(A, left))


def _grown(gram: Gram, which: Sequence[int], late: np.ndarray) -> Gram:
    """Gram matrices with the columns of some globals a second time behind all others, times `late` (K,) in each segment."""
    order = np.r_[: gram.n, which, gram.n].astype(int)
    times = np.ones((len(gram), len(order)))
    times[:, gram.n : -1] = late[:, None]
    y = gram.y[:, order[:, None], order] * times[:, :, None] * times[:, None, :]
    return replace(gram, xy=gram.xy[..., order] * times[:, None, None, :], y=y)
