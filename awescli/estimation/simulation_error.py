"""Simulation error of re-initialised segments (seed eq. 11) as a function of parameters, segment starts and nuisance wind."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from awescli.estimation.gust_level import within_window
from awescli.estimation.information import reduce
from awescli.notation.quantities import STATES
from awescli.simulation.rollout import Columns, Simulator
from awescli.simulation.segments import Observed

DIVERGED_COST = 25.0
"""Cost of a sample that a diverged rollout never reached: a five-sigma error. Keeps the line search away without infinities."""


@dataclass(frozen=True)
class Gusts:
    """Nuisance wind: what the recorded wind leaves out, per axis with standard deviation `std` [m/s].

    Linear in time between nodes some `window` seconds apart (a step at a node would make any lag look like an explanation); nodes are
    correlated as exp(-|dt| / memory) (Dryden: memory = L / V_a). A window longer than the segment: one constant.
    """

    std: float
    window: float = np.inf
    memory: float = 3.0

    def nodes(self, steps: int, dt: float) -> np.ndarray:
        """Samples of the nodes: evenly spaced over a segment, ends included; the first alone for a constant."""
        if self.std <= 0:
            return np.zeros(0, int)
        count = int(round(steps * dt / self.window)) if np.isfinite(self.window) else 0
        return np.round(np.linspace(0, steps, count + 1)).astype(int) if count else np.zeros(1, int)

    def columns(self, steps: int, dt: float) -> tuple[tuple[str, int, int], ...]:
        """(parameter, first step, last step) of every node and axis: from the node before to the node behind. Even and odd nodes have
        parameters of their own, because neighbours overlap."""
        nodes = self.nodes(steps, dt)
        edges = [0, *(int(n) for n in nodes), steps + 1]
        names = ("gust", "gust_odd")
        return tuple((f"{names[j % 2]}.{axis}", edges[j], edges[j + 2]) for j in range(len(nodes)) for axis in "ned")

    def hats(self, steps: int, dt: float) -> np.ndarray:
        """(N+1, n_nodes) weights of the nodes at every sample."""
        nodes = self.nodes(steps, dt)
        rows = [np.interp(np.arange(steps + 1), nodes, row) for row in np.eye(len(nodes))]
        return np.stack(rows, axis=1) if rows else np.zeros((steps + 1, 0))

    def precision(self, steps: int, dt: float) -> np.ndarray:
        """Prior precision of the nodes, in the order of `columns`."""
        time = self.nodes(steps, dt) * dt
        if not len(time):
            return np.zeros((0, 0))
        correlation = np.exp(-np.abs(time[:, None] - time) / self.memory)
        return np.kron(np.linalg.inv(correlation), np.eye(3)) / self.std**2


def with_gust_noise(simulator: Simulator, observed: Observed, gusts: Gusts, values=None) -> Observed:
    """The observations with the noise of what gusts do between nodes added to their own.

    Between nodes the wind is not linear; what is left shows at once in tension, accelerations and airspeed, through the
    direct dependence of each output on the wind, taken at the nodes.
    """
    rest = within_window(gusts.std, gusts.window, gusts.memory)
    nodes = gusts.nodes(observed.segments.steps, observed.segments.dt)
    windows = tuple((f"gust.{axis}", int(a), int(a) + 1) for a in nodes for axis in "ned")
    _, J = simulator.sensitivities(observed.segments, Columns((), (), windows), observed.outputs, values)
    starts = np.repeat(nodes, 3)
    direct = J[:, starts, :, np.arange(len(windows))]
    variance = rest**2 * np.mean(direct**2, axis=(0, 1)) * 3
    return observed.with_sigma(np.sqrt(observed.sigma**2 + variance))


class SimulationError:
    """The misfit of one simulator to observed segments, as a function of parameters and of the segments' own unknowns.

    own: (K, n_own) the segments' unknowns: start (12 states), then the nuisance wind at its nodes.
    """

    def __init__(self, simulator: Simulator, observed: Observed, names: Sequence[str], gusts: Gusts):
        self.simulator, self.observed, self.names = simulator, observed, tuple(names)
        segments = observed.segments
        self.windows = gusts.columns(segments.steps, segments.dt)
        self.own_prior = block_diag(np.zeros((12, 12)), gusts.precision(segments.steps, segments.dt))
        self.own = np.concatenate([segments.starts, np.zeros((len(segments), len(self.windows)))], axis=1)
        first = simulator.kite.input_names.index("gust_n")
        self._gust_inputs = slice(first, first + 4)
        self._hats = gusts.hats(segments.steps, segments.dt)

    @property
    def starts(self) -> np.ndarray:
        return self.own[:, :12]

    def values(self, x) -> dict[str, float]:
        return dict(zip(self.names, x, strict=True))

    def segments(self, own: np.ndarray):
        """The segments from their own starts, in their own wind."""
        segments = self.observed.segments.starting_at(own[:, :12])
        if not self.windows:
            return segments
        wind = np.einsum("tj,kja->kta", self._hats, own[:, 12:].reshape(len(own), -1, 3))
        phase = np.broadcast_to(self._hats[:, 1::2].sum(axis=1)[:, None], (*wind.shape[:2], 1))
        return segments.with_inputs(self._gust_inputs, np.concatenate([wind, phase], axis=2))

    def information(self, x: np.ndarray, parameters: Sequence[str] | None = None, extra: np.ndarray | None = None, values=None):
        """(Information, Trajectories) on `parameters` (default: the free names) at parameter values x and the present own unknowns.

        extra: (K, N+1, n_out, n) further columns (secants) behind those of the parameters; values: further parameter values.
        """
        names = self.names if parameters is None else tuple(parameters)
        trajectories, J, order, sigma = self._sensitivities(names, {**self.values(x), **(values or {})})
        if extra is not None:
            order = np.r_[order, J.shape[-1] : J.shape[-1] + extra.shape[-1]]
            J = np.concatenate([J, extra], axis=-1)
        r = self.observed.residual(trajectories)
        return reduce(J, r, sigma, len(self.own_prior), self.own_prior, self.own, order), trajectories

    def whitened(self, x: np.ndarray):
        """(own (K, N+1, n_out, n_own), columns (K, N+1, n_out, n), r (K, N+1, n_out), counted): sensitivities to own unknowns and
        parameters, and residual, over the noise; all 0 where a sample does not count."""
        trajectories, J, order, sigma = self._sensitivities(self.names, self.values(x))
        J, n_own = (J / sigma[..., None])[..., order], len(self.own_prior)
        return J[..., :n_own], J[..., n_own:], self.observed.residual(trajectories), np.isfinite(sigma)

    def _sensitivities(self, names: tuple[str, ...], values: dict[str, float]):
        """(trajectories, J, order, sigma): columns of J are those of starts, parameters `names`, windows; `order` puts own unknowns first;
        sigma is infinite where a sample does not count."""
        columns = Columns(STATES, names, self.windows)
        trajectories, J = self.simulator.sensitivities(self.segments(self.own), columns, self.observed.outputs, values)
        s, g = len(STATES), len(names)
        order = np.r_[:s, s + g : s + g + len(self.windows), s : s + g]
        return trajectories, J, order, np.where(self._reached(trajectories)[:, :, None], self.observed.sigma, np.inf)

    def _reached(self, trajectories) -> np.ndarray:
        return np.arange(self.observed.measured.shape[1])[None] < trajectories.alive[:, None]

    def costs(self, x: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(cost, whole), each (K,), at other parameters and own unknowns: whitened squares and the prior of the own wind; whole: the
        segment did not diverge. One that did is charged DIVERGED_COST per sample that it missed, and at most that for the others."""
        trajectories = self.simulator.rollout(self.segments(own), self.values(x))
        r = self.observed.residual(trajectories)
        reached = self._reached(trajectories)
        whole = reached.all(axis=1)
        squares, limit = (r * r).sum(axis=2), DIVERGED_COST * len(self.observed.outputs)
        squares[~whole] = np.where(reached[~whole], np.minimum(squares[~whole], limit), limit)
        return squares.sum(axis=1) + np.einsum("ki,ij,kj->k", own, self.own_prior, own), whole
