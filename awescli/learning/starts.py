"""What each segment has of its own: its start, and the error of the recorded wind during it. Gauss-Newton with exact sensitivities."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.misfit import DIVERGED_COST
from awescli.notation.quantities import STATES
from awescli.physics.disturbances import GUSTS, even
from awescli.simulation.rollout import Columns, Simulator
from awescli.simulation.segments import Observed

ITERATIONS = 3
"""The first guess is a local quadratic, two steps from the answer; a third costs little."""


@dataclass(frozen=True)
class FittedNuisances:
    """observed: the segments with their nuisances at their best; cost: (K,) squared residual there in units of sigma, prior
    included; dof: (K,) samples less unknowns."""

    observed: Observed
    cost: np.ndarray
    dof: np.ndarray

    @property
    def chi2(self) -> np.ndarray:
        """(K,) 1 for a model without error, if sigma is that of the sensors."""
        return self.cost / self.dof


def head(observed: Observed, steps: int) -> Observed:
    """The first `steps` steps of every segment."""
    s = observed.segments
    cut = replace(s, setpoints=s.setpoints[:, : steps + 1], inputs=s.inputs[:, : steps + 1])
    return Observed(cut, observed.outputs, observed.measured[:, : steps + 1], observed.sigma[:, : steps + 1])


def fitted_nuisances(
    simulator: Simulator, observed: Observed, values: Mapping[str, float] | None = None, wind_std: float = 0.0
) -> FittedNuisances:
    """Fit the 12 initial states, and with wind_std > 0 [m/s] a constant error of the wind, of each segment to all of its samples.

    Always begun from the starts that `observed` holds and null wind, so that the answer depends on the model alone. Segments that
    diverge, or of which nothing counts, keep that. The simulator must know GUSTS (`wrt`) for wind_std > 0.
    """
    names = tuple(map(even, GUSTS)) if wind_std > 0 else ()
    prior = np.array([0.0] * 12 + [1 / wind_std**2 if names else 0.0] * len(names))
    columns = Columns(states=STATES, parameters=names)
    weight = np.where(np.isfinite(observed.sigma), 1 / observed.sigma, 0.0)
    K, steps = len(observed.segments), observed.segments.steps
    starts, wind = observed.segments.starts.copy(), np.zeros((K, len(names)))
    for iteration in range(ITERATIONS + 1):
        now = replace(observed.segments, starts=starts, values={**observed.segments.values, **dict(zip(names, wind.T, strict=True))})
        if iteration == ITERATIONS:
            trajectories = simulator.rollout(now, values)
            break
        trajectories, J = simulator.sensitivities(now, columns, observed.outputs, values)
        A = (J * weight[..., None]).reshape(K, -1, len(columns))
        r = observed.residual(trajectories).reshape(K, -1)
        M = np.matmul(A.transpose(0, 2, 1), A) + np.diag(prior)
        b = np.matmul(A.transpose(0, 2, 1), r[..., None])[..., 0]
        b[:, 12:] -= prior[12:] * wind
        size = np.sqrt(np.maximum(np.einsum("kii->ki", M), 1e-12))
        M = M / size[:, :, None] / size[:, None, :] + 1e-9 * np.eye(len(columns))
        step = np.linalg.solve(M, (b / size)[..., None])[..., 0] / size
        good = (trajectories.alive > steps) & np.isfinite(step).all(1) & (weight > 0).any((1, 2))
        step = np.where(good[:, None], step, 0.0)
        starts, wind = starts + step[:, :12], wind + step[:, 12:]
    missing = (np.arange(steps + 1)[None, :, None] >= trajectories.alive[:, None, None]) & (weight > 0)
    cost = (observed.residual(trajectories) ** 2).sum((1, 2)) + DIVERGED_COST * missing.sum((1, 2)) + (prior[12:] * wind**2).sum(1)
    dof = np.maximum((weight > 0).sum((1, 2)) - 12, 1)
    return FittedNuisances(Observed(now, observed.outputs, observed.measured, observed.sigma), cost, dof)


def estimated_starts(simulator: Simulator, observed: Observed, steps: int, values: Mapping[str, float] | None = None) -> np.ndarray:
    """(K, 12) states from which the first `steps` steps of each segment are met best, weighted by the sensor noise."""
    return fitted_nuisances(simulator, head(observed, steps), values).observed.segments.starts
