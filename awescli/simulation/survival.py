"""Does a control law fly? Closed loop on a declared kite, from several states of a log, until it departs or the time is over."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Any

import numpy as np

from awescli.control.law import Commands, Law, clamp, standardised_features
from awescli.control.pattern import Pattern, arc
from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import Range
from awescli.notation.quantities import STATES, SURFACES
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.kite import Kite
from awescli.simulation.closed_loop import loop, with_setpoint_dynamics
from awescli.simulation.rollout import Simulator, Trajectories
from awescli.simulation.segments import Observed, observe
from awescli.simulation.synthetic import FARTHEST

LOWEST = 5.0
"""[m] a kite below this height has crashed."""
STALLED = 6.0
"""[m/s] an airspeed below this is no flight any more."""
STARTS = 8
"""From so many states, spread over the log."""
MARGINS = {"lower": (0.8, 0.65, 0.5, 0.35), "upper": (1.25, 1.6, 2.0, 3.0)}
"""Factors on a law's gain that are tried, nearest to 1 first."""
STEP, HELD = np.radians(0.25), 1.0
"""[rad] size and [s] length of the random steps that measure the loop's gain: small enough that the kite keeps flying."""


def flies(
    declaration: KiteDeclaration, law: Commands, log: FlightLog, wind_direction: float, seconds: float,
    within: tuple[Range, ...] | None = None,
) -> dict:  # fmt: skip
    """Survival time from several states of the log, path error against the log, and a named outcome.

    outcome: "flies" (the whole time from every state), "departs" (from some), "does_not_fly" (from none). A kite departs that diverges,
    crashes, stalls, or leaves the circle of a law that has one by `FARTHEST` radii. within: sample ranges whose states may be
    started from (default: the whole log). Wind and line are those of the log, so a start lies at least `seconds` before its end.
    """
    steps = int(min(seconds / log.dt, len(log) - 2))
    simulator, observed = _prepared(declaration, law, log, wind_direction, steps, within)
    trajectories = simulator.rollout(observed.segments)
    alive = samples_flown(trajectories, getattr(law, "pattern", None) if _circles(law, log) else None)
    survived = (alive - 1) * log.dt
    asked = steps * log.dt
    whole = alive > steps
    short = min(int(5.0 / log.dt), steps)
    distance = np.sqrt(((observed.measured[:, :short] - trajectories.outputs[:, :short, :3]) ** 2).sum(axis=2))
    outcome = "flies" if whole.all() else "departs" if whole.any() else "does_not_fly"
    return {
        "outcome": outcome, "asked_s": asked, "survival_s": survived.tolist(), "share": float(survived.mean() / asked),
        "path_error_5s_m": float(np.sqrt((distance[alive > short] ** 2).mean())) if (alive > short).any() else None,
        "starts_s": log.time[observed.segments.first].tolist(),
    }  # fmt: skip


def _prepared(
    declaration: KiteDeclaration, law: Commands, log: FlightLog, wind_direction: float, steps: int,
    within: tuple[Range, ...] | None, disturbed: bool = False,
) -> tuple[Simulator, Observed]:  # fmt: skip
    """The compiled loop, and segments of `steps` samples from STARTS states of the log."""
    kite = Kite(with_setpoint_dynamics(declaration, law), log.recorded_wind.height)
    simulator = Simulator(kite, (), law=loop(law, kite, wind_direction, disturbed))
    may = log.valid.copy()
    if within is not None:
        may[:] = False
        for first, last in within:
            may[first:last] = log.valid[first:last]
    may[len(log) - steps - 1 :] = False
    may[0] |= not may.any()
    rows = np.flatnonzero(may)
    first = rows[np.unique(np.linspace(0, rows.size - 1, STARTS).astype(int))]
    return simulator, observe(log, kite, first, steps, ("p_n", "p_e", "p_d"))


def _circles(law: Commands, log: FlightLog) -> bool:
    """Whether the log itself keeps to the law's circle: a figure of eight or a single cycle has none to leave."""
    pattern = getattr(law, "pattern", None)
    if pattern is None:
        return False
    away = arc({name: log[name][log.valid] for name in ("p_n", "p_e", "p_d")}, pattern) / pattern.radius
    return bool(np.quantile(np.abs(away - 1.0), 0.95) < 0.5)


def samples_flown(trajectories: Trajectories, pattern: Pattern | None = None) -> np.ndarray:
    """(K,) samples until a trajectory diverged, crashed, stalled, or left its circle (where a pattern is given)."""
    bad = (trajectories["p_d"] > -LOWEST) | (trajectories["V_a"] < STALLED)
    if pattern is not None:
        z = {name: trajectories.states[:, :, i] for i, name in enumerate(STATES[:3])}
        bad |= ~(arc(z, pattern) < FARTHEST * pattern.radius)
    first_bad = np.where(bad.any(axis=1), bad.argmax(axis=1), trajectories.states.shape[1])
    return np.minimum(trajectories.alive, first_bad)


def loop_gain(declaration: KiteDeclaration, law: Law, log: FlightLog, wind_direction: float, seconds: float = 20.0, seed: int = 0) -> dict:
    """surface -> how far the closed loop moves the law's standardised features per rad of disturbance at that surface, or None.

    The largest ratio sup_t |x(t) - x_0(t)| / sup_t |d(t)| over STARTS flights of `seconds`, d random steps of STEP held for HELD seconds:
    a lower bound of the gain, as anything found by trying is. None where no undisturbed flight lasts so long.
    """
    steps = int(min(seconds / log.dt, len(log) - 2))
    simulator, observed = _prepared(declaration, law, log, wind_direction, steps, None, disturbed=True)
    segments, random = observed.segments, np.random.default_rng(seed)
    calm = simulator.rollout(replace(segments, setpoints=_others(segments.setpoints, law, {})))
    lasted = samples_flown(calm) > steps

    def seen(trajectories: Trajectories, k: int | np.intp) -> np.ndarray:
        z = {name: trajectories.states[k, :, i] for i, name in enumerate(STATES)}
        names = simulator.kite.input_names
        line = {n: segments.inputs[k, :, names.index(n)] for n in ("tether_length", "reel_out_speed") if n in names}
        return standardised_features(law, z | line | {"wind_direction": wind_direction})

    gains: dict[str, float | None] = {}
    for surface in law.surfaces:
        held = max(1, int(HELD / log.dt))
        signs = random.choice((-STEP, STEP), size=(len(segments), steps // held + 1))
        moved = simulator.rollout(replace(segments, setpoints=_others(segments.setpoints, law, {surface: np.repeat(signs, held, axis=1)})))
        both = np.flatnonzero(lasted & (samples_flown(moved) > steps))
        apart = [np.linalg.norm(seen(moved, k) - seen(calm, k), axis=1).max() / STEP for k in both]
        gains[surface] = float(max(apart)) if apart else None
    return gains


@dataclass(frozen=True)
class Amplified:
    """A law whose answer is `factor` times as strong about a trim, surface -> [rad]: what a loop with another gain would command."""

    law: Law
    factor: float
    trim: Mapping[str, float]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.law, name)

    def deflections(self, z: Mapping) -> dict:
        driven = self.law.deflections(z)
        return driven | {s: clamp(t + self.factor * (driven[s] - t), *self.law.limits[s]) for s, t in self.trim.items()}


def gain_margin(declaration: KiteDeclaration, law: Law, log: FlightLog, wind_direction: float, seconds: float = 20.0) -> dict:
    """{"lower", "upper"}: the least and the greatest of the tried factors on the law's gain, each with all between it and 1, with which it
    flies `seconds` from every start; None where it does not even fly as it is. The answer about the mean flown set-point is amplified."""
    trim = {s: float(log.inputs[s][log.valid].mean()) for s in law.surfaces}

    def stays(factor: float) -> bool:
        return flies(declaration, Amplified(law, factor, trim), log, wind_direction, seconds)["outcome"] == "flies"

    if not stays(1.0):
        return {"lower": None, "upper": None}
    reached = {which: max(takewhile(stays, factors), key=lambda f: abs(np.log(f)), default=1.0) for which, factors in MARGINS.items()}
    return {which: float(f) for which, f in reached.items()}


def _others(setpoints: np.ndarray, law: Law, disturbances: dict) -> np.ndarray:
    """(K, N+1, 5) recorded set-points, with disturbances (K, >= N+1) in the place of the surfaces that the law drives."""
    result = setpoints.copy()
    for i, surface in enumerate(SURFACES):
        if surface in law.surfaces or surface in law.constants:
            result[:, :, i] = disturbances[surface][:, : result.shape[1]] if surface in disturbances else 0.0
    return result
