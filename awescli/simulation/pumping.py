"""Pumping cycles: a kite, its law, its surfaces and its winch from phase to phase, paying out under load and reeling in without.

The winch is two effects, so that it is stepped as all else: `winch_control` asks for a speed by the parameters of the phase, the drum of
`winch_tracking` follows with its lag and its limits. What the log would have said of the line is constant: all that moves is theirs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from awescli.control.pattern import Pattern
from awescli.flightlog.log import WindRecord
from awescli.notation.quantities import OUTPUTS, SURFACES
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.flight_model import FlightModel
from awescli.simulation.rollout import BODY_VELOCITY, Segments, Simulator, Trajectories, inputs_of
from awescli.simulation.survival import LOWEST, STALLED
from awescli.simulation.switching import Guard, Phase, Switch, Switched, fly_switched
from awescli.simulation.synthetic import Commanded, Flown, ReelOut, gusts_for, refuse_measured, with_effects

CONTROL, DRUM = "winch_control", "winch_tracking"
GIVEN = (f"{CONTROL}.load", f"{CONTROL}.ahead", f"{DRUM}.speed", f"{DRUM}.ahead")
"""States of the winch, with which a flight begins as it is given."""


@dataclass(frozen=True)
class PumpingPhase:
    """law: set-points, as a Simulator takes it; winch: short name -> value of `winch_control`; guards: in GUARDED; name: what it is;
    pattern: the circle of its law, where it has one."""

    name: str
    law: Callable
    winch: Mapping[str, float]
    guards: tuple[Guard, ...]
    pattern: Pattern | None = None


GUARDED: Mapping[str, Callable[[np.ndarray, Mapping[str, np.ndarray]], np.ndarray]] = {
    "tether_length": lambda X, outputs: outputs["tether_length"],
    "height": lambda X, outputs: -X[:, 2],
    "elevation": lambda X, outputs: np.arctan(-X[:, 2] / np.sqrt(X[:, 0] ** 2 + X[:, 1] ** 2)),
    "tension": lambda X, outputs: outputs["tension"],
    "V_a": lambda X, outputs: outputs["V_a"],
}
"""Quantity that may end a phase -> function of (states (n, n_x), {"tether_length", outputs}), of complex numbers too (sensitivities step
into them); `time_in_phase` [s] is another. SI."""


@dataclass(frozen=True)
class Pumped:
    """flown: the flight, with the line as it was paid out; phase: (N,) index of the phase; switches: in it; ended: the guard with which the
    last cycle that was asked for ended, or None; done: cycles that came to their end."""

    flown: Flown
    phase: np.ndarray
    switches: tuple[Switch, ...]
    ended: Guard | None
    done: int


def with_winch(declaration: KiteDeclaration, drum: Mapping[str, float]) -> KiteDeclaration:
    """The kite on a winch that takes commands. drum: short name -> value of `winch_tracking`; what it does not name stays as the
    kite file has it. The line's other effects, a counter that is wrong among them, stand behind."""
    tracked = with_effects(declaration, {} if DRUM in declaration.effects else {DRUM: {}})
    values = {f"{DRUM}.{name}": value for name, value in drum.items()}
    winched = with_effects(tracked, {CONTROL: {}})
    winched = winched.with_parameters(winched.table().with_values(values))
    others = tuple(key for key in winched.effects if key not in (CONTROL, DRUM))
    return winched.model_copy(update={"effects": (CONTROL, DRUM, *others)})


@dataclass(frozen=True)
class Pumping:
    """A kite `with_winch` and its phases, compiled: laws has the simulator of each phase, all of the one kite."""

    kite: FlightModel
    phases: tuple[PumpingPhase, ...]
    laws: tuple[Simulator, ...]

    @classmethod
    def of(cls, kite: FlightModel, phases: Sequence[PumpingPhase], step: float = 0.01, wrt: Sequence[str] = ()) -> "Pumping":
        """step: longest of RK4 [s]; wrt: parameters that sensitivities may be asked for."""
        refuse_measured(kite.declaration)
        simulator = Simulator(kite, wrt=wrt, step=step)
        given = [name in GIVEN for name in kite.state_names[12:]]

        def initial(x, u, c) -> list:
            """Of the winch nothing: how it begins is given."""
            return [0.0 if known else value for known, value in zip(given, kite.initial(x, u, c), strict=True)]

        simulator = simulator.begun_by(initial)
        return cls(kite, tuple(phases), tuple(simulator.flown_by(p.law) for p in phases))

    def fly(
        self, wind: WindRecord, *, start: np.ndarray, length: float, duration: float, dt: float, cycles: int | None = None,
        speed: float = 0.0, load: float = 0.0, begins: float = 0.0, seed: int = 0, values: Mapping[str, float] | None = None,
        rates: Mapping[str, float] | None = None,
    ) -> Pumped:  # fmt: skip
        """Fly through the phases, again and again, for `duration` seconds or to the end of `cycles`.

        start (12,), length [m] of line at t = 0, speed [m/s] of the drum, load [N] on it; values: parameters that differ from the kite's.
        It departs where it diverges, comes lower than LOWEST or stands in the air (STALLED). Slack lines are flown. Other arguments as in
        `simulate_flight`.
        """
        kite = self.kite.with_values(dict(values or {}))
        time, inputs = air_and_line(kite, wind, length, duration, dt, begins)
        for name, value in (rates or {}).items():
            inputs[0, kite.input_names.index(name)] = value
        samples, switches = len(time), None if cycles is None else cycles * len(self.phases) - 1
        how = start, winch_states(load, speed), dt, switches
        flown = self._through(kite, inputs, *how)
        if "turbulence.sigma" in kite.parameters:
            at = {n: i for i, n in enumerate(kite.input_names)}
            airspeed = float(flown.outputs[: max(_samples(flown), 1), OUTPUTS.index("V_a")].mean())
            columns, gusts = gusts_for(kite, samples, dt, airspeed, seed, at)
            inputs[:, columns] = gusts
            flown = self._through(kite, inputs, *how)
        last = max(_samples(flown), 1)
        switched = tuple(s for s in flown.switches if s.sample < last)
        ended = flown.ended if last == flown.alive else None
        log = _flown(kite, flown, inputs, last, time, dt, departed=last < samples and ended is None)
        return Pumped(log, flown.phase[:last], switched, ended, sum(s.into == 0 for s in switched) + (ended is not None))

    def _through(
        self, kite: FlightModel, inputs: np.ndarray, start: np.ndarray, own: Mapping[str, float], dt: float, switches: int | None
    ) -> Switched:
        """Through all phases; own: states of the winch at the start."""
        one, (made, *how) = self.laws[0], self.through(kite, inputs, start, own, dt)
        return fly_switched(one.f.value, one.g.value, one.initial.value, made, *how, most=switches)

    def through(self, kite: FlightModel, inputs: np.ndarray, start: np.ndarray, own: Mapping[str, float], dt: float) -> tuple:
        """(phases, n_s, x0, setpoints, inputs, dt, stepping, n_y, read) as `fly_switched` takes them; inputs (N+1, n_u); own: states of the
        winch at the start."""
        kites = [in_phase(kite, p.name).with_values({f"{CONTROL}.{n}": v for n, v in p.winch.items()}) for p in self.phases]
        made = [
            Phase(p.name, s.law.value if s.law else 0, k.parameters.vector(), p.guards)
            for p, s, k in zip(self.phases, self.laws, kites, strict=True)
        ]  # fmt: skip
        one = self.laws[0]
        segments = Segments(np.zeros(1, int), start[None], np.zeros((1, len(inputs), len(SURFACES))), inputs[None], dt)
        x0 = segments.starts_for(one.n_s)[0]
        x0[12:] = [own.get(name, 0.0) for name in kite.state_names[12:]]
        read = lambda X, Y, U: _quantities(kite, X, Y, U)  # noqa: E731
        return made, one.n_s, x0, segments.setpoints[0], inputs, dt, one.stepping(segments), len(OUTPUTS), read


def in_phase(kite: FlightModel, phase: str) -> FlightModel:
    """A model as it is in a phase, for flights whose inputs do not say in which they are."""
    return kite.with_values({base: kite.parameters[name].value for name, base, of in kite.own_in_phase if of == phase})


def air_and_line(
    kite: FlightModel, wind: WindRecord, length: float, duration: float, dt: float, begins: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """(time (N,) s, inputs (N, n_u)) of a flight that begins with `length` of line."""
    time = np.arange(int(round(duration / dt)) + 1) * dt
    line: dict[str, np.ndarray] = dict(zip(("tether_length", "reel_out_speed"), ReelOut(length, 0.0).at(time), strict=True))
    inputs = inputs_of(Commanded(time, dt, line, wind), kite)
    inputs[:, kite.input_names.index("time")] += begins
    return time, inputs


def winch_states(load: float, speed: float) -> dict[str, float]:
    """States of the winch that begins with a load [N] and a speed [m/s]."""
    return {f"{CONTROL}.load": load, f"{DRUM}.speed": speed}


def line_of(kite: FlightModel, X: np.ndarray, U: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(length [m], speed [m/s]) paid out, (n,)."""
    at = {name: i for i, name in enumerate(kite.state_names)}
    length = U[:, kite.input_names.index("tether_length")] + X[:, at[f"{CONTROL}.ahead"]] + X[:, at[f"{DRUM}.ahead"]]
    return length, X[:, at[f"{DRUM}.speed"]]


def _quantities(kite: FlightModel, X: np.ndarray, Y: np.ndarray, U: np.ndarray) -> dict[str, np.ndarray]:
    outputs = {name: Y[:, i] for i, name in enumerate(OUTPUTS)} | {"tether_length": line_of(kite, X, U)[0]}
    return {name: of(X, outputs) for name, of in GUARDED.items()}


def _samples(flown: Switched) -> int:
    """How many samples count: before it diverges, comes too low or stands still in the air."""
    X, Y = flown.states[: flown.alive], flown.outputs[: flown.alive]
    bad = (X[:, 2] > -LOWEST) | (Y[:, OUTPUTS.index("V_a")] < STALLED)
    return int(bad.argmax()) if bad.any() else flown.alive


def _flown(kite: FlightModel, flown: Switched, inputs: np.ndarray, last: int, time: np.ndarray, dt: float, departed: bool) -> Flown:
    """The flight as `simulate_flight` gives it."""
    X, Y = flown.states[:last], flown.outputs[:last]
    length, speed = line_of(kite, X, inputs[:last])
    trajectories = Trajectories(X[None], Y[None], np.array([last]))
    outputs = {n: Y[:, i] for i, n in enumerate(OUTPUTS)} | {n: trajectories[n][0] for n in BODY_VELOCITY}
    return Flown(time[:last], dt, outputs, {"tether_length": length, "reel_out_speed": speed}, departed)


def energies(pumped: Pumped, names: Sequence[str]) -> tuple[list[dict], list[dict]]:
    """(a row for each phase that was flown, a row for each whole cycle): cycle, phase, from_s, to_s, energy_J, mean_W, mean_tension_N,
    length_m at both ends, ended_by. Trapezoids of tension times reel-out speed between samples. names: of the phases."""
    flown = pumped.flown
    power = flown.outputs["tension"] * flown.inputs["reel_out_speed"]
    paid = np.concatenate([[0.0], np.cumsum(flown.dt / 2 * (power[:-1] + power[1:]))])
    last = len(power) - 1
    edges = [0, *(s.sample for s in pumped.switches), last]
    cycle, rows = 1, []
    for k, (first, end) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        which = int(pumped.phase[min(first, last)])
        cycle += int(which == 0 and k > 0)
        guards = [*(s.guard for s in pumped.switches), pumped.ended]
        by = guards[k].quantity if guards[k] else "departed" if flown.departed else "end"
        rows.append(_row({"cycle": cycle, "phase": names[which], "ended_by": by}, flown, paid, first, end))
    begun = [first for first, which in zip(edges[:-1], [0, *(s.into for s in pumped.switches)], strict=True) if which == 0]
    ends = [*begun[1:], last]
    whole = [_row({"cycle": k + 1}, flown, paid, *pair) for k, pair in enumerate(list(zip(begun, ends, strict=True))[: pumped.done])]
    return rows, whole


def _row(place: dict, flown: Flown, paid: np.ndarray, first: int, end: int) -> dict:
    seconds = max((end - first) * flown.dt, flown.dt)
    energy, length = float(paid[end] - paid[first]), flown.inputs["tether_length"]
    return place | {
        "from_s": first * flown.dt, "to_s": end * flown.dt, "energy_J": energy, "mean_W": energy / seconds,
        "mean_tension_N": float(flown.outputs["tension"][first : end + 1].mean()),
        "from_m": float(length[first]), "to_m": float(length[end]),
    }  # fmt: skip
