"""How long a step may be, and how set-points run within it: both follow from the model, not from the interval at which a log was written.

A step h of the classical Runge-Kutta method follows a pole lambda with a relative error of |lambda h|^5 / 120 (the first term of
exp(lambda h) that it lacks), and is stable up to |lambda h| = 2.78 on the real axis (Hairer & Wanner, Solving ODEs II, ch. IV.2).
"""

from dataclasses import dataclass

import numpy as np

from awescli.physics.effects.lag import LONGEST_STEP
from awescli.physics.flight_model import FlightModel

ACCURACY = 0.15
"""Relative error with which one step follows the fastest pole. That pole forgets it within a few steps; poles of a third of its frequency,
which a flight shows, are followed 250 times better."""
MOST = 50
"""LONGEST_STEP is divided into so many at most: a faster pole is no kite's but a mistake in its declaration, and shows as divergence."""
PROBES = 32
"""At so many starts, at most, the poles are looked at."""


@dataclass(frozen=True)
class Stepping:
    """The steps between two samples. substeps: how many; in step i = 0, 1, ... the set-points stand at share `first` + i `onward` of the
    way from this sample to the next."""

    substeps: int
    first: float = 0.0
    onward: float = 0.0

    @classmethod
    def between(cls, dt: float, longest: float, rate: float) -> "Stepping":
        """Steps of at most `longest` [s] between samples `dt` [s] apart; rate: [Hz] at which the flight controller sets its surfaces, and
        holds them.

        A log that is as fast holds every set-point, until its next row. In a slower one the surfaces went on moving between rows: on
        average along the line from row to row, half a period of the controller late. Held over a step, they are half a step late by
        themselves. (A rudder that is 10 ms off costs a metre in 5 s.)
        """
        substeps = max(1, int(np.ceil(dt / longest - 1e-9)))
        if rate * dt <= 1.001:
            return cls(substeps)
        step = dt / substeps
        return cls(substeps, (step - 1.0 / rate) / 2 / dt, step / dt)


def longest_step(kite: FlightModel, starts: np.ndarray, setpoints: np.ndarray, inputs: np.ndarray) -> float:
    """[s] LONGEST_STEP, divided as often as the fastest pole of the kite at its parameters' values asks for.

    starts (K, 12), setpoints (K, 5), inputs (K, n_u): where the poles are looked at. Those of the Euler angles are left out: near
    theta = 90 deg they are of the angles, not of the kite.
    """
    reach = (120 * ACCURACY) ** 0.2
    poles = fastest_poles(kite, *(a[:: max(1, len(starts) // PROBES)] for a in (starts, setpoints, inputs)))
    fastest = float(np.median(poles[np.isfinite(poles)])) if np.isfinite(poles).any() else 0.0
    return LONGEST_STEP / min(max(1, int(np.ceil(LONGEST_STEP * fastest / reach - 1e-9))), MOST)


def fastest_poles(kite: FlightModel, starts: np.ndarray, setpoints: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """(K,) largest |eigenvalue| [1/s] of d(dx/dt)/dx at some states, Euler angles held; by differences of 1e-6 of each state's size."""
    c, u = [float(v) for v in kite.parameters.vector()], list(inputs.T)
    n = len(kite.state_names)
    x = [*starts.T, *(np.zeros(len(starts)) for _ in range(n - 12)), *setpoints.T]
    x[12:n] = [np.broadcast_to(s, len(starts)) for s in kite.initial(x, u, c)]
    moving = [i for i, name in enumerate(kite.state_names) if name not in ("phi", "theta", "psi")]
    K, m = len(starts), len(moving)
    # every state ahead, then every state behind, in one call of the kite
    moved = np.repeat(np.stack(x)[:, None], 2 * m, axis=1)
    size = 1e-6 * np.maximum(np.abs(moved[moving, 0]), 1.0)
    with np.errstate(all="ignore"):
        moved[moving, np.arange(m)] += size
        moved[moving, m + np.arange(m)] -= size
        rates = kite.derivative([v.reshape(-1) for v in moved], [np.tile(v, 2 * m) for v in u], c)
        rates = [np.broadcast_to(np.asarray(rates[i], dtype=float), 2 * m * K) for i in moving]
        ahead, behind = np.stack(rates, axis=1).reshape(2, m, K, m)
        A = ((ahead - behind) / (2 * size[..., None])).transpose(1, 2, 0)
        found = np.full(len(A), np.nan)
        good = np.isfinite(A).all(axis=(1, 2))
        found[good] = np.abs(np.linalg.eigvals(A[good])).max(axis=1)
    return found
