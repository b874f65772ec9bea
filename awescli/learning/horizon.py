"""What is predicted at one horizon: segments of the training and of the validation ranges, and the unit that errors are counted in."""

from collections.abc import Sequence

import numpy as np

from awescli.flightlog.split import Range
from awescli.learning.optimisers import Lowest
from awescli.learning.problem import Data, Problem
from awescli.notation.errors import BadInput


class Horizon:
    """Training and validation segments of one horizon. The unit of error is the physics' own on the training segments."""

    def __init__(
        self,
        problem: Problem,
        seconds: float,
        train_ranges: Sequence[Range],
        validation_ranges: Sequence[Range],
        null: np.ndarray,
    ):
        self.problem, self.seconds = problem, seconds
        steps = max(2, int(round(seconds / problem.log.dt)))
        first = predictions(train_ranges, steps, problem.warmup, max(1, steps // 2), problem.log.valid)
        later = predictions(validation_ranges, steps, problem.warmup, max(1, steps // 2), problem.log.valid)
        if not len(first) or not len(later):
            raise BadInput(f"no whole segment of {seconds:g} s in the training or validation ranges", do="Use shorter horizons.")
        # neighbours share samples: spread them over the batches. An evenly mixed order that needs no random state
        first = first[np.random.default_rng([len(first), steps]).permutation(len(first))]
        self.train_observed, self.validation_observed = problem.observed(first, steps), problem.observed(later, steps)
        self.sigma = problem.data(self.train_observed, null).sigma
        self.baseline = problem.costs(self.validation(null), null)

    def train(self, weights: np.ndarray) -> Data:
        return self.problem.data(self.train_observed, weights, self.sigma)

    def validation(self, weights: np.ndarray) -> Data:
        return self.problem.data(self.validation_observed, weights, self.sigma)

    def validation_costs(self, weights: np.ndarray) -> np.ndarray:
        """(K, n_out)"""
        return self.problem.costs(self.validation(weights), weights)

    def lowest(self, weights: np.ndarray) -> Lowest:
        """Watches validation during a round. Starts are held at what they are for these weights, as those of training are: anew at
        every iteration they would cost more than the gradient."""
        held = self.validation(weights)
        return Lowest(lambda w: float(self.problem.costs(held, w).mean()))

    def best_of(self, *points: np.ndarray | None) -> tuple[np.ndarray, float]:
        """(point, validation cost) of the lowest, each with its own starts."""
        return min(((w, float(self.validation_costs(w).mean())) for w in points if w is not None), key=lambda found: found[1])


def predictions(ranges: Sequence[Range], steps: int, warmup: int, stride: int, valid: np.ndarray) -> np.ndarray:
    """First predicted samples of segments whose warm-up and horizon lie inside one range and are valid for the most part."""
    found = [np.arange(a + warmup, b - steps - 1, stride) for a, b in ranges]
    first = np.concatenate(found) if found else np.empty(0, int)
    share = np.array([valid[k - warmup : k + steps + 1].mean() for k in first])
    return first[share > 0.8].astype(int) if len(first) else first.astype(int)
