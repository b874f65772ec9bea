"""Synthetic flights: minutes of closed loop of a kite, as a flight log that a recorder might have written.

    log = fly(declaration, law.setpoints, wind, ReelOut(480.0, 0.5), pattern=law.pattern, duration=150.0, seed=1)

Whatever effects the flown declaration holds are in the flight; an effect that the *declared* kite file lacks is thereby undeclared.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from awescli.control.pattern import Pattern, arc
from awescli.flightlog.log import FlightLog, WindRecord
from awescli.notation.errors import BadInput, NumericalFailure
from awescli.notation.quantities import MEASURED, OUTPUTS, STATES, SURFACES
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.kite import Kite
from awescli.simulation.gusts import LENGTH, dryden
from awescli.simulation.rollout import Segments, Simulator, Trajectories, inputs_of
from awescli.simulation.segments import noise_std

EPOCH = 1_650_000_000.0
"""Unix time of the first sample [s]: an arbitrary constant, so that the same seed writes the same bytes on any day."""
AIRSPEED = 40.0
"""[m/s] at which the frozen field of gusts is crossed; mean of the published flight (parameters.yaml, km1)."""
RECORDED = tuple(name for name in MEASURED if name not in ("alpha", "beta"))
"""What Kitemill's recorder writes of the measured quantities: it has no vanes."""
FARTHEST = 3.0
"""A kite farther from the pattern's centre than this many radii has departed."""
SLACK = 1.0
"""[s] of slack line in one piece that count as departed."""


@dataclass(frozen=True)
class ReelOut:
    """What the winch is told. length: paid out at t = 0 [m]; speed: mean [m/s]; swing [m/s], period [s]: a sine on top of it, as of a
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
class _Commanded:
    """What `rollout.inputs_of` reads of a log, before there is one."""

    time: np.ndarray
    dt: float
    inputs: Mapping[str, np.ndarray]
    wind: WindRecord
    measured: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time)


def with_effects(declaration: KiteDeclaration, effects: Mapping[str, Mapping[str, float]]) -> KiteDeclaration:
    """The declaration with effects switched on: key (`name` or `name:target`) -> its parameters by short name, e.g.
    {"actuator_lag:rudder": {"tau": 0.15}}. A parameter that is not named keeps its null (or shape) value. Raises BadInput."""
    if not effects:
        return declaration
    kite = Kite(declaration, extra=tuple(effects))
    values = {f"{key}.{name}": float(value) for key, own in effects.items() for name, value in own.items()}
    return kite.declare(tuple(effects), table=kite.parameters.with_values(values))


def fly(
    declaration: KiteDeclaration,
    law: Callable | None,
    wind: WindRecord,
    reel_out: ReelOut,
    *,
    pattern: Pattern,
    duration: float = 150.0,
    dt: float = 0.02,
    start: np.ndarray | None = None,
    settle: float = 30.0,
    seed: int = 0,
    noise: bool = True,
    substeps: int = 4,
    recorded_wind: WindRecord | None = None,
    name: str = "synthetic",
) -> FlightLog:
    """Fly `duration` seconds and report them as sensors would.

    law: function of (x, u, c) -> four set-points (`PathFollowing.setpoints`, or a fitted law's); start: (12,) states at t = 0, or None: the
    kite is put on the pattern at several phases and speeds `settle` seconds before t = 0, and the run that follows the pattern best
    is kept. wind: the air as it is, time 0 at the flight's first sample; recorded_wind: what the log says of it (default: the truth).
    seed: of the sensor noise (kite file's `noise`, white) and the gusts. substeps: RK4 steps per sample of dt [s].
    Raises NumericalFailure("departed") where no start stays on the pattern to the end.
    """
    if declaration.tether.tension == "measured":
        raise BadInput("a kite whose tension is the measured one cannot be flown without a log", "tether.tension", "Use `tension: constraint`.")
    kite = Kite(declaration, wind.height)
    lead = int(round((settle if start is None else 0.0) / dt))
    samples = lead + int(round(duration / dt)) + 1
    time = (np.arange(samples) - lead) * dt
    length, speed = reel_out.at(time)
    inputs = inputs_of(_Commanded(time, dt, {"tether_length": length, "reel_out_speed": speed}, wind), kite)
    at = {n: i for i, n in enumerate(kite.input_names)}
    if any(key.startswith("turbulence") for key in declaration.effects):
        scale = kite.parameters["turbulence.L"].value if "turbulence.L" in kite.parameters else LENGTH
        inputs[:, [at[f"turbulence_{axis}"] for axis in "ned"]] = dryden(samples, dt, AIRSPEED, seed + 1, scale)
    starts = _starts(pattern, kite, inputs[0], at) if start is None else np.asarray(start, dtype=float)[None]
    K = len(starts)
    segments = Segments(np.zeros(K, dtype=int), starts, np.zeros((K, samples, len(SURFACES))), np.repeat(inputs[None], K, axis=0), dt)
    flown = Simulator(kite, wrt=(), law=law, substeps=substeps).rollout(segments)
    best = _best(flown, pattern, lead, dt, declaration)
    outputs = {n: flown.outputs[best, lead:, i] for i, n in enumerate(OUTPUTS)}
    return _log(outputs, declaration, recorded_wind or wind, time[lead:], dt, length[lead:], speed[lead:], seed, noise, name)


def _log(outputs, declaration, wind, time, dt, length, speed, seed, noise, name) -> FlightLog:
    """What the sensors make of the true outputs."""
    random = np.random.default_rng(seed)
    measured = {}
    for quantity in RECORDED:
        truth = outputs[quantity]
        # drawn also where it is not added, so that every channel keeps its noise whatever is switched off
        error = random.standard_normal(len(truth)) * noise_std(declaration.noise, quantity, truth)
        measured[quantity] = truth + error if noise else truth.copy()
    for angle in ("phi", "psi"):
        measured[angle] = np.pi - (np.pi - measured[angle]) % (2 * np.pi)
    inputs = {surface: outputs[surface].copy() for surface in SURFACES} | {"tether_length": length, "reel_out_speed": speed}
    return FlightLog(name, EPOCH, dt, time, measured, inputs, np.ones(len(time), bool), wind, notes=(f"Synthetic flight, seed {seed}.",))


def _best(flown: Trajectories, pattern: Pattern, lead: int, dt: float, declaration: KiteDeclaration) -> int:
    """The run that stays nearest to the circle; NumericalFailure where all depart."""
    samples = flown.states.shape[1]
    z = SimpleNamespace(**{name: flown.states[:, :, i] for i, name in enumerate(STATES)})
    away = arc(vars(z), pattern) / pattern.radius
    slack = flown["tension"] <= 0.0
    longest = int(round(SLACK / dt))
    last = np.full(len(away), samples)
    for k in range(len(away)):
        gone = ~(away[k] < FARTHEST) | ~(z.p_d[k] < 0.0) | (np.convolve(slack[k], np.ones(longest), "same") >= longest - 0.5)
        gone[flown.alive[k] :] = True
        gone[: min(lead, samples // 4) // 2] = False  # a start that is not in trim may swing at first
        last[k] = np.argmax(gone) if gone.any() else samples
    if last.max() < samples:
        seconds = (last.max() - lead) * dt
        raise NumericalFailure(
            "departed",
            f"the kite '{declaration.name}' leaves its pattern after {max(seconds, 0.0):.1f} s, the best of {len(last)} starts",
            do="Fly a wider or lower pattern, other trims, a smaller effect, or gentler gains of the law.",
        )
    error = np.where(last == samples, np.abs(away - 1.0)[:, lead:].mean(axis=1), np.inf)
    return int(np.argmin(error))


def _starts(pattern: Pattern, kite: Kite, inputs: np.ndarray, at: Mapping[str, int]) -> np.ndarray:
    """(16, 12) states on the circle: 8 phases, 2 speeds over ground, flying along the circle with the belly to the winch."""
    length = inputs[at["tether_length"]] + kite.parameters["dl"].value
    wind = _mean_wind(kite, inputs, at)
    return np.array([_on_circle(pattern, length, phase, speed, wind) for speed in (32.0, 42.0) for phase in np.arange(8) * np.pi / 4])


def _mean_wind(kite: Kite, inputs: np.ndarray, at: Mapping[str, int]) -> np.ndarray:
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
