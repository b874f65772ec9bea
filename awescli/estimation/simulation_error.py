"""Simulation error of re-initialised segments (seed eq. 11) as a function of parameters, segment starts and nuisance wind."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from awescli.estimation.information import integrated, reduce
from awescli.estimation.nuisance_wind import RecordError
from awescli.notation.quantities import STATES
from awescli.simulation.rollout import Columns, Simulator
from awescli.simulation.segments import Observed

DIVERGED_COST = 25.0
"""Cost of a sample that a diverged rollout never reached: a five-sigma error. Keeps the line search away without infinities."""

RELAXATIONS = 4
"""How many Gauss-Newton steps may bring the own unknowns of a segment to their best at fixed parameters ..."""
ENOUGH = 0.5
"""... which they have reached when a step gains less than this per segment."""


def with_gust_noise(simulator: Simulator, observed: Observed, gusts: RecordError, values=None) -> Observed:
    """The observations with the noise of what gusts do between nodes beside that of their sensors.

    Between nodes the wind is not linear; what is left shows at once in tension, accelerations and airspeed, through the
    direct dependence of each output on the wind, taken at the nodes.
    """
    nodes = gusts.nodes(observed.segments.steps, observed.segments.dt)
    between = gusts.between_nodes(observed.segments.steps, observed.segments.dt)
    windows = tuple((f"gust.{axis}", int(a), int(a) + 1) for a in nodes for axis in gusts.axes)
    _, J = simulator.sensitivities(observed.segments, Columns((), (), windows), observed.outputs, values)
    axes = len(gusts.axes)
    direct = J[:, np.repeat(nodes, axes), :, np.arange(len(windows))].reshape(len(nodes), axes, *J.shape[:1], J.shape[2])
    variance = np.einsum("a,jakc->c", between**2, direct**2) / (len(nodes) * J.shape[0])
    return observed.with_noise(variance)


class SimulationError:
    """The misfit of one simulator to observed segments, as a function of parameters and of the segments' own unknowns.

    own: (K, n_own) the segments' unknowns: start (12 states), then the nuisance wind at its nodes.
    """

    def __init__(self, simulator: Simulator, observed: Observed, names: Sequence[str], gusts: RecordError):
        self.simulator, self.observed, self.names = simulator, observed, tuple(names)
        segments = observed.segments
        self.windows = gusts.columns(segments.steps, segments.dt)
        self.own_prior = block_diag(np.zeros((12, 12)), gusts.precision(segments.steps, segments.dt))
        self.own = np.concatenate([segments.starts, np.zeros((len(segments), len(self.windows)))], axis=1)
        self._gust_inputs = [simulator.kite.input_names.index(f"gust_{axis}") for axis in (*gusts.axes, "phase")]
        self._hats = gusts.hats(segments.steps, segments.dt)
        self.integrates = gusts.random and bool(self.windows)

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
        wind = np.einsum("tj,kja->kta", self._hats, own[:, 12:].reshape(len(own), -1, len(self._gust_inputs) - 1))
        phase = np.broadcast_to(self._hats[:, 1::2].sum(axis=1)[:, None], (*wind.shape[:2], 1))
        return segments.with_inputs(self._gust_inputs, np.concatenate([wind, phase], axis=2))

    def information(
        self,
        x: np.ndarray,
        parameters: Sequence[str] | None = None,
        extra: Callable[[np.ndarray], np.ndarray] | None = None,
        values: dict[str, float] | None = None,
        integrate: bool = False,
        seed: int = 0,
    ):
        """(Information, Trajectories) on `parameters` (default: the free names) at parameter values x and the present own unknowns.

        extra: own unknowns -> (K, N+1, n_out, n) further columns (secants) behind those of the parameters; values: further ones;
        integrate: say also what integrating the own unknowns out adds, where they are gusts (`information.integrated`, random signs from
        `seed`).
        """
        names = self.names if parameters is None else tuple(parameters)
        values = {**self.values(x), **(values or {})}
        found = self._sensitivities(self.own, names, values, extra)
        trajectories, J, order, sigma = found
        info = reduce(J, self.observed.residual(trajectories), sigma, len(self.own_prior), self.own_prior, self.own, order)
        if not self.integrates:
            return info, trajectories
        if not integrate:
            return replace(info, volume=np.full_like(info.volume, np.nan), tilt=np.full_like(info.tilt, np.nan)), trajectories
        here = self._around(self.own, *found)

        def around(change: np.ndarray):
            own = self.own + change
            return self._around(own, *self._sensitivities(own, names, values, extra)) if change.any() else here

        return integrated(info, around, seed), trajectories

    def _around(self, own: np.ndarray, trajectories, J: np.ndarray, order, sigma) -> tuple[np.ndarray, np.ndarray]:
        """(cost (K,), gradient J'r less the pull of the prior (K, n_own + n)) at own unknowns `own`; nan where a segment diverged."""
        K, n_own = len(own), len(self.own_prior)
        r, prior = self.observed.residual(trajectories), own @ self.own_prior
        cost = (r * r).sum(axis=(1, 2)) + (own * prior).sum(axis=1)
        weighed = np.where(np.isfinite(sigma), r / sigma, 0.0)
        pull = np.matmul(weighed.reshape(K, 1, -1), J.reshape(K, -1, J.shape[-1]))[:, 0, order]
        pull[:, :n_own] -= prior
        lost = ~self._reached(trajectories).all(axis=1)
        return np.where(lost, np.nan, cost), np.where(lost[:, None], np.nan, pull)

    def whitened(self, x: np.ndarray):
        """(own (K, N+1, n_out, n_own), columns (K, N+1, n_out, n), r (K, N+1, n_out), counted): sensitivities to own unknowns and
        parameters, and residual, over the noise; all 0 where a sample does not count."""
        trajectories, J, order, sigma = self._sensitivities(self.own, self.names, self.values(x))
        J, n_own = (J / sigma[..., None])[..., order], len(self.own_prior)
        return J[..., :n_own], J[..., n_own:], self.observed.residual(trajectories), np.isfinite(sigma)

    def _sensitivities(self, own: np.ndarray, names: tuple[str, ...], values: dict[str, float], extra=None):
        """(trajectories, J, order, sigma): columns of J are those of starts, parameters `names`, windows, `extra`; `order` puts own
        unknowns first; sigma is infinite where a sample does not count."""
        columns = Columns(STATES, names, self.windows)
        trajectories, J = self.simulator.sensitivities(self.segments(own), columns, self.observed.outputs, values)
        s, g = len(STATES), len(names)
        order = np.r_[:s, s + g : s + g + len(self.windows), s : s + g]
        if extra is not None:
            further = extra(own)
            order = np.r_[order, J.shape[-1] : J.shape[-1] + further.shape[-1]]
            J = np.concatenate([J, further], axis=-1)
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

    def at_best(self, x: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """(own, costs as of `costs`): own unknowns moved to their best at parameters x, where they are gusts; never worse than `own`."""
        cost, whole = self.costs(x, own)
        before, own = self.own, own.copy()
        for _ in range(RELAXATIONS if self.integrates else 0):
            self.own = own
            info, _ = self.information(x, parameters=())
            trial = own + np.stack([info.own(k, np.zeros(0)) for k in range(len(own))])
            trial_cost, trial_whole = self.costs(x, trial)
            better = trial_whole & ((trial_cost < cost) | ~whole)
            gain = float((cost - trial_cost)[better].sum())
            own, cost, whole = np.where(better[:, None], trial, own), np.where(better, trial_cost, cost), whole | better
            if gain < ENOUGH * len(own):
                break
        self.own = before
        return own, (cost, whole)
