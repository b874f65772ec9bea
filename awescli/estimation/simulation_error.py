"""Simulation error of re-initialised segments (seed eq. 11) as a function of parameters, segment starts and nuisance wind."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from awescli.estimation.chain import Chain
from awescli.estimation.information import integrated, reduce
from awescli.estimation.nuisance_wind import RecordError
from awescli.physics.disturbances import PHASE, both, even
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
    windows = tuple((even(f"gust_{axis}"), int(a), int(a) + 1) for a in nodes for axis in gusts.axes)
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
        self.own_prior = block_diag(np.zeros((12, 12)), gusts.precision(segments.steps, segments.dt))
        self.own = np.zeros((len(segments), len(self.own_prior)))
        self.own[:, :12] = segments.starts
        nodes = gusts.nodes(segments.steps, segments.dt)
        # links begin at all nodes but that at the end; a wind that is the same all the time, and none, make one link of the segment
        self._nodes = nodes[:-1] if len(nodes) > 1 else np.zeros(1, int)
        self._axes = gusts.axes if len(nodes) else ""
        self._gust_inputs = [simulator.kite.input_names.index(n) for n in (*(f"gust_{axis}" for axis in gusts.axes), PHASE)]
        self._hats = gusts.hats(segments.steps, segments.dt)
        self.integrates = gusts.random and len(nodes) > 0

    @property
    def starts(self) -> np.ndarray:
        return self.own[:, :12]

    def values(self, x) -> dict[str, float]:
        return dict(zip(self.names, x, strict=True))

    def segments(self, own: np.ndarray):
        """The segments from their own starts, in their own wind."""
        segments = self.observed.segments.starting_at(own[:, :12])
        if not self._axes:
            return segments
        wind = np.matmul(self._hats, own[:, 12:].reshape(len(own), -1, len(self._gust_inputs) - 1))
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
        trajectories, chain = self._chain(self.own, names, values, extra)
        info = reduce(chain, self.own_prior, self.own)
        if not self.integrates:
            return info, trajectories
        if not integrate:
            return replace(info, volume=np.full_like(info.volume, np.nan), tilt=np.full_like(info.tilt, np.nan)), trajectories
        here = self._around(self.own, trajectories, chain)

        def around(change: np.ndarray):
            own = self.own + change
            return self._around(own, *self._chain(own, names, values, extra)) if change.any() else here

        return integrated(info, around, seed), trajectories

    def _around(self, own: np.ndarray, trajectories, chain: Chain) -> tuple[np.ndarray, np.ndarray]:
        """(cost (K,), gradient J'r less the pull of the prior (K, n_own + n)) at own unknowns `own`; nan where a segment diverged."""
        prior, pull = own @ self.own_prior, chain.gradient()
        pull[:, : chain.n_own] -= prior
        cost = (chain.r**2).sum(axis=(1, 2)) + (own * prior).sum(axis=1)
        lost = ~self._reached(trajectories).all(axis=1)
        return np.where(lost, np.nan, cost), np.where(lost[:, None], np.nan, pull)

    def chain(self, x: np.ndarray) -> Chain:
        """What the segments say about their own unknowns and the fitted parameters, at parameter values x and the present own unknowns."""
        return self._chain(self.own, self.names, self.values(x))[1]

    def _chain(self, own: np.ndarray, names: tuple[str, ...], values: dict[str, float], extra=None):
        """(trajectories, chain); globals are the parameters `names`, then `extra`."""
        gusts = both(f"gust_{axis}" for axis in self._axes)
        outputs, nodes = self.observed.outputs, self._nodes
        trajectories, J, ends = self.simulator.links(self.segments(own), nodes, gusts, names, outputs, values)
        if extra is not None:
            J = np.concatenate([J, extra(own)], axis=-1)
        weight = np.where(self._reached(trajectories)[:, :, None], 1 / self.observed.sigma, 0.0)
        return trajectories, Chain(J, ends, self.observed.residual(trajectories), weight, nodes, len(self.own_prior))

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
        return squares.sum(axis=1) + ((own @ self.own_prior) * own).sum(axis=1), whole

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
