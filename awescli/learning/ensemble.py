"""Several networks from different seeds: where they agree the flight has decided, where they differ nobody knows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import Range
from awescli.learning.correction import Correction, HybridKite
from awescli.learning.training import State, Trained, TrainingConfig, train
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Segments, Simulator


@dataclass(frozen=True)
class Ensemble:
    """members: one training per seed; the one with the lowest validation error stands for all."""

    members: tuple[Trained, ...]

    @property
    def best(self) -> Trained:
        learned = [m for m in self.members if not m.correction.is_zero]
        return min(learned or self.members, key=lambda m: m.state.best_cost)

    @property
    def corrections(self) -> tuple[Correction, ...]:
        return tuple(m.correction for m in self.members)


def train_ensemble(kite: Kite, log: FlightLog, train_ranges: Sequence[Range], validation_ranges: Sequence[Range], config: TrainingConfig,
    members: int,
                   progress: Callable[[str, float], None] = lambda text, cost: None, *, law: Callable | None = None,
                   resume: Callable[[int], State | None] = lambda member: None,
                   checkpoint: Callable[[int, State], None] = lambda member, state: None) -> Ensemble:  # fmt: skip
    """`members` trainings with seeds seed, seed+1, ..., the time budget shared among them.

    resume(member): where that member's training stood, if it was interrupted; checkpoint(member, state) after every round.
    """
    found = []
    for i in range(members):
        own = replace(config, seed=config.seed + i, budget=config.budget / members, compare=config.compare and i == 0)
        tell = (lambda text, cost, i=i: progress(f"network {i + 1} of {members}: {text}", cost)) if members > 1 else progress
        trained = train(
            kite, log, train_ranges, validation_ranges, own, tell, law=law, state=resume(i),
            checkpoint=lambda state, i=i: checkpoint(i, state),
        )  # fmt: skip
        found.append(trained)
    return Ensemble(tuple(found))


def spread(kite: Kite, corrections: Sequence[Correction], segments: Segments, law: Callable | None = None) -> tuple[np.ndarray, np.ndarray]:
    """(mean, standard deviation) of the simulated outputs (K, N+1, 23) over the members; NaN from where any of them diverged."""
    found = []
    for correction in corrections:
        trajectories = Simulator(HybridKite(kite, correction), (), law).rollout(segments)
        outputs = trajectories.outputs.copy()
        outputs[np.arange(outputs.shape[1])[None] >= trajectories.alive[:, None]] = np.nan
        found.append(outputs)
    return np.mean(found, axis=0), np.std(found, axis=0, ddof=1 if len(found) > 1 else 0)
