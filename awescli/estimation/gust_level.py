"""How gusty the flight was, from the pitot against the declared wind: independent of the kite's model and of what it may lack."""

import numpy as np
from scipy.linalg import matmul_toeplitz

from awescli.notation.frames import rotation_body_to_ned
from awescli.physics.airflow import air_data, declared_wind, wind_vector
from awescli.physics.kite import Kite
from awescli.simulation.gusts import LENGTH, longitudinal
from awescli.simulation.rollout import wind_inputs

WINDOW = 0.5
"""[s] over which the pitot's difference is averaged: gusts are slower, its noise is not."""


def gust_level(log, kite: Kite) -> float:
    """Standard deviation of the gusts along the flight path [m/s]; 0 where the log has no pitot or no wind.

    The difference V_a - |v - v_wind| is averaged over half a second and freed of everything that a constant wind error, a wrong
    shear or a wrong scale of the pitot would leave (regression on airspeed, height and direction of flight); what is left,
    less the pitot's own noise, is gust. A variance fitted with the model instead would swallow missing effects.
    """
    if "V_a" not in log or log.wind is None:
        return 0.0
    R = rotation_body_to_ned(log["phi"], log["theta"], log["psi"])
    v_ned = (log["v_n"], log["v_e"], log["v_d"])
    inputs = wind_inputs(log)
    wind = wind_vector(*declared_wind(kite.declaration.wind, kite.heights, -log["p_d"], inputs), inputs["density"])
    _, V_a, _, _ = air_data(R, v_ned, wind)
    size = max(1, int(round(WINDOW / log.dt)))
    count = len(log) // size
    if count < 30:
        return 0.0

    def blocks(signal):
        return signal[: count * size].reshape(count, size).mean(axis=1)

    good = blocks(log.valid.astype(float)) == 1
    direction = [blocks((v_ned[i] - wind[i]) / V_a) for i in range(3)]
    height = blocks(-log["p_d"])
    regressors = [np.ones(count), blocks(V_a), *direction, *(height * d for d in direction), *(blocks(V_a) * d for d in direction)]
    A = np.column_stack(regressors)[good]
    A = A / np.maximum(np.abs(A).max(axis=0), 1e-12)
    e = blocks(log["V_a"] - V_a)[good]
    rest = e - A @ np.linalg.lstsq(A, e, rcond=None)[0]
    noise = kite.declaration.noise.airspeed**2 / size
    # three standard errors of a variance estimate: below it the air is calm as far as this pitot can tell
    gust = float(rest @ rest) / max(len(e) - A.shape[1], 1) - noise * (1 + 3 * np.sqrt(2 / len(e)))
    return float(np.sqrt(max(gust, 0.0) * _kept(A, WINDOW * float(V_a.mean()) / LENGTH)))


def _kept(A: np.ndarray, step: float) -> float:
    """By how much more of a gust's variance than of white noise's the regression on A (n, m) has taken away; step: a block's length over
    the gusts' length scale. Gusts last: a regression of 9 columns takes a third of them away in 150 s of flight."""
    n, m = A.shape
    q, _ = np.linalg.qr(A)
    taken = float(np.sum(q * matmul_toeplitz(longitudinal(np.arange(n), step), q)))
    return (n - m) / max(n - taken, 0.1 * n)
