"""What sensors make of a flight that is known exactly: white noise, drift, biases, delays, scales, outliers and gaps, each as asked for."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import lfilter

from awescli.flightlog.log import FlightLog
from awescli.flightlog.wind_at import wind_ned
from awescli.notation.angles import wrap
from awescli.notation.frames import rotate_back, rotation_body_to_ned
from awescli.physics.declaration import Noise

ATTITUDE, POSITION, VELOCITY, RATES = ("phi", "theta", "psi"), ("p_n", "p_e", "p_d"), ("v_n", "v_e", "v_d"), ("p", "q", "r")
ACCELERATION = ("a_x", "a_y", "a_z")


@dataclass(frozen=True)
class Sensors:
    """SI. white: channel -> standard deviation, default the kite file's; factor: on all of them; attitude, position: (level, memory [s]) of
    their drifts; gusts: (level, memory) of the three components of wind that only the air data meet; late: group of channels -> delay [s];
    bias: channel -> constant error; scale, lag [s] of first order: of the airspeed; wind: NED, what the air has beyond its record; vanes:
    whether there are any; outliers: share of samples; gap: [s] lost in one piece in mid flight."""

    white: Mapping[str, float] = field(default_factory=lambda: {n: std for n, (std, share) in Noise().channels().items() if not share})
    factor: float = 1.0
    attitude: tuple[float, float] | None = None
    position: tuple[float, float] | None = None
    gusts: tuple[float, float] | None = None
    late: Mapping[tuple[str, ...], float] = field(default_factory=dict)
    bias: Mapping[str, float] = field(default_factory=dict)
    scale: float = 1.0
    lag: float = 0.0
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    vanes: bool = False
    outliers: float = 0.0
    gap: float = 0.0

    def record(self, true: FlightLog, seed: int) -> FlightLog:
        """What these sensors log of a flight without noise."""
        random, n, dt = np.random.default_rng(seed), len(true), true.dt
        signals = {name: signal.copy() for name, signal in true.measured.items() if name not in ("alpha", "beta")}
        air = self._air(true, random)
        signals["V_a"] = np.sqrt(sum(a**2 for a in air))
        if self.vanes:
            signals |= {"alpha": np.arctan2(air[2], air[0]), "beta": np.arcsin(air[1] / signals["V_a"])}
        for group, delay in self.late.items():
            for name in group:
                signals[name] = np.interp(true.time - delay, true.time, np.unwrap(signals[name]) if name in ATTITUDE else signals[name])
        if self.lag:
            a = np.exp(-dt / self.lag)
            signals["V_a"] = lfilter([1 - a], [1, -a], signals["V_a"], zi=[a * signals["V_a"][0]])[0]
        signals["V_a"] *= self.scale
        for level, names in ((self.attitude, ATTITUDE), (self.position, POSITION)):
            for name in names if level else ():
                signals[name] = signals[name] + wander(random, n, dt, *level)
        for name in signals:
            signals[name] = signals[name] + self.bias.get(name, 0.0) + self.factor * self.white.get(name, 0.0) * random.standard_normal(n)
        if self.outliers:
            for name in (*POSITION, "V_a"):
                hit = random.random(n) < self.outliers
                signals[name] = signals[name] + hit * random.choice([-1, 1], n) * 30 * self.white[name]
        for name in ("phi", "psi"):
            signals[name] = wrap(signals[name])
        valid = np.ones(n, bool)
        valid[n // 2 : n // 2 + int(self.gap / dt)] = False
        return replace(true, measured=signals, valid=valid)

    def _air(self, true: FlightLog, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The air's velocity past the kite, body axes."""
        wind = wind_ned(true.wind, true.time, -true["p_d"])
        blown = [wander(random, len(true), true.dt, *self.gusts) if self.gusts else 0.0 for _ in wind]
        past = tuple(true[v] - w - more - g for v, w, more, g in zip(VELOCITY, wind, self.wind, blown, strict=True))
        return rotate_back(rotation_body_to_ned(true["phi"], true["theta"], true["psi"]), past)


def wander(random: np.random.Generator, n: int, dt: float, level: float, memory: float) -> np.ndarray:
    """(n,) an Ornstein-Uhlenbeck process in its steady state."""
    phi = np.exp(-dt / memory)
    steps = random.standard_normal(n) * level * np.r_[1.0, np.full(n - 1, np.sqrt(1 - phi**2))]
    return lfilter([1.0], [1.0, -phi], steps)
