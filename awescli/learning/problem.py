"""The prediction error that training lowers: cost, and exact gradient, of a network on the segments of a flight."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from awescli.learning.correction import ROWS, Correction, HybridKite
from awescli.learning.network_inputs import inputs_of_instant, network_inputs
from awescli.learning.starts import Own, estimated_starts, own_unknowns
from awescli.notation.errors import BadInput
from awescli.notation.quantities import ANGLES
from awescli.physics.kite import GUSTS, Kite
from awescli.simulation.hybrid import CorrectedSimulator, Prepared
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed, observe, wrap

COMPARED = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r")
"""The whole state (seed section 5), as it is measured."""
DIVERGED_COST = 25.0
"""Cost of a sample that a diverged rollout never reached: five times the physics' own error, squared."""


@dataclass(frozen=True)
class Data:
    """Segments to predict: warm-up of `warmup` steps that only fits the start, then the horizon that counts.

    sigma: (12,) unit of error per channel; weight: (K, N+1, 12), 1/sigma where a sample counts, else 0; prepared: for the kernels.
    """

    observed: Observed
    warmup: int
    sigma: np.ndarray
    weight: np.ndarray
    prepared: Prepared

    def __len__(self) -> int:
        return len(self.observed.segments)


class Problem:
    """One flight, one kite, one shape of network. `data` cuts segments, `cost` and `gradient` judge weights on them."""

    def __init__(self, kite: Kite, log, correction: Correction, warmup: float, *, law=None, substeps: int = 1, decay: float = 0.0, solver: str = "rk4"):
        self.kite, self.log, self.correction, self.decay = kite, log, correction, decay
        self.outputs = tuple(n for n in COMPARED if n in log)
        if len(self.outputs) < 6:
            raise BadInput(f"flight '{log.name}' measures too little of the state ({', '.join(self.outputs)})")
        self.warmup = max(2, int(round(warmup / log.dt)))
        if solver == "rk4":
            inputs = network_inputs(kite, correction.inputs)
            self.corrected = CorrectedSimulator(kite, inputs, correction.sizes, ROWS, self.outputs, law, substeps)
        else:
            from awescli.simulation.hybrid_torch import SlowSimulator

            self.corrected = SlowSimulator(kite, inputs_of_instant(correction.inputs), correction.sizes, ROWS, self.outputs, law, solver=solver)
        self.hybrid = HybridKite(kite, correction)
        # the law is a function of the physical parameters, which stand first
        own = len(kite.parameter_names)
        self.simulator = Simulator(self.hybrid, GUSTS, (lambda x, u, c: law(x, u, c[:own])) if law else None, substeps)
        self.constants = correction.constants

    def observed(self, first: np.ndarray, horizon: int) -> Observed:
        """Segments that predict `horizon` samples from sample `first` on; their warm-up lies before it."""
        return observe(self.log, self.kite, np.asarray(first) - self.warmup, self.warmup + horizon, self.outputs)

    def data(self, observed: Observed, weights: np.ndarray, sigma: np.ndarray | None = None) -> Data:
        """Segments with starts estimated by the model with these weights.

        sigma None: the unit of error of each channel is the model's own root mean square error, or the sensor noise where that is
        larger. So every channel counts by what can be gained on it, and a model at the noise level has cost 1 and little to gain.
        """
        starts = estimated_starts(self.simulator, observed, self.warmup, self.values(weights))
        observed = observed.starting_at(starts)
        prepared = self.corrected.prepare(observed.segments)
        counts = np.isfinite(observed.sigma)
        counts[:, : self.warmup + 1] = False
        if sigma is None:
            run = self.corrected.rollout(prepared, weights, self.constants)
            error, reached = self._error(observed, run)
            use = counts & reached[:, :, None]
            noise = np.array([_typical(observed.sigma[..., i]) for i in range(len(self.outputs))])
            rms = np.sqrt((np.where(use, error, 0) ** 2).sum((0, 1)) / np.maximum(use.sum((0, 1)), 1))
            sigma = np.maximum(noise, rms)
        return Data(observed, self.warmup, sigma, counts / sigma, prepared)

    def smoothed(self, observed: Observed, weights: np.ndarray) -> Own:
        """The segments with starts and the error of the recorded wind fitted to all of their samples: what wind can explain is no effect."""
        return own_unknowns(self.simulator, observed, self.values(weights), self.kite.declaration.wind.std)

    def values(self, weights: np.ndarray) -> dict[str, float]:
        return {f"network.{i}": float(w) for i, w in enumerate(weights)}

    def _error(self, observed: Observed, run) -> tuple[np.ndarray, np.ndarray]:
        """Simulated less measured (K, N+1, n_out), 0 beyond a divergence; and which samples (K, N+1) were reached."""
        error = run.outputs - observed.measured
        for i, name in enumerate(self.outputs):
            if name in ANGLES:
                error[..., i] = wrap(error[..., i])
        reached = np.arange(error.shape[1])[None] < run.alive[:, None]
        return np.where(reached[..., None], error, 0.0), reached

    def costs(self, data: Data, weights: np.ndarray) -> np.ndarray:
        """(K, n_out) mean squared error in units of sigma, per segment and channel, without penalty."""
        error, reached = self._error(data.observed, self.corrected.rollout(data.prepared, weights, self.constants))
        return self._squares(data, error, reached).sum(1) / np.maximum((data.weight > 0).sum(1), 1)

    def _squares(self, data: Data, error, reached) -> np.ndarray:
        return np.where(reached[..., None], (error * data.weight) ** 2, DIVERGED_COST * (data.weight > 0))

    def gradient(self, data: Data, weights: np.ndarray, groups: Sequence[int] | None = None) -> tuple[float, np.ndarray, int]:
        """(cost, its gradient, number of diverged segments) on all segments, or on some lane groups; weight decay included."""
        prepared, observed, weight = data.prepared, data.observed, data.weight
        if groups is not None:
            from awescli.engine.machine import LANES

            which = np.concatenate([np.arange(g * LANES, min((g + 1) * LANES, len(data))) for g in groups])
            prepared, observed, weight = prepared.groups(list(groups)), observed.pick(which), weight[which]
        data = Data(observed, data.warmup, data.sigma, weight, prepared)
        run = self.corrected.rollout(prepared, weights, self.constants)
        error, reached = self._error(observed, run)
        total = max(int((weight > 0).sum()), 1)
        cost = float(self._squares(data, error, reached).sum()) / total
        bar, _ = self.corrected.gradient(run, 2 / total * error * weight**2)
        diverged = int((~reached[:, -1]).sum())
        return cost + 0.5 * self.decay * float(weights @ weights), bar + self.decay * weights, diverged


def _typical(sigma: np.ndarray) -> float:
    finite = sigma[np.isfinite(sigma)]
    return float(np.median(finite)) if finite.size else 1.0
