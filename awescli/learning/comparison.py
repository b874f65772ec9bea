"""Rositani (2025), figure 3: Adam alone beside Adam followed by L-BFGS, from the same point, for the same effort.

Adam alone goes on exactly as before (same batches, same step size, starts estimated anew every round) from where L-BFGS took over, until
it has had as many gradients of all segments as L-BFGS had, and as many seconds. Both keep the weights with the lowest validation error
since the switch, so neither is judged by where it happened to stop.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from awescli.learning.optimisers import Adam

AdamRound = Callable[[np.ndarray, Adam, int], tuple[np.ndarray, Adam, float, tuple[np.ndarray, float]]]
"""(weights, optimiser, number of the round) -> (weights, optimiser, gradients of all segments that were spent, (weights of the lowest
validation error on the way, that error))"""


@dataclass(frozen=True)
class Alone:
    """Adam alone at one limit. best: (n,) weights of its lowest validation error; last: (n,) where it ended; spent: gradients of all
    segments; seconds: it took."""

    best: np.ndarray
    last: np.ndarray
    spent: float
    seconds: float


def adam_alone(
    start: tuple[np.ndarray, Adam], one_round: AdamRound, lowest: float, gradients: float, seconds: float, clock: Callable[[], float],
) -> tuple[Alone, Alone]:  # fmt: skip
    """(at equal gradients, at equal wall time) of Adam going on from `start` = (weights, optimiser), whose validation error is
    `lowest`."""
    weights, adam = start
    best, spent, number = weights, 0.0, 0
    began = clock()
    reached: dict[int, Alone] = {}
    while len(reached) < 2:
        weights, adam, more, (passed_by, cost) = one_round(weights, adam, number)
        spent, number = spent + more, number + 1
        best, lowest = (passed_by, cost) if cost < lowest else (best, lowest)
        passed = clock() - began
        for i, over in enumerate((spent >= gradients, passed >= seconds)):
            if over and i not in reached:
                reached[i] = Alone(best, weights, spent, passed)
    return reached[0], reached[1]
