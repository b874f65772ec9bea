"""Winds for synthetic flights: the air as it is, and the record that a weather station makes of it."""

import numpy as np

from awescli.flightlog.log import WindRecord


def wind_record(
    height: np.ndarray, speed: np.ndarray, direction: float, duration: float, *, density: float = 1.225, drift: float = 0.0,
    turn: float = 0.0, seed: int = 0, every: float = 60.0, lead: float = 60.0,
) -> WindRecord:  # fmt: skip
    """A wind over `height` (H,) m with profile `speed` (H,) m/s, coming from `direction` [rad], for `duration` seconds.

    Knots `every` seconds, from `lead` before the flight to beyond its end. drift: standard deviation of a factor on the speed [-],
    turn: of the direction [rad], knot by knot; both act on all heights together, as weather does.
    """
    random = np.random.default_rng(seed)
    height, speed = np.asarray(height, dtype=float), np.asarray(speed, dtype=float)
    time = np.arange(-lead, duration + every, every)
    factor = 1.0 + drift * random.standard_normal(len(time))
    towards = direction + turn * random.standard_normal(len(time))
    shape = (len(time), len(height))
    return WindRecord(
        time, height, factor[:, None] * speed, np.repeat(towards[:, None], shape[1], axis=1), np.zeros(shape), np.full(len(time), density)
    )


def as_measured(wind: WindRecord, seed: int, speed_error: float = 0.05, direction_error: float = 0.005) -> WindRecord:
    """The record that a station makes of a wind: white errors [m/s], [rad] per entry (the jitter of the development flights' records)."""
    random = np.random.default_rng(seed)
    speed = wind.speed + speed_error * random.standard_normal(wind.speed.shape)
    direction = wind.direction + direction_error * random.standard_normal(wind.direction.shape)
    return WindRecord(wind.time, wind.height, np.maximum(speed, 0.0), direction, wind.down, wind.density)
