"""What a winch's encoder and tachometer say together. A drum has inertia: what they record beside one smooth motion is their own noise, and
a model whose line is as stiff as a line would feel each step of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize

from awescli.flightlog.log import FlightLog

LENGTH_NOISE, SPEED_NOISE = 1e-3, 5e-3
"""[m], [m/s] of noise that a line does not feel: 8 N at 8 kN/m, 5 N at 0.9 kN s/m. A log with less is left as it is, to the bit."""

LEVELS_FROM = 10_000
"""Samples from which the noise is estimated: 200 s at 50 Hz."""

GUESS = (0.01, 0.02, 1.0)
"""[m], [m/s], [m/s3] noise of length and speed, and the jerk of the drum, from where the search sets out."""

LEAST, MOST = (1e-5, 1e-5, 1e-2), (10.0, 100.0, 1e4)
"""Bounds of the search: less noise than that is none, and a drum that is steadier costs digits."""

SHORTEST = 5.0
"""[s] of a log from which anything is said of its winch."""

FAINT = 1e-4
"""Weight of a sample that was not recorded, beside one that was: on the line between its neighbours it keeps a long gap from being nothing
at all, which no matrix can hold."""

AVERAGE = 1.0
"""[s] over which noise averages out, and what does not is something else: a scale, a sign, another clock."""

LASTING = 0.75
"""Share of a noise that may outlast `AVERAGE`, for it to be called one."""

BENT = 3.0
"""Times its noise by which the motion may leave a signal for `AVERAGE` anywhere: a step of a coarse one does by 1.7, more bends it."""

DIFFERENCE = np.array([-1.0, 3.0, -3.0, 1.0])
"""Third difference: what a smooth motion has none of, and white noise sqrt(20) times of."""


@dataclass(frozen=True)
class WinchMotion:
    """length (N,) [m], speed (N,) [m/s]: of the motion; noise_length [m], noise_speed [m/s]: standard deviations of what is recorded beside
    it; noisy: both are noise, and one of them is felt."""

    length: np.ndarray
    speed: np.ndarray
    noise_length: float
    noise_speed: float
    noisy: bool


def with_smooth_winch(log: FlightLog) -> FlightLog:
    """The log with the motion that length and speed share in their place, where they are noisy; as it is, otherwise."""
    if "tether_length" not in log.inputs or "reel_out_speed" not in log.inputs or len(log) < SHORTEST / log.dt:
        return log
    length, speed = log["tether_length"], log["reel_out_speed"]
    if _roughness(length) < LENGTH_NOISE and _roughness(speed) < SPEED_NOISE:
        return log
    seen = [log.valid & log.is_new(n) for n in ("tether_length", "reel_out_speed")]
    if min(at.sum() for at in seen) * log.dt < SHORTEST:
        return log
    motion = winch_motion(length, speed, log.dt, seen)
    if not motion.noisy:
        return log
    said = (
        f"The winch recorded its length with noise of {1000 * motion.noise_length:.1f} mm and its speed with "
        f"{1000 * motion.noise_speed:.1f} mm/s: the smooth motion that both share stands in their place."
    )
    inputs = {**log.inputs, "tether_length": motion.length, "reel_out_speed": motion.speed}
    return replace(log, inputs=inputs, notes=(*log.notes, said))


def winch_motion(length: np.ndarray, speed: np.ndarray, dt: float, seen: Sequence[np.ndarray]) -> WinchMotion:
    """The likeliest length whose third derivative is white noise and that was recorded, as its rate was, with white noise: both levels of
    noise and that of the jerk by marginal likelihood (Wahba 1985; Rue & Held, Gaussian Markov Random Fields, ch. 3).

    length (N,) [m], speed (N,) [m/s] at `dt` [s]; seen: two (N,) bool, where each was recorded: between, it is on the line.
    """
    rows = np.arange(len(length))
    length, speed = (np.where(at, x, np.interp(rows, rows[at], x[at])) for x, at in zip((length, speed), seen, strict=True))
    # where the drum works hardest its jerk is that of all the flight, a quick reel-in among it
    width = max(1, int(round(AVERAGE / dt)))
    hardest = int(np.abs(np.diff(uniform_filter1d(speed, width))).argmax())
    first = int(np.clip(hardest - LEVELS_FROM // 2, 0, max(len(length) - LEVELS_FROM, 0)))
    part = slice(first, first + LEVELS_FROM)
    some = _Banded.of(length[part], speed[part], dt, seen[0][part], seen[1][part])
    bounds, until = np.log(np.transpose([LEAST, MOST])), {"xatol": 0.02, "fatol": 0.5}
    found = minimize(lambda logs: some.solve(np.exp(logs))[0], np.log(GUESS), method="Nelder-Mead", bounds=bounds, options=until)
    levels = np.exp(found.x)
    deviance, smooth = _Banded.of(length, speed, dt, *seen).solve(levels)
    if not np.isfinite(deviance):
        return WinchMotion(length, speed, float(levels[0]), float(levels[1]), False)
    rate = np.gradient(smooth, dt)
    lasting = [_lasting(recorded - own, dt, at) for recorded, own, at in zip((length, speed), (smooth, rate), seen, strict=True)]
    felt = np.array([LENGTH_NOISE, SPEED_NOISE])
    usual, most = np.transpose(lasting)
    theirs = (usual <= np.maximum(LASTING * levels[:2], felt)) & (most <= BENT * levels[:2] + felt)
    noisy = bool((levels[:2] > felt).any() and theirs.all())
    return WinchMotion(smooth, rate, float(levels[0]), float(levels[1]), noisy)


def _roughness(x: np.ndarray) -> float:
    """Standard deviation that white noise has at most in a signal."""
    return float(np.sqrt((np.convolve(x, DIFFERENCE, "valid") ** 2).mean() / 20))


def _lasting(left: np.ndarray, dt: float, seen: np.ndarray) -> tuple[float, float]:
    """(RMS, largest size) of what is left of a signal after `AVERAGE`."""
    width = max(1, int(round(AVERAGE / dt)))
    weight = uniform_filter1d(seen.astype(float), width)
    mean = uniform_filter1d(np.where(seen, left, 0.0), width)[seen] / weight[seen]
    return float(np.sqrt((mean**2).mean())), float(np.abs(mean).max())


@dataclass(frozen=True)
class _Banded:
    """The likelihood of a recorded length and speed for any levels: lower bands (4, N) of the normal equations' three parts."""

    at: np.ndarray
    rate: np.ndarray
    jerk: np.ndarray
    right_at: np.ndarray
    right_rate: np.ndarray
    squares: tuple[float, float]
    counts: tuple[int, int, int]
    ramp: np.ndarray

    @classmethod
    def of(cls, length: np.ndarray, speed: np.ndarray, dt: float, seen_length: np.ndarray, seen_speed: np.ndarray) -> "_Banded":
        n, rows = len(length), np.arange(len(length))
        ramp = np.polynomial.Polynomial.fit(rows, length, 1)(rows)  # taken off for the rounding's sake
        weight, y, v = np.where(seen_length, 1.0, FAINT), length - ramp, speed - np.gradient(ramp, dt)
        inner = rows[1:-1][seen_speed[1:-1]]
        right = np.zeros(n)
        for side in (-1, 1):
            np.add.at(right, inner + side, side * v[inner] / (2 * dt))
        at = np.zeros((4, n))
        at[0] = weight
        rate = _products(np.array([-0.5, 0.0, 0.5]) / dt, inner - 1, n)
        jerk = _products(DIFFERENCE / dt**3, rows[:-3], n)
        squares, counts = (float(y @ (weight * y)), float(v[inner] @ v[inner])), (int(seen_length.sum()), len(inner), n - 3)
        return cls(at, rate, jerk, weight * y, right, squares, counts, ramp)

    def solve(self, levels: np.ndarray) -> tuple[float, np.ndarray]:
        """(-2 log likelihood but for a constant, the likeliest length (N,)) with noise of length and speed, and jerk; infinite where a
        drum so steady, and noise so large, cannot be told from a singular matrix."""
        w = 1 / np.asarray(levels) ** 2
        try:
            factor = cholesky_banded(w[0] * self.at + w[1] * self.rate + w[2] * self.jerk, lower=True)
        except np.linalg.LinAlgError:
            return np.inf, self.ramp
        right = w[0] * self.right_at + w[1] * self.right_rate
        found = cho_solve_banded((factor, True), right)
        cost = w[:2] @ self.squares - right @ found
        return float(cost + 2 * np.log(factor[0]).sum() - np.log(w) @ self.counts), found + self.ramp


def _products(stencil: np.ndarray, begins: np.ndarray, n: int) -> np.ndarray:
    """Lower bands (4, n) of D'D, each row of D a stencil that begins at one of `begins`."""
    bands = np.zeros((4, n))
    for i, a in enumerate(stencil):
        for j, b in enumerate(stencil[i:]):
            np.add.at(bands[j], begins + i, a * b)
    return bands
