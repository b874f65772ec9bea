"""Pumping cycles: a kite, its law, its surfaces and its winch from phase to phase, paying out under load and reeling in without.

The winch is two effects, so that it is stepped as all else: `winch_control` asks for a speed by the parameters of the phase, the drum of
`winch_tracking` follows with its lag and its limits. What the log would have said of the line is constant: all that moves is theirs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from awescli.flightlog.log import WindRecord
from awescli.notation.quantities import OUTPUTS, SURFACES
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.kite import Kite
from awescli.simulation.rollout import BODY_VELOCITY, Segments, Simulator, Trajectories, inputs_of
from awescli.simulation.survival import LOWEST, STALLED
from awescli.simulation.switching import Guard, Phase, Switch, Switched, fly_switched
from awescli.simulation.synthetic import Commanded, Flown, ReelOut, gusts_for, refuse_measured, with_effects

CONTROL, DRUM = "winch_control", "winch_tracking"


@dataclass(frozen=True)
class PumpingPhase:
    """law: set-points, as a Simulator takes it; winch: short name -> value of `winch_control`; guards: in GUARDED; name: what it is."""

    name: str
    law: Callable
    winch: Mapping[str, float]
    guards: tuple[Guard, ...]


GUARDED: Mapping[str, Callable[[np.ndarray, Mapping[str, np.ndarray]], np.ndarray]] = {
    "tether_length": lambda X, told: told["tether_length"],
    "height": lambda X, told: -X[:, 2],
    "elevation": lambda X, told: np.arctan2(-X[:, 2], np.hypot(X[:, 0], X[:, 1])),
    "tension": lambda X, told: told["tension"],
    "V_a": lambda X, told: told["V_a"],
}
"""Quantity that may end a phase -> function of (states (n, n_x), {"tether_length", outputs}); `time_in_phase` [s] is another. SI."""


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
    """The kite on a winch that can be told what to do. drum: short name -> value of `winch_tracking`; what it does not name stays as the
    kite file has it. The line's other effects, a counter that is wrong among them, stand behind."""
    tracked = with_effects(declaration, {} if DRUM in declaration.effects else {DRUM: {}})
    values = {f"{DRUM}.{name}": value for name, value in drum.items()}
    told = with_effects(tracked, {CONTROL: {}})
    told = told.with_parameters(told.table().with_values(values))
    others = tuple(key for key in told.effects if key not in (CONTROL, DRUM))
    return told.model_copy(update={"effects": (CONTROL, DRUM, *others)})


def fly_pumping(
    kite: Kite, phases: Sequence[PumpingPhase], wind: WindRecord, *, start: np.ndarray, length: float, duration: float, dt: float,
    cycles: int | None = None, speed: float = 0.0, load: float = 0.0, step: float = 0.01, begins: float = 0.0, seed: int = 0,
    simulator: Simulator | None = None, values: Mapping[str, float] | None = None,
) -> Pumped:  # fmt: skip
    """Fly through the phases, again and again, for `duration` seconds or to the end of `cycles`.

    kite: `with_winch`, made for the wind's heights; start (12,), length [m] of line at t = 0, speed [m/s] of the drum, load [N] on it;
    simulator: of this kite, where it is compiled already; values: parameters that differ from the kite's. It departs where it diverges,
    comes lower than LOWEST or stands in the air (STALLED). Slack lines are flown. Other arguments as in `simulate_flight`.
    """
    refuse_measured(kite.declaration)
    samples = int(round(duration / dt)) + 1
    time = np.arange(samples) * dt
    line = dict(zip(("tether_length", "reel_out_speed"), ReelOut(length, 0.0).at(time), strict=True))
    inputs = inputs_of(Commanded(time, dt, line, wind), kite)
    inputs[:, kite.input_names.index("time")] += begins
    simulator = simulator or Simulator(kite, wrt=(), step=step)
    own = {f"{CONTROL}.load": load, f"{DRUM}.speed": speed}
    segments = Segments(np.zeros(1, int), start[None], np.zeros((1, samples, len(SURFACES))), inputs[None], dt)
    given = [
        (p, simulator.flown_by(p.law), kite.with_values({**(values or {}), **{f"{CONTROL}.{n}": v for n, v in p.winch.items()}}))
        for p in phases
    ]

    def fly(inputs: np.ndarray) -> Switched:
        made = [Phase(p.name, s.law.value, k.parameters.vector(), p.guards) for p, s, k in given]
        x0 = segments.starts_for(simulator.n_s)[0]
        x0[12:] = _offsets(given[0][2], own, start, inputs[0])
        return fly_switched(
            simulator.f.value, simulator.g.value, simulator.initial.value, made, simulator.n_s, x0, segments.setpoints[0], inputs, dt,
            simulator.stepping(segments), len(OUTPUTS), lambda X, Y, U: _quantities(kite, X, Y, U),
            None if cycles is None else cycles * len(phases) - 1,
        )  # fmt: skip

    flown = fly(inputs)
    if "turbulence.sigma" in kite.parameters:
        at = {n: i for i, n in enumerate(kite.input_names)}
        last = max(_samples(flown), 1)
        columns, gusts = gusts_for(kite, samples, dt, float(flown.outputs[:last, OUTPUTS.index("V_a")].mean()), seed, at)
        inputs[:, columns] = gusts
        flown = fly(inputs)
    last = max(_samples(flown), 1)
    switches = tuple(s for s in flown.switches if s.sample < last)
    ended = flown.ended if last == flown.alive else None
    done = sum(s.into == 0 for s in switches) + (ended is not None)
    told = _told(kite, flown, inputs, last, time, dt, departed=last < samples and ended is None)
    return Pumped(told, flown.phase[:last], switches, ended, done)


def _offsets(kite: Kite, own: Mapping[str, float], start: np.ndarray, u: np.ndarray) -> np.ndarray:
    """(n_e,) by how much the effects' states at the start differ from what `Kite.initial` says: drum and load as told."""
    names = kite.state_names[12:]
    c = [float(v) for v in kite.parameters.vector()]
    x = [*map(float, start), *(0.0 for _ in names), *(0.0 for _ in SURFACES)]
    said = np.array([float(v) for v in kite.initial(x, [float(v) for v in u], c)])
    wanted = np.array([own.get(name, value) for name, value in zip(names, said, strict=True)])
    ahead = [f"{CONTROL}.ahead", f"{DRUM}.ahead"]
    return np.where(np.isin(names, ahead), 0.0, wanted) - said


def _line(kite: Kite, X: np.ndarray, U: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(length [m], speed [m/s]) paid out, (n,)."""
    at = {name: i for i, name in enumerate(kite.state_names)}
    length = U[:, kite.input_names.index("tether_length")] + X[:, at[f"{CONTROL}.ahead"]] + X[:, at[f"{DRUM}.ahead"]]
    return length, X[:, at[f"{DRUM}.speed"]]


def _quantities(kite: Kite, X: np.ndarray, Y: np.ndarray, U: np.ndarray) -> dict[str, np.ndarray]:
    told = {name: Y[:, i] for i, name in enumerate(OUTPUTS)} | {"tether_length": _line(kite, X, U)[0]}
    return {name: of(X, told) for name, of in GUARDED.items()}


def _samples(flown: Switched) -> int:
    """How many samples count: before it diverges, comes too low or stands still in the air."""
    X, Y = flown.states[: flown.alive], flown.outputs[: flown.alive]
    bad = (X[:, 2] > -LOWEST) | (Y[:, OUTPUTS.index("V_a")] < STALLED)
    return int(bad.argmax()) if bad.any() else flown.alive


def _told(kite: Kite, flown: Switched, inputs: np.ndarray, last: int, time: np.ndarray, dt: float, departed: bool) -> Flown:
    """The flight as `simulate_flight` gives it."""
    X, Y = flown.states[:last], flown.outputs[:last]
    length, speed = _line(kite, X, inputs[:last])
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
