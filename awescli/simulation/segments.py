"""Cut a log into re-initialised segments: inputs, set-points, starts, measured outputs and their weights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.flightlog.log import FlightLog
from awescli.flightlog.smoothing import local_quadratic
from awescli.notation.angles import wrap
from awescli.notation.quantities import ANGLES, OUTPUTS, STATES, SURFACES
from awescli.physics.declaration import Noise
from awescli.physics.flight_model import FlightModel
from awescli.simulation.rollout import Segments, Trajectories, inputs_of, setpoints_of

COMMAND_SHARE = 0.01
"""Share of a set-point's range that stands for its noise where a law in the loop predicts it: about what the best fitted law leaves
(Rositani reports 0.0181)."""
SMOOTHING = 0.3
"""[s] window of the local quadratic that gives the first guess of a segment's start."""


@dataclass(frozen=True)
class Observed:
    """Segments of a log with what was measured on them.

    segments: to simulate; outputs: names of the compared channels; measured: (K, N+1, n_out); sigma: (K, N+1, n_out) standard
    deviation of the measurement noise, inf where a sample must not count; added: (n_out,) variance in it beside the sensors'.
    """

    segments: Segments
    outputs: tuple[str, ...]
    measured: np.ndarray
    sigma: np.ndarray
    added: np.ndarray | float = 0.0

    def pick(self, which: Sequence[int] | np.ndarray | slice) -> "Observed":
        return replace(self, segments=self.segments.pick(which), measured=self.measured[which], sigma=self.sigma[which])

    @property
    def seconds(self) -> float:
        """Of all segments together [s]."""
        return len(self.segments) * self.segments.steps * self.segments.dt

    def spread_out(self, share: float) -> "Observed":
        """A share of the segments, one at least, spread evenly over all of them."""
        count = len(self.segments)
        some = min(max(int(share * count + 1e-9), 1), count)
        return self.pick(np.unique(np.linspace(0, count - 1, some).round().astype(int)))

    def head(self, steps: int) -> "Observed":
        """The first `steps` steps of every segment."""
        s = self.segments
        cut = replace(s, setpoints=s.setpoints[:, : steps + 1], inputs=s.inputs[:, : steps + 1])
        return replace(self, segments=cut, measured=self.measured[:, : steps + 1], sigma=self.sigma[:, : steps + 1])

    def starting_at(self, starts: np.ndarray) -> "Observed":
        return replace(self, segments=self.segments.starting_at(starts))

    def with_sigma(self, sigma: np.ndarray) -> "Observed":
        """The same observations with other noise standard deviations."""
        return replace(self, sigma=sigma, added=0.0)

    def scaled(self, factors: Mapping[str, float]) -> "Observed":
        """The same observations with the noise of some channels larger or smaller by a factor."""
        return replace(self, sigma=self.sigma * np.array([factors.get(n, 1.0) for n in self.outputs]), added=0.0)

    def with_noise(self, variance: np.ndarray) -> "Observed":
        """The same observations with noise of `variance` (n_out,) beside that of the sensors, in the place of what was added before."""
        return replace(self, sigma=np.sqrt(self.sigma**2 - self.added + variance), added=variance)

    def residual(self, trajectories: Trajectories) -> np.ndarray:
        """(measured - simulated) / sigma, (K, N+1, n_out); angles wrapped; 0 where a sample does not count or the rollout has ended."""
        index = [OUTPUTS.index(name) for name in self.outputs]
        error = self.measured - trajectories.outputs[:, :, index]
        for i, name in enumerate(self.outputs):
            if name in ANGLES:
                error[:, :, i] = wrap(error[:, :, i])
        steps = np.arange(error.shape[1])[None, :, None]
        return np.where(steps < trajectories.alive[:, None, None], error / self.sigma, 0.0)


def noise_std(noise: Noise, name: str, signal: np.ndarray) -> np.ndarray:
    """Standard deviation of the measurement noise of one channel, per sample [SI]; of a set-point, which no sensor measures, COMMAND_SHARE
    of its range."""
    if name in SURFACES:
        return np.full(len(signal), COMMAND_SHARE * (np.ptp(signal) or 1.0))
    std, share = noise.channels()[name]
    size = share * np.abs(signal)
    # noise that is a share of the signal does not vanish where the signal does
    return np.maximum(size, 0.1 * size.mean() + std)


def observe(
    log: FlightLog, kite: FlightModel, first: np.ndarray, steps: int, outputs: Sequence[str], values: Mapping[str, np.ndarray] | None = None
) -> Observed:
    """Segments of `steps` samples that begin at samples `first` of the log, with starts from a local quadratic through the log.

    values: parameter name -> (K,) values that differ from segment to segment.
    """
    first = np.asarray(first, dtype=int)
    U, SP = inputs_of(log, kite), setpoints_of(log)
    rows = first[:, None] + np.arange(steps + 1)[None]
    outputs = tuple(name for name in outputs if name in log)
    measured = np.stack([log[name] for name in outputs], axis=1)
    sigma = np.stack([noise_std(kite.declaration.noise, name, log[name]) for name in outputs], axis=1)
    sigma[~log.valid] = np.inf
    # between two values of a slow sensor stands an interpolation, which measures nothing
    sigma[~np.stack([log.is_new(name) for name in outputs], axis=1)] = np.inf
    segments = Segments(first, smooth_states(log)[first], SP[rows], U[rows], log.dt, values or {})
    return Observed(segments, outputs, measured[rows], sigma[rows])


def smooth_states(log: FlightLog) -> np.ndarray:
    """(N, 12) states of the log by a local quadratic in time: a start that is less noisy than one sample."""
    z = np.stack([np.unwrap(log[n]) if n in ANGLES else log[n] for n in STATES], axis=1)
    return local_quadratic(z, log.dt, SMOOTHING)
