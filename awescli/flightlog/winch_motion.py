"""What a winch's encoder and tachometer say together. A drum has inertia: what they record beside one smooth motion is their own noise, and
a model whose line is as stiff as a line would feel each step of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.flightlog.log import FlightLog, Unknown
from awescli.flightlog.smooth_motion import (
    AVERAGE,
    SmoothMotion,
    density,
    effort_of,
    hardest,
    lasting,
    likeliest,
    not_known,
    roughness,
    step_of,
)

LENGTH_NOISE, SPEED_NOISE = 1e-3, 5e-3
"""[m], [m/s] of noise that a line does not feel: 8 N at 8 kN/m, 5 N at 0.9 kN s/m. A log with less is left as it is, to the bit."""

GUESS = (0.01, 0.02, 1.0)
"""[m], [m/s], [m/s3] noise of length and speed, and the jerk of the drum, from where the search sets out."""

LEAST, MOST = (1e-5, 1e-5, 1e-2), (10.0, 100.0, 30.0)
"""Bounds of the search: less noise than that is none, a drum that is steadier costs digits, and one that jerks more may follow any step."""

SHORTEST = 5.0
"""[s] of a log from which anything is said of its winch."""

LASTING = 0.75
"""Share of a noise that may outlast `AVERAGE`, for it to be called one."""

AGAIN, CLOSE = 6, 10.0
"""How often it is asked where the drum works harder, and by how much the log must be likelier for an answer to be asked again."""

BENT = 3.0
"""Times its noise by which the motion may leave a signal for `AVERAGE` anywhere: a step of a coarse one does by 1.7, more bends it."""


@dataclass(frozen=True)
class WinchMotion:
    """length (N,) [m], speed (N,) [m/s]: of the motion; noise_length [m], noise_speed [m/s]: standard deviations of what is recorded beside
    it; unknown: what is not known of the length still; noisy: both are noise, and one of them is felt."""

    length: np.ndarray
    speed: np.ndarray
    noise_length: float
    noise_speed: float
    unknown: Unknown
    noisy: bool


def with_smooth_winch(log: FlightLog) -> FlightLog:
    """The log with the motion that length and speed share in their place, where they are noisy; as it is, otherwise."""
    if "tether_length" not in log.inputs or "reel_out_speed" not in log.inputs or len(log) < SHORTEST / log.dt:
        return log
    length, speed = log["tether_length"], log["reel_out_speed"]
    if roughness(length) < LENGTH_NOISE and roughness(speed) < SPEED_NOISE:
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
    return replace(log, inputs=inputs, notes=(*log.notes, said), unknown={**log.unknown, "tether_length": motion.unknown})


def winch_motion(length: np.ndarray, speed: np.ndarray, dt: float, seen: Sequence[np.ndarray]) -> WinchMotion:
    """The likeliest length whose third derivative is white noise, of a level that changes slowly, and that was recorded, as its rate was,
    with white noise: levels by marginal likelihood (Wahba 1985; Rue & Held, Gaussian Markov Random Fields, ch. 3).

    length (N,) [m], speed (N,) [m/s] at `dt` [s]; seen: two (N,) bool, where each was recorded: between, it is on the line.
    """
    rows = np.arange(len(length))
    length, speed = (np.where(at, x, np.interp(rows, rows[at], x[at])) for x, at in zip((length, speed), seen, strict=True))
    part, levels, effort, deviance, smooth, price = hardest(speed, dt), np.array(GUESS), np.ones(len(rows)), np.inf, length, 0.0
    for _ in range(AGAIN):
        some = SmoothMotion.of(length[part], speed[part], dt, seen[0][part], seen[1][part], effort[part])
        tried = likeliest(lambda levels, some=some: some.solve(levels)[0], levels, LEAST, MOST)
        before, (now, motion) = deviance, SmoothMotion.of(length, speed, dt, seen[0], seen[1], effort).solve(tried)
        if not now < before - price:
            break
        # a drum that turns once in minutes works harder then: as long as the log is likelier for it
        levels, deviance, smooth, effort = tried, now, motion, effort_of(motion, dt)
        price = CLOSE if price else 2 * len(rows) * dt / AVERAGE  # of as many levels (Akaike)
    if not np.isfinite(deviance):
        return WinchMotion(length, speed, float(levels[0]), float(levels[1]), Unknown(np.inf, np.inf), False)
    rate = np.gradient(smooth, dt)
    left = [lasting(recorded - own, dt, at) for recorded, own, at in zip((length, speed), (smooth, rate), seen, strict=True)]
    felt = np.array([LENGTH_NOISE, SPEED_NOISE])
    usual, most = np.transpose(left)
    theirs = (usual <= np.maximum(LASTING * levels[:2], felt)) & (most <= BENT * levels[:2] + felt)
    noisy = bool((levels[:2] > felt).any() and theirs.all())
    unknown = not_known(levels[0], levels[2], dt, density((length - smooth)[seen[0]]))
    # a motion that follows steps has what rounding did to them, too
    followed = max(step_of(length[seen[0]]) ** 2 / 12 - levels[0] ** 2, 0.0)
    unknown = replace(unknown, std=float(np.hypot(unknown.std, np.sqrt(followed))))
    return WinchMotion(smooth, rate, float(levels[0]), float(levels[1]), unknown, noisy)
