"""Rollouts of a kite over segments of a flight: the closed loop simulated from given starts, and its exact sensitivities."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from awescli.engine.machine import Program, compile_program
from awescli.flightlog.log import FlightLog, WindRecord
from awescli.flightlog.phases import phases
from awescli.flightlog.smoothing import local_quadratic
from awescli.notation.frames import rotate_back, rotation_body_to_ned
from awescli.notation.parameters import ParameterTable
from awescli.notation.phases import input_of
from awescli.notation.quantities import MEASURED, OUTPUTS, SURFACES
from awescli.notation.scalars import Scalar
from awescli.physics.disturbances import DISTURBANCES, GUST_RATES, GUSTS, PHASE, both
from awescli.physics.effects.around import AROUND, around
from awescli.physics.effects.past import ASKED, BEHIND, past_of
from awescli.physics.flight_model import FlightModel
from awescli.simulation.stepping import Stepping, longest_step

_INDEX = {name: i for i, name in enumerate(OUTPUTS)}
BODY_VELOCITY = ("u", "v", "w")
WINCH_SMOOTHING = 0.4
"""[s] over which the rates of the winch's speed and of the load are taken: both are slow, and noisy or written in steps."""


@dataclass(frozen=True)
class Segments:
    """Inputs and starts of K segments of equal length, ready to simulate.

    first: (K,) index of the first sample in the log; starts: (K, 12 or n_s) states at the start (`quantities.STATES`), and by how much
    those of effects differ from what these say of them (`Effect.initial`);
    setpoints: (K, N+1, 5) recorded set-points (`quantities.SURFACES`); inputs: (K, N+1, n_u) exogenous inputs by `Kite.input_names`;
    dt: sample interval [s]; values: parameter name -> (K,) where a parameter differs from segment to segment.
    """

    first: np.ndarray
    starts: np.ndarray
    setpoints: np.ndarray
    inputs: np.ndarray
    dt: float
    values: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        # the compiled loops believe the sizes that they are given
        if self.setpoints.shape[-1] != len(SURFACES):
            raise ValueError(f"{self.setpoints.shape[-1]} set-points at a sample, there are {len(SURFACES)}: {', '.join(SURFACES)}")

    def __len__(self) -> int:
        return len(self.first)

    @property
    def steps(self) -> int:
        return self.setpoints.shape[1] - 1

    def pick(self, which: Sequence[int] | np.ndarray | slice) -> "Segments":
        """Some of the segments, by index or mask."""
        values = {n: v[which] for n, v in self.values.items()}
        return Segments(self.first[which], self.starts[which], self.setpoints[which], self.inputs[which], self.dt, values)

    def starts_for(self, n_s: int) -> np.ndarray:
        """(K, n_s) starts for a kite with so many states, its effects' own ones as they say where nothing else is known."""
        known = self.starts[:, :n_s]
        return np.hstack([known, np.zeros((len(self), n_s - known.shape[1]))])

    def starting_at(self, starts: np.ndarray) -> "Segments":
        """The same segments from other starts."""
        return replace(self, starts=starts)

    def with_inputs(self, columns: Sequence[int], signals: np.ndarray) -> "Segments":
        """The same segments with some input columns replaced by `signals` (K, N+1, n)."""
        inputs = self.inputs.copy()
        inputs[:, :, columns] = signals
        return replace(self, inputs=inputs)


@dataclass(frozen=True)
class Trajectories:
    """Simulated segments: states (K, N+1, n_x), outputs (K, N+1, 24) in the order of `quantities.OUTPUTS`, and alive (K,):
    how many samples of a segment came before it diverged (N+1: it did not)."""

    states: np.ndarray
    outputs: np.ndarray
    alive: np.ndarray

    def __getitem__(self, name: str) -> np.ndarray:
        """(K, N+1) what sensors report of `name`; u, v, w as a log derives them (`FlightLog.body_velocity`): from the reported velocity
        and the reported attitude, with what is wrong about these."""
        if name in BODY_VELOCITY:
            R = rotation_body_to_ned(*(self[angle] for angle in ("phi", "theta", "psi")))
            return rotate_back(R, tuple(self[axis] for axis in ("v_n", "v_e", "v_d")))[BODY_VELOCITY.index(name)]
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
    law: function of (x, u, c) lists -> set-points (`quantities.SURFACES`), or None to replay the recorded ones.
    step: longest step [s]; None: as the poles of the kite ask for (`stepping.longest_step`).
    """

    def __init__(self, kite: FlightModel, wrt: Sequence[str] | None = None, law: Callable | None = None, step: float | None = None):
        self.kite, self.step, self._longest = kite, step, step
        self.wrt = tuple(wrt if wrt is not None else [*kite.parameters.free, *both((*GUSTS, *GUST_RATES))])
        self.n_s = len(kite.state_names)
        self.f, self.g = (self._compiled(fn, linearised=False) for fn in (kite.derivative, self._at_sample))
        self.initial = self._compiled(kite.initial)
        self.law: Program | None = self._compiled(law) if law else None
        self._differentiated: dict[tuple[str, ...], Program] = {}

    def _compiled(self, function: Callable, **options: Any) -> Program:
        kite, sizes = self.kite, (len(self.kite.x_names), len(self.kite.input_names), len(self.kite.parameter_names))
        return compile_program(function, *sizes, [kite.parameter_names.index(name) for name in self.wrt], **options)

    def _at_sample(self, x: Sequence[Scalar], u: Sequence[Scalar], c: Sequence[Scalar]) -> list:
        """What is asked of a kite at a sample: derivative and outputs share most of their work."""
        return [*self.kite.derivative(x, u, c), *self.kite.outputs(x, u, c)]

    def differentiating(self, outputs: tuple[str, ...]) -> Program:
        """`_at_sample`, linearised in the derivative and in some outputs."""
        if outputs not in self._differentiated:
            rows = [*range(self.n_s), *(self.n_s + _INDEX[name] for name in outputs)]
            self._differentiated[outputs] = self._compiled(self._at_sample, rows=rows, rates=self.n_s)
        return self._differentiated[outputs]

    def holding(self, table: ParameterTable) -> "Simulator":
        """The same compiled simulator with its kite at a parameter table: values, and the bounds that they keep there."""
        other = copy(self)
        other.kite = self.kite.with_rows(table[name] for name in self.kite.parameter_names)
        other._longest = self.step
        return other

    def flown_by(self, law: Callable | None) -> "Simulator":
        """The same compiled simulator with another law."""
        other = copy(self)
        other.law = self._compiled(law) if law else None
        return other

    def begun_by(self, initial: Callable) -> "Simulator":
        """The same compiled simulator whose effects' states begin otherwise: function of (x, u, c) lists."""
        other = copy(self)
        other.initial = self._compiled(initial)
        return other

    def stepping(self, segments: Segments) -> Stepping:
        """The steps between two samples of segments; the poles are looked at once, at the starts of the first segments."""
        if self._longest is None:
            self._longest = longest_step(self.kite, segments.starts[:, :12], segments.setpoints[:, 0], segments.inputs[:, 0])
        return Stepping.between(segments.dt, self._longest, self.kite.declaration.set_point_rate)

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

    def _inputs(
        self, segments: Segments, values: Mapping[str, float] | None
    ) -> tuple[int, np.ndarray, np.ndarray, np.ndarray, np.ndarray, float, Stepping]:
        """(n_s, X0, SP, U, C, h, stepping) as the kernels take them."""
        # the compiled loops believe the sizes that they are given
        if segments.inputs.shape[-1] != len(self.kite.input_names):
            raise ValueError(f"{segments.inputs.shape[-1]} inputs at a sample, this kite takes {len(self.kite.input_names)}")
        arrays = (segments.starts_for(self.n_s), segments.setpoints, segments.inputs, self._parameters(segments, values))
        starts, setpoints, inputs, parameters = (np.ascontiguousarray(a, dtype=float) for a in arrays)
        return self.n_s, starts, setpoints, inputs, parameters, segments.dt, self.stepping(segments)

    def _room(self, segments: Segments) -> tuple[np.ndarray, np.ndarray]:
        """(states, outputs) of all segments, to be filled."""
        K, samples = len(segments), segments.steps + 1
        return np.empty((K, samples, len(self.kite.x_names))), np.empty((K, samples, len(OUTPUTS)))

    def rollout(self, segments: Segments, values: Mapping[str, float] | None = None) -> Trajectories:
        """Simulate all segments; values: parameters that differ from the kite's."""
        from awescli.simulation import kernels

        X, Y = self._room(segments)
        programs = (self.f.value, self.g.value, self.initial.value, self.law.value if self.law else 0)
        return Trajectories(X, Y, kernels.rollout(*programs, *self._inputs(segments, values), X, Y))

    def sensitivities(
        self, segments: Segments, columns: Columns, outputs: Sequence[str] = MEASURED, values: Mapping[str, float] | None = None
    ) -> tuple[Trajectories, np.ndarray]:
        """Simulate, and differentiate exactly: J (K, N+1, len(outputs), len(columns))."""
        trajectories, J, _ = self._sensitivities(segments, columns, outputs, values)
        return trajectories, J

    def links(
        self, segments: Segments, nodes: np.ndarray, inputs: Sequence[str], parameters: Sequence[str], outputs: Sequence[str] = MEASURED,
        values: Mapping[str, float] | None = None, room: Callable[[tuple[int, ...]], np.ndarray] = np.empty,
    ) -> tuple[Trajectories, np.ndarray, np.ndarray]:  # fmt: skip
        """Simulate, and differentiate from node to node: the state at a node is all that a segment knows of what came before it.

        nodes: samples, the first of the segment among them; inputs: parameters that are differentiated from node to node too. Returns
        (trajectories; J (K, N+1, len(outputs), n_s + len(inputs) + len(parameters)): with respect to the state at the last node up to a
        sample, to `inputs` since then, and to `parameters` over the whole segment; ends (K, len(nodes) - 1, n_s, n_s + len(inputs)): the
        first two of the state at the next node). room: where J is put, by its shape.
        """
        own = Columns(self.kite.state_names, tuple(inputs))
        trajectories, J, ends = self._sensitivities(segments, own, outputs, values, tuple(parameters), nodes[1:], room)
        return trajectories, J, ends[:, :, : self.n_s, : len(own)]

    def _sensitivities(
        self, segments: Segments, columns: Columns, outputs: Sequence[str], values: Mapping[str, float] | None,
        further: tuple[str, ...] = (), restarts: Sequence[int] | np.ndarray = (),
        room: Callable[[tuple[int, ...]], np.ndarray] = np.empty,
    ) -> tuple[Trajectories, np.ndarray, np.ndarray]:  # fmt: skip
        """(trajectories, J, ends) of `columns`, which begin again at the samples `restarts`, and of `further` parameters, which do not."""
        from awescli.simulation.sensitivities import sensitivities

        none, samples, again = len(self.wrt), segments.steps + 1, int(len(restarts) > 0)
        asked = [(self.kite.x_names.index(name), none, 0, samples, again) for name in columns.states]
        asked += [(-1, self.wrt.index(name), 0, samples, again) for name in columns.parameters]
        asked += [(-1, self.wrt.index(name), first, last, again) for name, first, last in columns.windows]
        asked += [(-1, self.wrt.index(name), 0, samples, 0) for name in further]
        X, Y = self._room(segments)
        J, ends = room((*X.shape[:2], len(outputs), len(asked))), np.empty((len(X), len(restarts), X.shape[2], len(asked)))
        restart = np.full(samples, -1)
        restart[list(restarts)] = np.arange(len(restarts))
        programs = (self.differentiating(tuple(outputs)), self.initial, self.law)
        at = np.array(asked, dtype=np.int64).reshape(-1, 5).T.copy()
        return Trajectories(X, Y, sensitivities(*programs, *self._inputs(segments, values), at, restart, X, Y, J, ends)), J, ends


class Recorded(Protocol):
    """What a model is driven by: a flight log, or what is commanded before there is one (`synthetic.Commanded`)."""

    @property
    def time(self) -> np.ndarray:
        """(N,) s."""
        ...

    @property
    def dt(self) -> float:
        """[s] between samples."""
        ...

    @property
    def inputs(self) -> Mapping[str, np.ndarray]:
        """What was commanded, each (N,)."""
        ...

    @property
    def measured(self) -> Mapping[str, np.ndarray]:
        """What sensors reported, each (N,)."""
        ...

    @property
    def recorded_wind(self) -> WindRecord:
        """The wind record."""
        ...

    def __len__(self) -> int: ...


def setpoints_of(log: FlightLog, which: Sequence[str] = SURFACES) -> np.ndarray:
    """(N, 5) recorded set-points of a log; what the log lacks stays at zero."""
    return np.stack([log.inputs.get(name, np.zeros(len(log))) for name in which], axis=1)


def inputs_of(log: Recorded, kite: FlightModel) -> np.ndarray:
    """(N, n_u) exogenous inputs of a log, by `Kite.input_names`: time, line, density, measured tension and motor speed, recorded rates,
    wind, phases."""
    zero = np.zeros(len(log))
    length = log.inputs.get("tether_length", zero)
    speed = log.inputs.get("reel_out_speed", np.gradient(length, log.dt))
    tension = log.measured.get("tension", zero)
    wind = wind_inputs(log)
    winch = {
        "tether_length": length,
        "reel_out_speed": speed,
        "reel_out_acceleration": local_quadratic(speed, log.dt, WINCH_SMOOTHING, derivative=1),
    }
    signals = {
        "time": log.time,
        **winch,
        "density": wind["density"],
        "tension": tension,
        "tension_rate": local_quadratic(tension, log.dt, WINCH_SMOOTHING, derivative=1),
        "motor_speed": log.inputs.get("motor_speed", zero),
        **dict.fromkeys((*(f"turbulence_{axis}" for axis in "nedp"), *DISTURBANCES, PHASE), zero),
        **{f"{name}_rate": _backward_rate(log.inputs.get(name, zero), log.dt) for name in SURFACES},
        **_past_inputs(log, kite, {"reel_out_speed": speed, **{name: log.inputs.get(name, zero) for name in SURFACES}}),
        **_around_inputs(log, kite, winch),
        **wind,
        **_phase_inputs(log, kite),
    }
    return np.stack([signals[name] for name in kite.input_names], axis=1)


def rates_at(log: FlightLog, kite: FlightModel, sample: int) -> dict[str, float]:
    """Rates of the recorded set-points, and of the load [N/s], and the set-points of the past, at a sample of a log, by name of the input:
    what lags behind them has its start from these (`Effect.initial`), where a flight sets out in the middle of a log."""
    row, past = inputs_of(log, kite)[sample], {name for setpoint in ASKED for name in past_of(setpoint)}
    return {name: float(row[i]) for i, name in enumerate(kite.input_names) if name.endswith("_rate") or name in past}


def _past_inputs(log: Recorded, kite: FlightModel, setpoints: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """By how much set-points differed before, of those of which that is asked; before a log begins they have stood still."""
    found = {}
    for name, signal in ((name, signal) for name, signal in setpoints.items() if past_of(name)[0] in kite.input_names):
        found |= {n: np.interp(log.time - ago, log.time, signal) - signal for n, ago in zip(past_of(name), BEHIND, strict=True)}
    return found


def _around_inputs(log: Recorded, kite: FlightModel, winch: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """By how much the winch's record differs around now, where that is asked; beyond a log's ends its speed is that of its ends."""
    found = {}
    for name, signal in ((name, signal) for name, signal in winch.items() if around(name)[0] in kite.input_names):
        rate = winch["reel_out_speed"] if name == "tether_length" else np.zeros(len(log))
        for n, ahead in zip(around(name), AROUND, strict=True):
            moment = np.clip(log.time + ahead, log.time[0], log.time[-1])
            found[n] = np.interp(moment, log.time, signal) + np.interp(moment, log.time, rate) * (log.time + ahead - moment) - signal
    return found


def _phase_inputs(log: Recorded, kite: FlightModel) -> dict[str, np.ndarray]:
    """1 in a phase in which parameters have values of their own, else 0; of what has no motion yet, that of its log, nothing is known."""
    asked = dict.fromkeys(phase for _, _, phase in kite.own_in_phase)
    if not asked or not isinstance(log, FlightLog):
        return {input_of(phase): np.zeros(len(log)) for phase in asked}
    labels = phases(log)
    return {input_of(phase): (labels == phase).astype(float) for phase in asked}


def wind_inputs(log: Recorded) -> dict[str, np.ndarray]:
    """The wind record on the log's clock, linear in time: speed, direction and down at each of its heights, and density."""
    wind = log.recorded_wind
    at = lambda values: np.interp(log.time, wind.time, values)  # noqa: E731
    series = {"density": at(wind.density) if wind.density is not None else np.full(len(log), 1.225)}
    for kind in ("speed", "direction", "down"):
        for i in range(len(wind.height)):
            series[f"wind_{kind}_{i}"] = at(getattr(wind, kind)[:, i])
    return series


def _backward_rate(signal: np.ndarray, dt: float, behind: float = 0.1) -> np.ndarray:
    """Rate of change over the last `behind` seconds, one sample at least: what a lagging actuator has behind it."""
    span = max(1, int(round(behind / dt)))
    padded = np.concatenate([np.repeat(signal[:1], span), signal])
    return (signal - padded[:-span]) / (span * dt)
