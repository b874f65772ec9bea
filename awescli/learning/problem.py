"""The prediction error that training lowers: cost, and exact gradient, of a network on the segments of a flight."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from awescli.estimation.misfit import DIVERGED_COST
from awescli.flightlog.log import FlightLog
from awescli.learning.correction import ROWS, Correction, HybridKite, of_physics
from awescli.learning.network_inputs import inputs_of_instant, network_inputs
from awescli.learning.orthogonality import Parametric
from awescli.learning.starts import FittedNuisances, estimated_starts, fitted_nuisances
from awescli.notation.angles import wrap
from awescli.notation.errors import BadInput
from awescli.notation.present import present
from awescli.notation.quantities import ANGLES, STATES
from awescli.physics.disturbances import GUSTS, even
from awescli.physics.kite import Kite
from awescli.simulation.hybrid import CorrectedSimulator, Run, Trainable
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed, noise_std, observe

MEASURED_STATE = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r")
"""The whole state as it is measured: what starts are estimated from."""
COMPARED = STATES
"""The whole state (docs/equations.md (29)): what the cost sees. Velocities in body axes: errors across the line and along it differ."""


@dataclass(frozen=True)
class Data:
    """Segments to predict: warm-up of `warmup` steps that only fits the start, then the horizon that counts.

    target: (K, N+1, 12) measured states; sigma: (12,) unit of error per channel; weight: (K, N+1, 12), 1/sigma where a sample
    counts, else 0; prepared: the segments as the simulator that flies them has laid them out, for it alone.
    """

    observed: Observed
    target: np.ndarray
    warmup: int
    sigma: np.ndarray
    weight: np.ndarray
    prepared: Any

    def __len__(self) -> int:
        return len(self.observed.segments)


class Problem:
    """One flight, one kite, one shape of network. `data` cuts segments, `cost` and `gradient` judge weights on them."""

    def __init__(
        self, kite: Kite, log: FlightLog, correction: Correction, warmup: float, *, law: Callable | None = None,
        step: float | None = None, decay: float = 0.0,
        solver: str = "rk4", parametric: Parametric | None = None, orthogonality: float = 0.0, known_starts: bool = False,
        by_range: bool = False,
    ):  # fmt: skip
        """known_starts: predictions begin at the measured states, without a warm-up; by_range: errors count by the range of their channel
        (Rositani's Q) instead of by what the physics leaves of them."""
        self.known_starts, self.by_range = known_starts, by_range
        self.parametric, self.orthogonality = parametric, orthogonality
        self.kite, self.log, self.correction, self.decay = kite, log, correction, decay
        if missing := [n for n in MEASURED_STATE if n not in log]:
            raise BadInput(f"flight '{log.name}' does not measure {', '.join(missing)}", do="Training needs the whole state.")
        self.outputs = COMPARED
        self.measured = np.stack([log[name] for name in COMPARED], axis=1)
        self.noise = state_noise(kite, log)
        self.warmup = 2 if known_starts else max(2, int(round(warmup / log.dt)))
        if solver == "rk4":
            inputs = network_inputs(kite, correction.inputs)
            self.corrected: Trainable = CorrectedSimulator(kite, inputs, correction.sizes, ROWS, self.outputs, law, step)
        else:
            from awescli.simulation.hybrid_torch import SlowSimulator

            inputs = inputs_of_instant(correction.inputs)
            self.corrected = SlowSimulator(kite, inputs, correction.sizes, ROWS, self.outputs, law, solver=solver)
        self.hybrid = HybridKite(kite, correction)
        self.simulator = Simulator(self.hybrid, tuple(map(even, GUSTS)), law and of_physics(law, self.hybrid), step)
        self.constants = correction.constants

    def observed(self, first: np.ndarray, horizon: int) -> Observed:
        """Segments that predict `horizon` samples from sample `first` on; their warm-up lies before it."""
        return observe(self.log, self.kite, np.asarray(first) - self.warmup, self.warmup + horizon, MEASURED_STATE)

    def data(self, observed: Observed, weights: np.ndarray, sigma: np.ndarray | None = None) -> Data:
        """Segments with starts estimated by the model with these weights.

        sigma None: the unit of error of each channel is the model's own root mean square error, or the sensor noise where that is
        larger. So every channel counts by what can be gained on it, and a model at the noise level has cost 1 and little to gain. by_range:
        units are the ranges of the channels, all times the factor that gives the model cost 1.
        """
        if not self.known_starts:
            observed = observed.starting_at(estimated_starts(self.simulator, observed, self.warmup, self.values(weights)))
        prepared = self.corrected.prepare(observed.segments)
        counts = np.isfinite(observed.sigma)
        counts[:, : self.warmup + 1] = False
        target = self.measured[observed.segments.first[:, None] + np.arange(observed.segments.steps + 1)[None]]
        if sigma is None:
            run = self.corrected.rollout(prepared, weights, self.constants)
            error, reached = self._error(target, run)
            use = counts & reached[:, :, None]
            rms = np.sqrt((np.where(use, error, 0) ** 2).sum((0, 1)) / np.maximum(use.sum((0, 1)), 1))
            sigma = np.asarray(np.maximum(self.noise, rms))
            if self.by_range:
                spans = np.ptp(self.measured[self.log.valid], axis=0)
                # one factor for all, so that physics still has cost 1
                sigma = np.asarray(spans) * max(float(np.sqrt(((rms / np.maximum(spans, 1e-12)) ** 2).mean())), 1e-6)
        return Data(observed, target, self.warmup, sigma, counts / sigma, prepared)

    def smoothed(self, observed: Observed, weights: np.ndarray, sigma: np.ndarray) -> FittedNuisances:
        """The segments with starts and the error of the recorded wind fitted to all of their samples: what wind explains is no effect.

        sigma: (12,) unit of error of `data`. Where it exceeds the sensors' noise, residuals are model error that repeats from sample to
        sample; taken as so many independent measurements they would bend the wind beyond what is known of it. So the wind's own
        precision is raised by as much.
        """
        excess = float(np.sqrt(((sigma / self.noise) ** 2).mean()))
        return fitted_nuisances(self.simulator, observed, self.values(weights), self.kite.declaration.wind.std / excess)

    def values(self, weights: np.ndarray) -> dict[str, float]:
        return {f"network.{i}": float(w) for i, w in enumerate(weights)}

    def _error(self, target: np.ndarray, run: Run) -> tuple[np.ndarray, np.ndarray]:
        """Simulated less measured (K, N+1, n_out), 0 beyond a divergence; and which samples (K, N+1) were reached."""
        error = run.outputs - target
        for i, name in enumerate(self.outputs):
            if name in ANGLES:
                error[..., i] = wrap(error[..., i])
        reached = np.arange(error.shape[1])[None] < run.alive[:, None]
        return np.where(reached[..., None], error, 0.0), reached

    def costs(self, data: Data, weights: np.ndarray) -> np.ndarray:
        """(K, n_out) mean squared error in units of sigma, per segment and channel, without penalty."""
        error, reached = self._error(data.target, self.corrected.rollout(data.prepared, weights, self.constants))
        return self._squares(data.weight, error, reached).sum(1) / np.maximum((data.weight > 0).sum(1), 1)

    @staticmethod
    def _squares(weight: np.ndarray, error: np.ndarray, reached: np.ndarray) -> np.ndarray:
        return np.where(reached[..., None], (error * weight) ** 2, DIVERGED_COST * (weight > 0))

    def gradient(self, data: Data, weights: np.ndarray, groups: Sequence[int] | None = None) -> tuple[float, np.ndarray, int]:
        """(cost, its gradient, number of diverged segments) on all segments, or on some lane groups; weight decay
        and the penalty on what parameters can do (`orthogonality`) included."""
        prepared, target, weight = data.prepared, data.target, data.weight
        if groups is not None:
            from awescli.engine.machine import LANES

            which = np.concatenate([np.arange(g * LANES, min((g + 1) * LANES, len(data))) for g in groups])
            prepared, target, weight = prepared.groups(list(groups)), target[which], weight[which]
        run = self.corrected.rollout(prepared, weights, self.constants)
        error, reached = self._error(target, run)
        total = max(int((weight > 0).sum()), 1)
        cost = float(self._squares(weight, error, reached).sum()) / total
        bar, _ = self.corrected.gradient(run, 2 / total * error * weight**2)
        diverged = int((~reached[:, -1]).sum())
        cost, bar = cost + 0.5 * self.decay * float(weights @ weights), bar + self.decay * weights
        if self.orthogonality > 0:
            inside, slope = present(self.parametric, "what parameters can do").penalty(self.correction, weights)
            cost, bar = cost + self.orthogonality * inside, bar + self.orthogonality * slope
        return cost, bar, diverged


def state_noise(kite: Kite, log: FlightLog) -> np.ndarray:
    """(12,) standard deviation of the measured states; u, v, w carry the noise of the velocity and of the angles that turn it."""
    noise = kite.declaration.noise
    typical = {name: float(np.median(noise_std(noise, name, log[name]))) for name in MEASURED_STATE}
    speed = float(np.median(np.sqrt(sum(log[n] ** 2 for n in ("v_n", "v_e", "v_d")))))
    turned = float(np.hypot(typical["v_n"], speed * typical["theta"]))
    return np.array([turned if name in ("u", "v", "w") else typical[name] for name in COMPARED])
