"""How gusty the flight was, from the pitot against the declared wind: independent of the kite's model and of what it may lack."""

import numpy as np

from awescli.notation.frames import rotation_body_to_ned
from awescli.physics.airflow import air_data, declared_wind, wind_vector
from awescli.physics.kite import Kite
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
    variance = float(rest @ rest) / max(len(e) - A.shape[1], 1)
    noise = kite.declaration.noise.airspeed**2 / size
    # one standard error of a variance estimate: below it the air is calm as far as this pitot can tell
    return float(np.sqrt(max(variance - noise * (1 + 3 * np.sqrt(2 / len(e))), 0.0)))


def within_window(level: float, window: float, memory: float) -> float:
    """Standard deviation of what a gust of standard deviation `level` does between two nodes, about the line through them [m/s].

    For the correlation exp(-t/memory) of Dryden's longitudinal gust and window << memory: level sqrt(window / (3 memory)), the mean
    variance of a Brownian bridge.
    """
    return level * float(np.sqrt(min(window / (3 * memory), 1.0)))
