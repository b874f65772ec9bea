"""The recorded wind at the kite, for checking sensors against each other; a model has its own (physics)."""

import numpy as np

from awescli.flightlog.log import WindRecord

SHEAR = 1 / 7
"""Exponent of the power law above a single station, the textbook value over open land."""


def wind_ned(wind: WindRecord, time: np.ndarray, height: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, e, d), each (N,) m/s, at `time` [s] and `height` [m above the winch]; linear in both, held beyond the record."""
    at_time = [
        np.stack([np.interp(time, wind.time, table[:, k]) for k in range(wind.height.size)], axis=1)
        for table in (wind.speed, wind.direction, wind.down)
    ]
    if wind.height.size == 1:
        speed, direction, down = (table[:, 0] for table in at_time)
        speed = speed * (np.maximum(height, 1.0) / wind.height[0]) ** SHEAR
    else:
        above = np.clip(np.searchsorted(wind.height, height), 1, wind.height.size - 1)
        part = np.clip((height - wind.height[above - 1]) / (wind.height[above] - wind.height[above - 1]), 0.0, 1.0)
        i = np.arange(time.size)
        speed, direction, down = (table[i, above - 1] * (1 - part) + table[i, above] * part for table in at_time)
    return -speed * np.cos(direction), -speed * np.sin(direction), down
