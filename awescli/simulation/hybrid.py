"""Rollouts of a kite with a small network added to some of its derivatives, and the exact gradient of a cost on them.

It knows the network as numbers (`engine.dense`); what goes into it and what it means is said by `learning`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from awescli.engine.adjoint import compile_reversible
from awescli.engine.dense import compile_network, weight_count
from awescli.engine.machine import LANES
from awescli.notation.quantities import OUTPUTS, STATES
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Segments
from awescli.simulation.stepping import Stepping, longest_step


@dataclass(frozen=True)
class Prepared:
    """Segments laid out for the kernels, LANES abreast in G groups. count: (G,) real segments of each group, the rest repeats."""

    starts: np.ndarray  # (G, n_s, L)
    setpoints: np.ndarray  # (G, K+1, 5, L)
    inputs: np.ndarray  # (G, K+1, n_u, L)
    parameters: np.ndarray  # (G, n_c, L)
    dt: float
    stepping: Stepping
    count: np.ndarray

    def groups(self, which: Sequence[int]) -> "Prepared":
        """Some of the groups, by index."""
        starts, setpoints, inputs, parameters = (a[which] for a in (self.starts, self.setpoints, self.inputs, self.parameters))
        return Prepared(starts, setpoints, inputs, parameters, self.dt, self.stepping, self.count[which])

    def __len__(self) -> int:
        return int(self.count.sum())


class Trainable(Protocol):
    """A simulator of physics with a network. What it prepares and flies, it alone understands; segments that are prepared have `count`,
    (G,) of each group, and `groups`, some of them; a flight has `outputs` (K, N+1, n_out) and `alive` (K,)."""

    def prepare(self, segments: Segments) -> Any:
        """Lay segments out, once for many rollouts."""
        ...

    def rollout(self, prepared: Any, weights: np.ndarray, constants: np.ndarray) -> Any:
        """Fly them with these weights."""
        ...

    def gradient(self, run: Any, outputs_bar: np.ndarray) -> tuple[np.ndarray, Any]:
        """Of sum(outputs_bar * outputs), with respect to the weights, and to the starts where the simulator knows it."""
        ...


@dataclass
class Run:
    """One rollout, with what its reverse needs. outputs: (K, N+1, n_out); states: (K, N+1, n_x); alive: (K,) as in `Trajectories`."""

    prepared: Prepared
    weights: np.ndarray
    constants: np.ndarray
    X: np.ndarray
    Y: np.ndarray
    alive_lanes: np.ndarray
    buffers: tuple = field(repr=False, default=())

    @property
    def outputs(self) -> np.ndarray:
        return ungrouped(self.Y, self.prepared.count)

    @property
    def states(self) -> np.ndarray:
        return ungrouped(self.X, self.prepared.count)

    @property
    def alive(self) -> np.ndarray:
        return ungrouped(self.alive_lanes, self.prepared.count)


def grouped(a: np.ndarray) -> np.ndarray:
    """(K, ...) -> (G, ..., LANES), the last segment repeated to fill the last group."""
    K = a.shape[0]
    G = -(-K // LANES)
    filled = np.concatenate([a, np.repeat(a[-1:], G * LANES - K, axis=0)]) if G * LANES > K else a
    return np.ascontiguousarray(np.moveaxis(filled.reshape(G, LANES, *a.shape[1:]), 1, -1))


def ungrouped(a: np.ndarray, count: np.ndarray) -> np.ndarray:
    """(G, ..., LANES) -> (K, ...), without the repeats."""
    lanes_second = np.moveaxis(a, -1, 1)
    keep = np.arange(LANES)[None] < count[:, None]
    return lanes_second[keep]


class CorrectedSimulator:
    """A kite whose derivatives in `rows` have a network's outputs added, compiled for rollouts and gradients.

    network_inputs: function (x, u, c) lists -> list of scalars, recorded with the physics; sizes: layer widths (inputs, hidden...,
    outputs); outputs: names of the simulated channels that the cost sees (of OUTPUTS, or u, v, w);
    law, step: as `rollout.Simulator`; the poles are those of the physics.
    """

    def __init__(
        self, kite: Kite, network_inputs: Callable, sizes: Sequence[int], rows: Sequence[int], outputs: Sequence[str],
        law: Callable | None = None, step: float | None = None,
    ):  # fmt: skip
        self.kite, self._longest, self.outputs = kite, step, tuple(outputs)
        dimensions = (len(kite.x_names), len(kite.input_names), len(kite.parameter_names))

        def right_hand_side(x, u, c):
            return [*kite.derivative(x, u, c), *network_inputs(x, u, c)]

        def compared(x, u, c):
            reported = dict(zip(OUTPUTS, kite.outputs(x, u, c), strict=True))
            reported |= {name: x[i] for i, name in enumerate(STATES) if name not in reported}
            return [reported[name] for name in outputs]

        self.f = compile_reversible(right_hand_side, *dimensions)
        self.g = compile_reversible(compared, *dimensions)
        self.initial = compile_reversible(kite.initial, *dimensions)
        self.law = compile_reversible(law, *dimensions) if law else None
        self.network = compile_network(sizes)
        self.rows = np.array(rows, dtype=np.int64)
        self.n_s = len(kite.state_names)
        self.n_weights = weight_count(sizes)
        self._buffers: dict[tuple, tuple] = {}

    def prepare(self, segments: Segments) -> Prepared:
        """Lay segments out for the kernels: once, for many rollouts."""
        names = self.kite.parameter_names
        c = np.repeat(self.kite.parameters.vector()[None], len(segments), axis=0)
        for name, value in segments.values.items():
            c[:, names.index(name)] = value
        G = -(-len(segments) // LANES)
        count = np.minimum(LANES, len(segments) - LANES * np.arange(G))
        if self._longest is None:
            self._longest = longest_step(self.kite, segments.starts[:, :12], segments.setpoints[:, 0], segments.inputs[:, 0])
        stepping = Stepping.between(segments.dt, self._longest, self.kite.declaration.set_point_rate)
        arrays = (segments.starts_for(self.n_s), segments.setpoints, segments.inputs, c)
        starts, setpoints, inputs, parameters = (grouped(a) for a in arrays)
        return Prepared(starts, setpoints, inputs, parameters, segments.dt, stepping, count)

    def _storage(self, G: int, m: int) -> tuple[np.ndarray, np.ndarray]:
        """Arrays for m steps of G groups that live from call to call: fresh pages of this size cost as much time as the rollout."""
        key = (G, m)
        if key not in self._buffers:
            if len(self._buffers) > 4:
                self._buffers.clear()
            n_x = len(self.kite.x_names)
            self._buffers[key] = (
                np.empty((G, m, 4, n_x, LANES)),
                np.empty((G, m, 4, self.network.kept, LANES)),
            )
        return self._buffers[key]

    def rollout(self, prepared: Prepared, weights: np.ndarray, constants: np.ndarray) -> Run:
        """Simulate. The run may be reversed until the next rollout of the same size (they share storage)."""
        from awescli.simulation import hybrid_kernels

        G, samples = prepared.setpoints.shape[:2]
        X, Y = np.empty((G, samples, len(self.kite.x_names), LANES)), np.empty((G, samples, len(self.outputs), LANES))
        alive = np.full((G, LANES), samples)
        stages, kept = self._storage(G, (samples - 1) * prepared.stepping.substeps)
        hybrid_kernels.rollout(
            self.f.value, self.g.value, self.initial.value, self.law.value if self.law else None, self.network, self.n_s, self.rows,
            constants, weights, prepared.starts, prepared.setpoints, prepared.inputs,
            prepared.parameters, prepared.dt, prepared.stepping, X, Y, stages, kept, alive,
        )  # fmt: skip
        return Run(prepared, weights, constants, X, Y, alive, (stages, kept))

    def gradient(self, run: Run, outputs_bar: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(d cost / d weights (n,), d cost / d starts (K, 12)) for outputs_bar (K, N+1, n_out) = d cost / d outputs. Exact to rounding.

        A run is reversed once: its storage is used up.
        """
        from awescli.simulation import hybrid_kernels

        p = run.prepared
        stages, kept = run.buffers
        Ybar = np.zeros_like(run.Y)
        np.moveaxis(Ybar, -1, 1)[np.arange(LANES)[None] < p.count[:, None]] = outputs_bar
        X0bar, Wbar = np.zeros_like(p.starts[:, :12]), np.empty((len(p.count), self.n_weights))
        hybrid_kernels.gradient(
            self.f.adjoint, self.g.adjoint, self.initial.adjoint, self.law.adjoint if self.law else None, self.network, self.n_s,
            self.rows, run.constants, run.weights, p.setpoints, p.inputs, p.parameters, p.dt, p.stepping,
            run.X, Ybar, stages, kept, run.alive_lanes, X0bar, Wbar,
        )  # fmt: skip
        return Wbar.sum(0), ungrouped(X0bar, p.count)
