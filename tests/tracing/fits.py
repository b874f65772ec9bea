"""Fits as the search of the library sees them."""

from types import SimpleNamespace

import numpy as np

SEGMENTS = 4


def fitted(gain: float, flies: int = SEGMENTS, cost: float | None = None, noise: float = 1.0):
    """What the search asks of a fit: deviance, that of every train segment, segments that fly; cost with the parameters' prior and without
    what nuisances leave unknown, factor on the noise."""
    solution = SimpleNamespace(outcome="converged", cost=100.0 - gain if cost is None else cost)
    model = SimpleNamespace(
        deviance=100.0 - gain, unseen=50.0 - gain, train=np.full(SEGMENTS, 25.0 - gain / SEGMENTS), flies=flies, strengths=(),
        segments=SEGMENTS,
        rest={"force_z": 1.0},
        fit=SimpleNamespace(solution=solution, deviance=100.0 - gain, ended=True),
        problems=(SimpleNamespace(factors={"alpha": noise}, processes=()),),
    )  # fmt: skip
    model.light = lambda: model
    return model
