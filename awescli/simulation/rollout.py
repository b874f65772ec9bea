"""Rollouts of a kite over segments of a flight: the closed loop simulated from given starts, and its exact sensitivities."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from awescli.engine.machine import LANES, Program, compile_program
from awescli.notation.quantities import MEASURED, OUTPUTS, SURFACES
from awescli.physics.kite import GUSTS, ODD_GUSTS, Kite

GROUPS_AT_A_TIME = 8
"""Groups of lanes per core that are simulated in one go."""
_INDEX = {name: i for i, name in enumerate(OUTPUTS)}


@dataclass(frozen=True)
class Segments:
    """Inputs and starts of K segments of equal length, ready to simulate.

    first: (K,) index of the first sample in the log; starts: (K, 12) states at the start (`quantities.STATES`);
    setpoints: (K, N+1, 4) recorded set-points (`quantities.SURFACES`); inputs: (K, N+1, n_u) exogenous inputs by `Kite.input_names`;
    dt: sample interval [s]; values: parameter name -> (K,) where a parameter differs from segment to segment.
    """

    first: np.ndarray
    starts: np.ndarray
    setpoints: np.ndarray
    inputs: np.ndarray
    dt: float
    values: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.first)

    @property
    def steps(self) -> int:
        return self.setpoints.shape[1] - 1

    def pick(self, which) -> "Segments":
        """Some of the segments, by index or mask."""
        values = {n: v[which] for n, v in self.values.items()}
        return Segments(self.first[which], self.starts[which], self.setpoints[which], self.inputs[which], self.dt, values)

    def starting_at(self, starts: np.ndarray) -> "Segments":
        """The same segments from other starts."""
        return replace(self, starts=starts)

    def with_inputs(self, columns: slice, signals: np.ndarray) -> "Segments":
        """The same segments with some input columns replaced by `signals` (K, N+1, n)."""
        inputs = self.inputs.copy()
        inputs[:, :, columns] = signals
        return replace(self, inputs=inputs)


@dataclass(frozen=True)
class Trajectories:
    """Simulated segments: states (K, N+1, n_x), outputs (K, N+1, 23) in the order of `quantities.OUTPUTS`, and alive (K,):
    how many samples of a segment came before it diverged (N+1: it did not)."""

    states: np.ndarray
    outputs: np.ndarray
    alive: np.ndarray

    def __getitem__(self, name: str) -> np.ndarray:
        return self.outputs[:, :, _INDEX[name]]

    @property
    def diverged(self) -> np.ndarray:
        return self.alive < self.states.shape[1]


@dataclass(frozen=True)
class Columns:
    """What a sensitivity is taken with respect to, column by column.

    states: initial states (names); parameters: names, over the whole segment; windows: (parameter, first step, last step)
    for a parameter that counts only during some steps. In this order.
    """

    states: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    windows: tuple[tuple[str, int, int], ...] = ()

    def __len__(self) -> int:
        return len(self.states) + len(self.parameters) + len(self.windows)


class Simulator:
    """A kite, compiled: rollouts and sensitivities over segments.

    wrt: names of the parameters that sensitivities may be asked for (default: the free ones and the nuisance wind).
    law: function of (x, u, c) lists -> four set-points, or None to replay the recorded ones.
    """

    def __init__(self, kite: Kite, wrt: Sequence[str] | None = None, law: Callable | None = None, substeps: int = 1):
        self.kite, self.substeps = kite, substeps
        self.wrt = tuple(wrt if wrt is not None else [*kite.parameters.free, *GUSTS, *ODD_GUSTS])
        index = [kite.parameter_names.index(name) for name in self.wrt]
        sizes = (len(kite.x_names), len(kite.input_names), len(kite.parameter_names))
        self.f, self.g, self.initial = (compile_program(fn, *sizes, index) for fn in (kite.derivative, kite.outputs, kite.initial))
        self.law: Program | None = compile_program(law, *sizes, index) if law else None
        self.n_s = len(kite.state_names)

    def holding(self, table) -> "Simulator":
        """The same compiled simulator with its kite at the values of a parameter table."""
        other = copy(self)
        other.kite = self.kite.with_values({name: table[name].value for name in self.kite.parameter_names})
        return other

    def _grouped(self, a: np.ndarray) -> np.ndarray:
        """(K, ...) -> (G, ..., LANES), the last segment repeated to fill the last group."""
        K = a.shape[0]
        G = -(-K // LANES)
        filled = np.concatenate([a, np.repeat(a[-1:], G * LANES - K, axis=0)]) if G * LANES > K else a
        return np.ascontiguousarray(np.moveaxis(filled.reshape(G, LANES, *a.shape[1:]), 1, -1))

    def _parameters(self, segments: Segments, values: Mapping[str, float] | None) -> np.ndarray:
        """(K, n_c) parameter values of each segment."""
        names = self.kite.parameter_names
        base = self.kite.parameters.vector()
        place = {n: i for i, n in enumerate(names)}
        for name, value in (values or {}).items():
            base[place[name]] = value
        c = np.repeat(base[None], len(segments), axis=0)
        for name, value in segments.values.items():
            c[:, place[name]] = value
        return c

    def _blocks(self, segments: Segments, values):
        """(place, X0, SP, U, C, X, Y, alive) of some segments at a time, in lanes: few enough for their arrays to stay in the cache."""
        from awescli.simulation.kernels import cores

        samples, block = segments.steps + 1, GROUPS_AT_A_TIME * cores() * LANES
        for begin in range(0, len(segments), block):
            place = slice(begin, min(begin + block, len(segments)))
            part = segments.pick(place)
            X0, SP, U = (self._grouped(a) for a in (part.starts, part.setpoints, part.inputs))
            C = self._grouped(self._parameters(part, values))
            X = np.zeros((len(X0), samples, len(self.kite.x_names), LANES))
            Y = np.zeros((len(X0), samples, len(OUTPUTS), LANES))
            yield place, X0, SP, U, C, X, Y, np.full((len(X0), LANES), samples)

    def _empty(self, segments: Segments) -> Trajectories:
        """Room for the trajectories of all segments."""
        K, samples = len(segments), segments.steps + 1
        states, outputs = (np.empty((K, samples, n)) for n in (len(self.kite.x_names), len(OUTPUTS)))
        return Trajectories(states, outputs, np.empty(K, dtype=int))

    def rollout(self, segments: Segments, values: Mapping[str, float] | None = None) -> Trajectories:
        """Simulate all segments; values: parameters that differ from the kite's."""
        from awescli.simulation import kernels

        found, law = self._empty(segments), self.law.value if self.law else 0
        for place, X0, SP, U, C, X, Y, alive in self._blocks(segments, values):
            kernels.rollout(
                self.f.value, self.g.value, self.initial.value, law, self.n_s, X0, SP, U, C, segments.dt, self.substeps, X, Y, alive
            )
            _out_of_lanes(found, place, X, Y, alive)
        return found

    def sensitivities(
        self, segments: Segments, columns: Columns, outputs: Sequence[str] = MEASURED, values: Mapping[str, float] | None = None
    ) -> tuple[Trajectories, np.ndarray]:
        """Simulate, and differentiate exactly: J (K, N+1, len(outputs), len(columns))."""
        from awescli.simulation import kernels

        state_columns = np.full(12, -1)
        for column, name in enumerate(columns.states):
            state_columns[self.kite.x_names.index(name)] = column
        always = np.full(len(self.wrt), -1)
        for i, name in enumerate(columns.parameters):
            always[self.wrt.index(name)] = len(columns.states) + i
        offset = len(columns.states) + len(columns.parameters)
        w = np.array([[self.wrt.index(n), offset + i, a, b] for i, (n, a, b) in enumerate(columns.windows)], dtype=np.int64)
        w = w.reshape(-1, 4).T.copy()
        rows = np.array([_INDEX[name] for name in outputs])
        J = np.zeros((len(segments), segments.steps + 1, len(rows), len(columns)))
        found, law = self._empty(segments), self.law.tangent if self.law else 0
        for place, X0, SP, U, C, X, Y, alive in self._blocks(segments, values):
            kernels.sensitivities(
                self.f.tangent, self.g.tangent, self.initial.tangent, law, self.n_s, X0, SP, U, C, segments.dt, self.substeps,
                state_columns, always, w[0], w[1], w[2], w[3], len(columns), rows, X, Y, J[place], alive,
            )  # fmt: skip
            _out_of_lanes(found, place, X, Y, alive)
        return found, J


def _out_of_lanes(found: Trajectories, place: slice, X: np.ndarray, Y: np.ndarray, alive: np.ndarray) -> None:
    """Write groups of lanes (G, N+1, n, LANES) to their segments; lanes that repeat the last segment are left out."""
    count = place.stop - place.start
    for to, lanes in ((found.states, X), (found.outputs, Y)):
        for group, first in enumerate(range(0, count, LANES)):
            here = to[place.start + first : place.start + min(first + LANES, count)]
            here[:] = np.moveaxis(lanes[group], -1, 0)[: len(here)]
    found.alive[place] = alive.reshape(-1)[:count]


def setpoints_of(log, which=SURFACES) -> np.ndarray:
    """(N, 4) recorded set-points of a log; a surface that the log lacks stays at zero."""
    return np.stack([log.inputs.get(name, np.zeros(len(log))) for name in which], axis=1)


def inputs_of(log, kite: Kite) -> np.ndarray:
    """(N, n_u) exogenous inputs of a log, by `Kite.input_names`: line, density, measured tension, recorded rates, wind."""
    zero = np.zeros(len(log))
    length = log.inputs.get("tether_length", zero)
    speed = log.inputs.get("reel_out_speed", np.gradient(length, log.dt))
    tension = log.measured.get("tension", zero)
    wind = wind_inputs(log)
    signals = {
        "tether_length": length,
        "reel_out_speed": speed,
        "reel_out_acceleration": _smooth_rate(speed, log.dt),
        "density": wind["density"],
        "tension": tension,
        "tension_rate": _smooth_rate(tension, log.dt),
        **{f"{kind}_{axis}": zero for kind in ("turbulence", "gust") for axis in "ned"},
        "gust_phase": zero,
        **{f"{name}_rate": _backward_rate(log.inputs.get(name, zero), log.dt) for name in SURFACES},
        **wind,
    }
    return np.stack([signals[name] for name in kite.input_names], axis=1)


def wind_inputs(log) -> dict[str, np.ndarray]:
    """The wind record on the log's clock, linear in time: speed, direction and down at each of its heights, and density."""
    wind = log.wind
    at = lambda values: np.interp(log.time, wind.time, values)  # noqa: E731
    series = {"density": at(wind.density) if wind.density is not None else np.full(len(log), 1.225)}
    for kind in ("speed", "direction", "down"):
        for i in range(len(wind.height)):
            series[f"wind_{kind}_{i}"] = at(getattr(wind, kind)[:, i])
    return series


def _backward_rate(signal: np.ndarray, dt: float, span: int = 5) -> np.ndarray:
    """Rate of change over the last `span` samples: what a lagging actuator has behind it."""
    padded = np.concatenate([np.repeat(signal[:1], span), signal])
    return (signal - padded[:-span]) / (span * dt)


def _smooth_rate(signal: np.ndarray, dt: float, span: float = 0.4) -> np.ndarray:
    """Rate of change by a local quadratic over `span` seconds."""
    from scipy.signal import savgol_filter

    window = max(5, 2 * int(round(span / dt / 2)) + 1)
    return savgol_filter(signal, window, 2, deriv=1, delta=dt) if len(signal) >= window else np.gradient(signal, dt)
