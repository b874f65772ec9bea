"""Does a control law fly? Closed loop on a declared kite, from several states of a log, until it departs or the time is over."""

import numpy as np

from awescli.physics.declaration import KiteDeclaration
from awescli.physics.kite import Kite
from awescli.simulation.closed_loop import loop
from awescli.simulation.rollout import Simulator, Trajectories
from awescli.simulation.segments import observe

LOWEST = 5.0
"""[m] a kite below this height has crashed."""
STALLED = 6.0
"""[m/s] an airspeed below this is no flight any more."""
STARTS = 8
"""From so many states, spread over the log."""


def flies(declaration: KiteDeclaration, law, log, wind_direction: float, seconds: float) -> dict:
    """Survival time from several states of the log, path error against the log, and a named outcome.

    outcome: "flies" (the whole time from every state), "departs" (from some), "does_not_fly" (from none).
    """
    heights = log.wind.height if log.wind is not None else (10.0,)
    kite = Kite(declaration, heights)
    simulator = Simulator(kite, (), law=loop(law, kite, wind_direction))
    steps = int(min(seconds / log.dt, len(log) - 2))
    first = np.unique(np.linspace(0, len(log) - steps - 2, STARTS).astype(int))
    first = first[log.valid[first]]
    observed = observe(log, kite, first, steps, ("p_n", "p_e", "p_d"))
    trajectories = simulator.rollout(observed.segments)
    alive = samples_flown(trajectories)
    survived = (alive - 1) * log.dt
    asked = steps * log.dt
    whole = alive > steps
    short = min(int(5.0 / log.dt), steps)
    distance = np.sqrt(((observed.measured[:, :short] - trajectories.outputs[:, :short, :3]) ** 2).sum(axis=2))
    outcome = "flies" if whole.all() else "departs" if whole.any() else "does_not_fly"
    return {
        "outcome": outcome, "asked_s": asked, "survival_s": survived.tolist(), "share": float(survived.mean() / asked),
        "path_error_5s_m": float(np.sqrt((distance[alive > short] ** 2).mean())) if (alive > short).any() else None,
        "starts_s": log.time[first].tolist(),
    }  # fmt: skip


def samples_flown(trajectories: Trajectories) -> np.ndarray:
    """(K,) samples until a trajectory diverged, crashed or stalled."""
    bad = (trajectories["p_d"] > -LOWEST) | (trajectories["V_a"] < STALLED)
    first_bad = np.where(bad.any(axis=1), bad.argmax(axis=1), trajectories.states.shape[1])
    return np.minimum(trajectories.alive, first_bad)
