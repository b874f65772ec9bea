"""The misfit of a simulator to observed segments (docs/equations.md (20), (21)): of parameters, of segment starts, of processes."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import islice

import numpy as np

from awescli.engine.machine import LANES
from awescli.estimation.axes import Axes, gap_between
from awescli.estimation.information_filter import Information, eliminate, eliminate_parts
from awescli.estimation.links import RUNAWAY, Gram, Links, joined
from awescli.estimation.processes.base import Process, active, axes_of, disturbances_of, drifts_of, labels_of, spacing
from awescli.estimation.smoother import Nuisances
from awescli.notation.quantities import STATES
from awescli.physics.disturbances import PHASE, both
from awescli.simulation.groups import cores
from awescli.simulation.rollout import Segments, Simulator, Trajectories
from awescli.simulation.segments import Observed
from awescli.simulation.workspace import SIZE, workspace

DIVERGED_COST = 25.0
"""Cost of a sample that a diverged rollout never reached: a five-sigma error. Keeps the line search away without infinities."""
Further = Callable[["Misfit", "NuisanceValues"], np.ndarray]
"""Of a misfit and its nuisances: (K, N+1, n_out, n) columns."""
FOR_EVER = 1e6
"""[s] after which no process remembers anything."""


@dataclass(frozen=True)
class NuisanceValues:
    """Nuisances of K segments: starts (K, 12 + n_e) states there and offsets of the effects' own ones (`Segments.starts`), path (K, L + 1,
    W) values of the processes' axes at the nodes."""

    starts: np.ndarray
    path: np.ndarray

    def moved(self, change: Nuisances, share: float = 1.0, which: np.ndarray | None = None, case: int = 0) -> "NuisanceValues":
        """The nuisances after a share of a change, in the segments of a mask (default: all)."""
        which = np.ones(len(self.starts), bool) if which is None else which
        starts, path = self.starts.copy(), self.path.copy()
        starts[which] += share * change.starts(starts.shape[1])[which, :, case]
        path[which] += share * change.path[which, ..., case]
        return NuisanceValues(starts, path)


@dataclass(frozen=True)
class Linear:
    """What K segments say, linearised. gram: Gram matrices; squares: (K,) squared whitened residual; alive: (K,) samples before a segment
    diverged."""

    gram: Gram
    squares: np.ndarray
    alive: np.ndarray


@dataclass(frozen=True)
class Misfit:
    """One flight's segments, what is simulated of them, and the processes that are integrated out. names: of the globals; known_starts:
    segments begin where they are said to, as if that were known without error (Rositani eq. 11c); apart: what processes are in one segment
    says nothing of the others."""

    simulator: Simulator
    observed: Observed
    names: tuple[str, ...]
    processes: tuple[Process, ...] = ()
    known_starts: bool = False
    apart: bool = False
    axes: Axes = field(init=False)
    nodes: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", axes_of(self.processes, self.disturbances, self.drifts))
        object.__setattr__(self, "nodes", nodes_of(self.observed.segments, spacing(self.processes)))

    def own(self) -> NuisanceValues:
        """Where a fit begins: the starts that the observations hold, processes at rest or where they say."""
        K = len(self.observed.segments)
        starts, groups = self.observed.segments.starts[:, : len(STATES)], {g.name: g for g in active(self.processes)}
        path = [groups[name].begins(self.observed, self.nodes) for name, _ in self.labels]
        path = np.stack(path, axis=-1) if path else np.zeros((K, len(self.nodes), 0))
        return NuisanceValues(np.hstack([starts, np.zeros((K, len(self.spread)))]), path)

    @property
    def spread(self) -> np.ndarray:
        """(n_e,) what is not known of the states of effects at the start of a segment."""
        return self.simulator.kite.start_spread

    @property
    def disturbances(self) -> tuple[str, ...]:
        return disturbances_of(self.processes)

    @property
    def drifts(self) -> tuple[str, ...]:
        return drifts_of(self.processes, self.observed.outputs)

    @property
    def labels(self) -> list[tuple[str, str]]:
        """(group, axis) of every axis of the processes."""
        return labels_of(self.processes, self.disturbances, self.drifts)

    @property
    def begins(self) -> np.ndarray:
        """(K,) times of the first samples [s], on the log's own count; `apart`: for ever away from each other."""
        segments = self.observed.segments
        return np.arange(len(segments)) * FOR_EVER if self.apart else segments.first * segments.dt

    def values(self, x: np.ndarray) -> dict[str, float]:
        return dict(zip(self.names, x, strict=True))

    def segments(self, own: NuisanceValues) -> Segments:
        """The segments from their own starts, in their own disturbances."""
        segments = self.observed.segments.starting_at(own.starts)
        if not self.disturbances:
            return segments
        acting = self.axes.summed(own.path[..., None], self.axes.acts, len(self.disturbances))[..., 0]
        signals = np.matmul(self._hats, acting)
        phase = np.broadcast_to(self._hats[:, 1::2].sum(axis=1)[:, None], (*signals.shape[:2], 1))
        columns = [self.simulator.kite.input_names.index(n) for n in (*self.disturbances, PHASE)]
        return segments.with_inputs(columns, np.concatenate([signals, phase], axis=2))

    def residual(self, trajectories: Trajectories, own: NuisanceValues) -> np.ndarray:
        """(K, N+1, n_out) whitened residual, drifts taken off."""
        r = self.observed.residual(trajectories)
        for name, drift in self.drifted(own).items():
            place = self.observed.outputs.index(name)
            r[..., place] -= np.where(r[..., place] != 0, drift / self.observed.sigma[..., place], 0.0)
        return r

    def drifted(self, own: NuisanceValues) -> dict[str, np.ndarray]:
        """Compared channel -> (K, N+1) its drift, where it has one."""
        if not self.drifts:
            return {}
        drifting = np.matmul(self._hats, self.axes.summed(own.path[..., None], self.axes.drifts, len(self.drifts))[..., 0])
        return dict(zip(self.drifts, np.moveaxis(drifting, -1, 0), strict=True))

    def reached(self, trajectories: Trajectories) -> np.ndarray:
        """(K, N+1) which samples came before a divergence."""
        return np.arange(self.observed.measured.shape[1])[None] < trajectories.alive[:, None]

    def links(
        self, x: np.ndarray, own: NuisanceValues, parameters: Sequence[str] | None = None,
        extra: Further | None = None, room: Callable[[tuple[int, ...]], np.ndarray] = np.empty,
    ) -> tuple[Links, Trajectories]:  # fmt: skip
        """What the segments say about nuisances and `parameters` (default: the globals), linearised at parameter values x and nuisances.

        extra: (misfit, nuisances) -> (K, N+1, n_out, n) further columns behind those of the parameters; room: where sensitivities are put,
        by their shape.
        """
        names = self.names if parameters is None else tuple(parameters)
        outputs, acting = self.observed.outputs, both(self.disturbances)
        how = {"values": self.values(x), "room": room}
        trajectories, J, ends = self.simulator.links(self.segments(own), self.nodes[:-1], acting, names, outputs, **how)
        if extra is not None:
            J = np.concatenate([J, extra(self, own)], axis=-1)
        weight = np.where(self.reached(trajectories)[:, :, None], 1 / self.observed.sigma, 0.0)
        drifts = tuple(outputs.index(n) for n in self.drifts)
        r, offsets = self.residual(trajectories, own), own.starts[:, len(STATES) :]
        links = Links(J, ends, r, weight, self.nodes[:-1], drifts, offsets, self.spread)
        return (links.from_known_starts() if self.known_starts else links), trajectories

    def parts(
        self, x: np.ndarray, own: NuisanceValues, parameters: Sequence[str] | None = None, extra: Further | None = None,
        columns: int = 0,
    ) -> Iterator[tuple[slice, Links, Trajectories]]:  # fmt: skip
        """(which segments, `links` of these, their trajectories), some segments after the other: sensitivities are larger than all else of
        a flight, and those of the next part take the place of these. columns: how many more will stand beside them, of `extra` or of the
        caller."""
        names, count = self.names if parameters is None else tuple(parameters), len(self.observed.segments)
        self.simulator.stepping(self.segments(own))
        at_once = self._at_once(len(names) + 2 * columns)
        with workspace() as room:
            for first in range(0, count, at_once):
                which = slice(first, min(first + at_once, count))
                some = replace(self, observed=self.observed.pick(which))
                yield which, *some.links(x, NuisanceValues(own.starts[which], own.path[which]), names, extra, room.array)

    @RUNAWAY
    def linear(
        self, x: np.ndarray, own: NuisanceValues, parameters: Sequence[str] | None = None, extra: Further | None = None, columns: int = 0
    ) -> Linear:  # fmt: skip
        """What the segments say, part by part. extra, columns: as in `parts`."""
        grams, squares, alive = [], [], []
        for _, links, trajectories in self.parts(x, own, parameters, extra, columns):
            grams.append(links.gram())
            squares.append((links.r**2).sum(axis=(1, 2)))
            alive.append(trajectories.alive)
        return Linear(joined(grams), np.concatenate(squares), np.concatenate(alive))

    @RUNAWAY
    def information(
        self, x: np.ndarray, own: NuisanceValues, parameters: Sequence[str], extra: Further | None, columns: int
    ) -> Information:  # fmt: skip
        """What the segments that fly say of `parameters` and of further columns, without the way back to nuisances: of many columns not
        even the Gram matrices of a flight are kept."""
        alive: list[np.ndarray] = []

        def grams() -> Iterator[Gram]:
            for _, links, trajectories in self.parts(x, own, parameters, extra, columns):
                alive.append(trajectories.alive)
                yield links.gram()

        def flies() -> np.ndarray:
            return np.flatnonzero(np.concatenate(alive) > self.observed.segments.steps)

        return eliminate_parts(grams(), self.axes, own.path, self.begins, self.observed.segments.dt, flies)

    def gradients(
        self, x: np.ndarray, owns: Iterable[NuisanceValues], extra: Further | None = None, columns: int = 0
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """For each of many nuisances: `Links.gradients` of all segments, (K, L, q) and (K, n), and (K,) samples before a segment diverged.
        Where segments are few, those of several nuisances run side by side: they fill the lanes then. extra, columns: as in `parts`."""
        K, waiting = len(self.observed.segments), iter(owns)
        while some := list(islice(waiting, max(self._at_once(len(self.names) + 2 * columns) // K, 1))):
            many = replace(self, observed=self.observed.pick(np.tile(np.arange(K), len(some)))) if len(some) > 1 else self
            own = NuisanceValues(np.concatenate([o.starts for o in some]), np.concatenate([o.path for o in some]))
            found = [(*links.gradients(), trajectories.alive) for _, links, trajectories in many.parts(x, own, None, extra, columns)]
            whole = [np.concatenate(each) for each in zip(*found, strict=True)]
            for i in range(len(some)):
                of_x, of_globals, alive = (a[i * K : (i + 1) * K] for a in whole)
                yield of_x, of_globals, alive

    def _at_once(self, columns: int) -> int:
        """Segments whose sensitivities, of so many columns beside those of nuisances, are kept at a time."""
        samples, outputs = self.observed.measured.shape[1:]
        return most_at_once(8 * samples * outputs * (self.simulator.n_s + 2 * len(self.disturbances) + columns))

    def whitened(self, x: np.ndarray, own: NuisanceValues) -> tuple[np.ndarray, np.ndarray]:
        """((K, N+1, n_out) whitened residual, which samples count)."""
        trajectories = self.simulator.rollout(self.segments(own), self.values(x))
        counted = self.reached(trajectories)[:, :, None] & np.isfinite(self.observed.sigma)
        return self.residual(trajectories, own), counted

    def eliminated(
        self, gram: Gram, own: NuisanceValues, which: np.ndarray | None = None, processes: Sequence[Process] | None = None
    ) -> Information:
        """What the segments `which` say of the globals, their nuisances integrated out; processes: with which levels (default: own), of
        which some may have gone."""
        axes, path = self.axes, own.path
        if processes is not None:
            axes = axes_of(processes, self.disturbances, self.drifts)
            kept = labels_of(processes, self.disturbances, self.drifts)
            path = path[..., [self.labels.index(label) for label in kept]]
        return eliminate(gram, axes, path, self.begins, self.observed.segments.dt, which)

    def changed(self, links: Links, change: Nuisances, of_globals: np.ndarray | None = None) -> np.ndarray:
        """(K, N+1, n_out, c) whitened changes of the outputs for c changes of the nuisances and of the globals (n, c), default none."""
        acting = self.axes.summed(change.path, self.axes.acts, len(self.disturbances))
        drifting = self.axes.summed(change.path, self.axes.drifts, len(self.drifts))
        of_globals = np.zeros((links.n, change.path.shape[-1])) if of_globals is None else of_globals
        return links.changed(change.states, acting, drifting, of_globals)

    @RUNAWAY
    def costs(self, x: np.ndarray, own: NuisanceValues) -> tuple[np.ndarray, np.ndarray]:
        """(cost, whole), each (K,): squared residual of every segment; whole: it did not diverge. One that did is charged DIVERGED_COST per
        sample that it missed, and at most that for the others."""
        trajectories = self.simulator.rollout(self.segments(own), self.values(x))
        r = self.residual(trajectories, own)
        reached = self.reached(trajectories)
        whole = np.asarray(reached.all(axis=1))
        squares, limit = (r * r).sum(axis=2), DIVERGED_COST * len(self.observed.outputs)
        squares[~whole] = np.where(reached[~whole], np.fmin(squares[~whole], limit), limit)
        return squares.sum(axis=1), whole

    def prior_cost(self, own: NuisanceValues, which: np.ndarray) -> float:
        """Squared innovations of the processes along the segments `which`, and offsets of the effects' states at their starts, in their
        units."""
        starts = float(((own.starts[which, len(STATES) :] / self.spread) ** 2).sum())
        if not len(self.axes) or not len(which):
            return starts
        times = (self.begins[which][:, None] + self.nodes * self.observed.segments.dt).ravel()
        path, gaps = own.path[which].reshape(-1, len(self.axes)), gap_between(times[:-1], times[1:])
        new = gaps > 0
        steps = path[1:][new] - self.axes.decay(gaps[new]) * path[:-1][new]
        return starts + float((path[0] ** 2 / self.axes.level**2).sum() + (steps**2 / self.axes.variance(gaps[new])).sum())

    @property
    def log_noise(self) -> np.ndarray:
        """(K,) the white noise's part of -2 log likelihood."""
        sigma = self.observed.sigma
        counted = np.isfinite(sigma)
        return np.log(np.where(counted, 2 * np.pi * sigma**2, 1.0)).sum(axis=(1, 2))

    def _of_segments(self, own: NuisanceValues, before: "Misfit") -> NuisanceValues:
        """Nuisances `own` of another misfit, of these segments."""
        theirs, mine = before.observed.segments.first, self.observed.segments.first
        if np.array_equal(theirs, mine):
            return own
        found = replace(before, observed=self.observed).own()
        _, at, place = np.intersect1d(mine, theirs, return_indices=True)
        found.starts[at], found.path[at] = own.starts[place], own.path[place]
        return found

    @property
    def _hats(self) -> np.ndarray:
        """(N+1, L + 1) weight of each node at every sample."""
        return hats_at(tuple(self.nodes.tolist()))

    def with_processes(self, processes: Sequence[Process]) -> "Misfit":
        """The same with other processes."""
        return Misfit(self.simulator, self.observed, self.names, tuple(processes), self.known_starts, self.apart)

    def carried(self, own: NuisanceValues, before: "Misfit") -> NuisanceValues:
        """Nuisances under other processes, with other effects: paths of axes that both have, read off at these nodes. Segments that were
        not there before begin as a fit does."""
        own = self._of_segments(own, before)
        started = dict(zip(before.simulator.kite.state_names, own.starts.T, strict=True))
        own = replace(own, starts=np.stack([started.get(n, 0.0 * own.starts[:, 0]) for n in self.simulator.kite.state_names], axis=1))
        if self.labels == before.labels and len(self.nodes) == len(before.nodes):
            return own
        found = np.zeros((len(own.starts), len(self.nodes), len(self.axes)))
        theirs = before.labels
        for w, label in enumerate(self.labels):
            if label in theirs:
                at = theirs.index(label)
                found[..., w] = np.stack([np.interp(self.nodes, before.nodes, p) for p in own.path[..., at]])
        return replace(own, path=found)


def most_at_once(size: int) -> int:
    """Segments of so many bytes that are worked through at once: full groups for all cores where there are enough."""
    fit_in, full = max(int(SIZE * cores() / max(size, 1)), 1), LANES * cores()
    return fit_in // full * full or fit_in


@lru_cache(maxsize=32)
def hats_at(nodes: tuple[int, ...]) -> np.ndarray:
    """(N+1, L + 1) weight of each of L + 1 nodes, the last one at sample N, at every sample: linear in between."""
    samples, gaps = np.arange(nodes[-1] + 1)[:, None], np.diff(nodes)
    risen = np.clip((samples - np.array(nodes[:-1])) / gaps, 0.0, 1.0)  # from each node to the next
    hats = np.ones((len(samples), len(nodes)))
    hats[:, 1:] = risen
    hats[:, :-1] -= risen
    hats.flags.writeable = False
    return hats


def nodes_of(segments: Segments, spacing_s: float) -> np.ndarray:
    """(L + 1,) samples of the nodes of segments: evenly spread, both ends included, at most `spacing_s` apart where samples allow."""
    steps = segments.steps
    count = int(np.ceil(steps * segments.dt / spacing_s - 1e-9)) if np.isfinite(spacing_s) else 1
    return np.unique(np.round(np.linspace(0, steps, min(max(count, 1), steps) + 1)).astype(int))
