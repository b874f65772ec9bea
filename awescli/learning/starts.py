"""Starts of segments, estimated from their first second: Gauss-Newton on the 12 states of each, with exact sensitivities."""

import numpy as np

from awescli.notation.quantities import STATES
from awescli.simulation.rollout import Columns, Segments, Simulator
from awescli.simulation.segments import Observed

ITERATIONS = 3
"""The first guess is a local quadratic, two steps from the answer; a third costs little."""


def estimated_starts(simulator: Simulator, observed: Observed, steps: int, values=None) -> np.ndarray:
    """(K, 12) states from which the first `steps` steps of each segment are met best, weighted by the sensor noise.

    Always begun from the starts that `observed` holds, so the answer depends on the model alone. Segments that diverge, or whose
    first samples do not count, keep their first guess.
    """
    s = observed.segments
    head = Observed(
        Segments(s.first, s.starts, s.setpoints[:, : steps + 1], s.inputs[:, : steps + 1], s.dt, s.values),
        observed.outputs, observed.measured[:, : steps + 1], observed.sigma[:, : steps + 1],
    )  # fmt: skip
    starts = s.starts.copy()
    for _ in range(ITERATIONS):
        trajectories, J = simulator.sensitivities(head.segments.starting_at(starts), Columns(states=STATES), head.outputs, values)
        weight = np.where(np.isfinite(head.sigma), 1 / head.sigma, 0.0)
        A = (J * weight[..., None]).reshape(len(s), -1, 12)
        r = head.residual(trajectories).reshape(len(s), -1)
        M = np.einsum("kni,knj->kij", A, A)
        size = np.sqrt(np.maximum(np.einsum("kii->ki", M), 1e-12))
        M = M / size[:, :, None] / size[:, None, :] + 1e-9 * np.eye(12)
        step = np.linalg.solve(M, (np.einsum("kni,kn->ki", A, r) / size)[..., None])[..., 0] / size
        good = (trajectories.alive > steps) & np.isfinite(step).all(1) & (weight[:, :, 0] > 0).any(1)
        starts = np.where(good[:, None], starts + step, starts)
    return starts
