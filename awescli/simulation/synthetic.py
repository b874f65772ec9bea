"""Synthetic flights: minutes of closed loop of a kite, as a flight log that a recorder might have written.

    log = fly(declaration, law.setpoints, wind, ReelOut(480.0, 0.5), pattern=law.pattern, duration=150.0, seed=1)

Whatever effects the flown declaration holds are in the flight; an effect that the *declared* kite file lacks is thereby undeclared.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from awescli.control.pattern import Pattern, arc
from awescli.flightlog.log import FlightLog, WindRecord
from awescli.notation.angles import wrap
from awescli.notation.errors import BadInput, NumericalFailure
from awescli.notation.present import present
from awescli.notation.quantities import CONTROL_SURFACES, MEASURED, OF_LINE, OUTPUTS, STATES, SURFACES
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.flight_model import FlightModel
from awescli.physics.kite import Kite, make_effect, surfaces_used
from awescli.simulation.gusts import dryden, roll_gust
from awescli.simulation.rollout import BODY_VELOCITY, Segments, Simulator, Trajectories, inputs_of
from awescli.simulation.segments import noise_std

EPOCH = 1_650_000_000.0
"""Unix time of the first sample [s]: an arbitrary constant, so that the same seed writes the same bytes on any day."""
RECORDED = tuple(name for name in MEASURED if name not in ("alpha", "beta"))
"""What Kitemill's recorder writes of the measured quantities: it has no vanes."""
FARTHEST = 3.0
"""A kite farther from the pattern's centre than this many radii has departed."""
SLACK = 1.0
"""[s] of slack line in one piece that count as departed."""


class Winch(Protocol):
    """What moves the line."""

    def at(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(length [m], speed [m/s]), each (N,), at time (N,) [s]."""
        ...


@dataclass(frozen=True)
class ReelOut:
    """What the winch is commanded. length: paid out at t = 0 [m]; speed: mean [m/s]; swing [m/s], period [s]: a sine on top of it, as of a
    winch that follows the load; every flight then moves the line at a rhythm of its own, which tells l_t effects from loop effects."""

    length: float
    speed: float = 0.8
    swing: float = 0.0
    period: float = 9.0

    def at(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(length [m], speed [m/s]), each (N,), at time (N,) [s]; the length is the exact integral of the speed."""
        rate = 2 * np.pi / self.period
        return (
            self.length + self.speed * time + self.swing / rate * (1 - np.cos(rate * time)),
            self.speed + self.swing * np.sin(rate * time),
        )


@dataclass(frozen=True)
class LoggedReelOut:
    """The winch as a log has it, from its sample `first` on; beyond the log's end it goes on at the log's mean speed."""

    log: FlightLog
    first: int = 0

    def at(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(length [m], speed [m/s]), each (N,), at time (N,) [s] after sample `first`."""
        own, length, speed = self.log.time[self.first :] - self.log.time[self.first], self.log["tether_length"], self.log["reel_out_speed"]
        beyond, mean = np.maximum(time - own[-1], 0.0), float(speed[self.first :].mean())
        return (
            np.interp(time, own, length[self.first :]) + mean * beyond,
            np.where(beyond > 0, mean, np.interp(time, own, speed[self.first :])),
        )


@dataclass(frozen=True)
class Commanded:
    """What `rollout.inputs_of` reads of a log, before there is one."""

    time: np.ndarray
    dt: float
    inputs: Mapping[str, np.ndarray]
    recorded_wind: WindRecord
    measured: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Flown:
    """A simulated flight as it truly was. time (N,) s from 0; outputs: name (`quantities.OUTPUTS`, and u, v, w) -> (N,);
    inputs: tether_length, reel_out_speed -> (N,), none of a kite that flies free; departed: it ended before it should, with the last
    sample before that."""

    time: np.ndarray
    dt: float
    outputs: Mapping[str, np.ndarray]
    inputs: Mapping[str, np.ndarray]
    departed: bool


def with_effects(declaration: KiteDeclaration, effects: Mapping[str, Mapping[str, float]]) -> KiteDeclaration:
    """The declaration with effects switched on: key (`name` or `name:target`) -> its parameters by short name, e.g.
    {"actuator_lag:rudder": {"tau": 0.15}}. A parameter that is not named keeps its null (or shape) value. Raises BadInput."""
    if not effects:
        return declaration
    kite = Kite(declaration, extra=tuple(effects))
    values = {f"{key}.{name}": float(value) for key, own in effects.items() for name, value in own.items()}
    return kite.declare(tuple(effects), table=kite.parameters.with_values(values))


def refuse_measured(declaration: KiteDeclaration) -> None:
    """Raise BadInput for a kite that reads measurements: one that flies on its own has none."""
    if declaration.tether.tension == "measured":
        what = "a kite whose tension is the measured one cannot fly on its own"
        raise BadInput(what, "tether.tension", "Declare `tension: constraint`.")
    for effect in (make_effect(key, declaration) for key in declaration.effects):
        if effect.reads:
            what = f"effect '{effect.key}' reads the measured {', '.join(effect.reads)}: a kite that flies on its own has no log of it"
            raise BadInput(what, "effects", "Replay a log, or leave the effect out.")


def fly(
    declaration: KiteDeclaration, law: Callable, wind: WindRecord, reel_out: ReelOut, *, pattern: Pattern, duration: float = 150.0,
    seed: int = 0, noise: bool = True, recorded_wind: WindRecord | None = None, name: str = "synthetic", **how: Any
) -> FlightLog:  # fmt: skip
    """Fly `duration` seconds on the pattern and report them as sensors would. how: further arguments of `simulate_flight`.

    wind: the air as it is, time 0 at the flight's first sample; recorded_wind: what the log says of it (default: the truth).
    Raises NumericalFailure("departed") where no start stays on the pattern to the end.
    """
    flown = simulate_flight(Kite(declaration, wind.height), law, wind, reel_out, pattern=pattern, duration=duration, seed=seed, **how)
    if flown.departed:
        raise NumericalFailure(
            "departed",
            f"the kite '{declaration.name}' leaves its pattern after {len(flown.time) * flown.dt:.1f} s of {duration:g} s",
            do="Fly a wider or lower pattern, more wind, other trims, a smaller effect, or gentler gains of the law.",
        )
    return as_recorded(flown, declaration, recorded_wind or wind, seed=seed, noise=noise, name=name)


def simulate_flight(
    kite: FlightModel, law: Callable | None, wind: WindRecord, reel_out: Winch | None, *, pattern: Pattern | None, duration: float,
    dt: float = 0.02, start: np.ndarray | None = None, setpoints: np.ndarray | None = None, settle: float = 30.0, seed: int = 0,
    step: float = 0.005, begins: float = 0.0, rates: Mapping[str, float] | None = None,
) -> Flown:  # fmt: skip
    """Simulate one long segment, up to its end or to where the kite departs.

    kite: a Kite made for the wind's heights, or what stands in its place (a hybrid); law: function of (x, u, c) -> set-points
    (`PathFollowing.setpoints`, or a fitted law's), or None to replay setpoints (N+1, 5); reel_out: anything with `ReelOut.at`, None for
    a kite that flies free;
    start: (12,) states at t = 0, or None: the kite is put on the pattern at several phases and speeds `settle` seconds before t = 0,
    and the run that follows the pattern best is kept. seed: of the gusts; step: longest of RK4 [s]; begins: what the flight's
    clock shows at t = 0 [s], for what drifts with it; rates: of set-points and load at `start` (`rollout.rates_at`), behind which a lag
    stands there; default zero: they were at rest. pattern: what the kite must not stray from; without one only a kite that the numbers
    or the ground end departs.
    """
    refuse_measured(kite.declaration)
    lead = int(round((settle if start is None else 0.0) / dt))
    samples = lead + int(round(duration / dt)) + 1
    time = (np.arange(samples) - lead) * dt
    line: dict[str, np.ndarray] = {}
    if kite.tether is not None:
        line["tether_length"], line["reel_out_speed"] = present(reel_out, "what moves the line").at(time)
    inputs = inputs_of(Commanded(time, dt, line, wind), kite)
    at = {n: i for i, n in enumerate(kite.input_names)}
    inputs[:, at["time"]] += begins
    for name, value in (rates or {}).items():
        inputs[0, at[name]] = value
    if start is None:
        if pattern is None:
            raise BadInput("without a start the kite needs a pattern to be put on")
        starts = circle_starts(pattern, kite, inputs[0], at)
    else:
        starts = np.asarray(start, dtype=float)[None]
    K = len(starts)
    replayed = np.zeros((samples, len(SURFACES))) if setpoints is None else setpoints
    segments = Segments(np.zeros(K, dtype=int), starts, np.repeat(replayed[None], K, axis=0), np.repeat(inputs[None], K, axis=0), dt)
    simulator = Simulator(kite, wrt=(), law=law, step=step)
    flown = simulator.rollout(segments)
    best, last = _best(flown, pattern, lead, dt)
    rows = slice(lead, max(last, lead + 1))
    if "turbulence.sigma" in kite.parameters:
        # a frozen field of gusts is crossed at the airspeed at which this kite flies the same way in still air
        columns, gusts = gusts_for(kite, samples, dt, float(flown["V_a"][best, rows].mean()), seed, at)
        flown = simulator.rollout(segments.with_inputs(columns, gusts))
        best, last = _best(flown, pattern, lead, dt)
        rows = slice(lead, max(last, lead + 1))
    outputs = {n: flown.outputs[best, rows, i] for i, n in enumerate(OUTPUTS)}
    outputs |= {n: flown[n][best, rows] for n in BODY_VELOCITY}
    return Flown(time[rows], dt, outputs, {name: signal[rows] for name, signal in line.items()}, departed=last < samples)


def as_recorded(
    flown: Flown, declaration: KiteDeclaration, wind: WindRecord, *, seed: int, noise: bool = True, name: str = "synthetic",
    epoch: float = EPOCH,
) -> FlightLog:  # fmt: skip
    """What the sensors make of a flight: white noise of the kite file, seeded; angles wrapped; no vanes (Kitemill has none)."""
    random = np.random.default_rng(seed)
    measured = {}
    for quantity in RECORDED if flown.inputs else (n for n in RECORDED if n not in OF_LINE):
        truth = flown.outputs[quantity]
        # drawn also where it is not added, so that every channel keeps its noise whatever is switched off
        error = random.standard_normal(len(truth)) * noise_std(declaration.noise, quantity, truth)
        measured[quantity] = truth + error if noise else truth.copy()
    for angle in ("phi", "psi"):
        measured[angle] = wrap(measured[angle])
    moved = {*CONTROL_SURFACES, *surfaces_used(declaration)}
    inputs = {n: flown.outputs[n].copy() for n in SURFACES if n in moved} | dict(flown.inputs)
    notes = (f"Synthetic flight, seed {seed}.",)
    return FlightLog(name, epoch, flown.dt, flown.time, measured, inputs, np.ones(len(flown.time), bool), wind, notes=notes)


def gusts_for(
    kite: FlightModel, samples: int, dt: float, airspeed: float, seed: int, at: Mapping[str, int]
) -> tuple[list[int], np.ndarray]:
    """(their input columns, (samples, 4) gusts of unit variance) for a kite that flies at `airspeed` [m/s]."""
    rows = dryden(samples, dt, airspeed, seed + 1, kite.parameters["turbulence.L"].value)
    roll = roll_gust(samples, dt, airspeed, kite.parameters["b"].value, seed + 2)
    return [at[f"turbulence_{axis}"] for axis in "nedp"], np.column_stack([rows, roll])


def _best(flown: Trajectories, pattern: Pattern | None, lead: int, dt: float) -> tuple[int, int]:
    """(which run, how many of its samples count): the run that lasts longest and, of those, stays nearest to the circle."""
    z = {name: flown.states[:, :, i] for i, name in enumerate(STATES)}
    away = arc(z, pattern) / pattern.radius if pattern else np.ones(z["p_n"].shape)
    last = np.array([_last(flown, k, away[k], -z["p_d"][k], pattern is not None, lead, dt) for k in range(len(away))])
    error = np.where(last == last.max(), np.abs(away - 1.0)[:, lead:].mean(axis=1), np.inf)
    best = int(np.argmin(error))
    return best, int(last[best]) if last[best] > lead else lead + 1


def _last(flown: Trajectories, k: int, away: np.ndarray, height: np.ndarray, loops: bool, lead: int, dt: float) -> int:
    """Number of samples before run k departs: diverged, on the ground, far from the pattern, or slack for long where it should loop."""
    samples = len(height)
    gone = ~(height > 0.0)
    if loops:
        window = int(round(SLACK / dt))
        slack = np.convolve(flown["tension"][k] <= 0.0, np.ones(window))[:samples] > window - 0.5
        gone |= ~(away < FARTHEST) | slack
    gone[: lead // 2] = False  # a start that is not in trim may swing at first
    gone[flown.alive[k] :] = True
    return int(np.argmax(gone)) if gone.any() else samples


def circle_starts(pattern: Pattern, kite: FlightModel, inputs: np.ndarray, at: Mapping[str, int]) -> np.ndarray:
    """(16, 12) states on the circle: 8 phases, 2 speeds over ground, flying along the circle with the belly to the winch."""
    length = inputs[at["tether_length"]] + kite.parameters["dl"].value
    wind = _mean_wind(kite, inputs, at)
    return np.array([_on_circle(pattern, length, phase, speed, wind) for speed in (32.0, 42.0) for phase in np.arange(8) * np.pi / 4])


def _mean_wind(kite: FlightModel, inputs: np.ndarray, at: Mapping[str, int]) -> np.ndarray:
    """(3,) wind NED [m/s] of the record's highest station at or below 200 m: near enough for a start."""
    below = [i for i, h in enumerate(kite.heights) if h <= 200.0] or [0]
    speed, direction = (inputs[at[f"wind_{kind}_{below[-1]}"]] for kind in ("speed", "direction"))
    return np.array([-speed * np.cos(direction), -speed * np.sin(direction), 0.0])


def _on_circle(pattern: Pattern, length: float, phase: float, speed: float, wind: np.ndarray, alpha: float = 0.08) -> np.ndarray:
    """(12,) one state on the circle, rotating as a whole about the pattern's axis; phase 0 is the top, growing to the right."""
    s_e, c_e, s_a, c_a = np.sin(pattern.elevation), np.cos(pattern.elevation), np.sin(pattern.azimuth), np.cos(pattern.azimuth)
    axis = np.array([c_e * c_a, c_e * s_a, -s_e])
    right, up = np.array([-s_a, c_a, 0.0]), np.array([-s_e * c_a, -s_e * s_a, -c_e])
    opening = pattern.radius / length
    p_hat = np.cos(opening) * axis + np.sin(opening) * (np.sin(phase) * right + np.cos(phase) * up)
    around = pattern.turn * (np.cos(phase) * right - np.sin(phase) * up)
    velocity = speed * around
    flow = velocity - wind
    ahead = flow / np.linalg.norm(flow)
    down = -p_hat + (p_hat @ ahead) * ahead
    down /= np.linalg.norm(down)
    x, z = np.cos(alpha) * ahead - np.sin(alpha) * down, np.sin(alpha) * ahead + np.cos(alpha) * down
    R = np.column_stack([x, np.cross(z, x), z])
    euler = np.arctan2(R[2, 1], R[2, 2]), np.arcsin(np.clip(-R[2, 0], -1, 1)), np.arctan2(R[1, 0], R[0, 0])
    rotation = pattern.turn * speed / (length * np.sin(opening)) * axis
    return np.concatenate([length * p_hat, R.T @ velocity, euler, R.T @ rotation])
