"""How late one clock group is against another, seen in a motion that both record: the range and the winch."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import correlate, correlation_lags

from awescli.flightlog.log import FlightLog

MAX_LAG = 10.0
"""s searched both ways: a larger offset between clocks of one flight is not a lag but another flight."""

CLEAR = 0.9
"""Correlation at the best lag from which two signals are taken to be the same motion."""

GAIN = 0.02
"""By so much the best lag must correlate better than no lag at all."""

MIN_SWING = 0.2
"""m/s standard deviation of the reeling speed: below, there is nothing to align."""

MOTOR = 1.5
"""s in which a motor and its propeller have long followed the throttle."""

WIDTH = 1.0
"""s of the moving average over both: line dynamics and winch control are faster and differ between the two ends."""


@dataclass(frozen=True)
class ClockOffset:
    """late: s by which the second signal comes late; correlation: at that lag, and without (`unshifted`); clear: believable."""

    late: float
    correlation: float
    unshifted: float
    clear: bool


def clock_offset(first: np.ndarray, second: np.ndarray, dt: float, max_lag: float = MAX_LAG) -> ClockOffset | None:
    """How late `second` records what `first` records, both (N,) at `dt` [s]; None where neither moves or both are too short."""
    lags = int(min(max_lag / dt, first.size // 4))
    if first.size < 100 or lags < 2:
        return None
    width = max(1, int(round(WIDTH / dt)))
    a, b = (moving_average(x, width) for x in (first, second))
    if min(a.std(), b.std()) < MIN_SWING:
        return None
    k = correlation_lags(b.size, a.size)
    near = np.abs(k) <= lags
    k = k[near]
    products = correlate(b - b.mean(), a - a.mean(), method="fft")[near]
    # normalise by the overlap of each lag, or a short overlap would look uncorrelated
    score = np.array([products[i] / _overlap_norm(a - a.mean(), b - b.mean(), lag) for i, lag in enumerate(k)])
    best, zero = int(np.argmax(score)), int(np.flatnonzero(k == 0)[0])
    lag = float(k[best])
    if 0 < best < k.size - 1:
        left, top, right = score[best - 1 : best + 2]
        if (bend := left - 2 * top + right) < 0:
            lag += 0.5 * (left - right) / bend
    clear = bool(score[best] >= CLEAR and score[best] - score[zero] >= GAIN and 0 < best < k.size - 1)
    return ClockOffset(lag * dt, float(score[best]), float(score[zero]), clear)


def motor_lateness(log: FlightLog) -> float | None:
    """[s] by which motor_speed follows the throttle, where that is clear and more than a motor takes (`MOTOR`); None otherwise.

    log: a FlightLog with both.
    """
    both = [log[name] for name in ("throttle", "motor_speed")] if "throttle" in log and "motor_speed" in log else []
    if not both or min(x.std() for x in both) == 0:
        return None
    throttle, speed = ((x - x.mean()) / x.std() for x in both)
    seen = clock_offset(throttle, speed, log.dt)
    return seen.late if seen is not None and seen.clear and abs(seen.late) > MOTOR else None


def moving_average(x: np.ndarray, width: int) -> np.ndarray:
    """Centred mean over `width` samples, (N,); at the ends over what there is.

    Each window is added up from its own samples (the end of a block of `width` and the beginning of the next, van Herk 1992): differences
    of one running sum would carry the rounding of a huge sample through all that comes after it.
    """
    n, i = x.size, np.arange(x.size)
    low, last = np.maximum(i - (width - 1) // 2, 0), np.minimum(i + width // 2, n - 1)
    blocks = np.zeros((-(-n // width), width))
    blocks.reshape(-1)[:n] = x
    begins = np.cumsum(blocks, axis=1).reshape(-1)  # from the beginning of a block on
    ends = np.cumsum(blocks[:, ::-1], axis=1)[:, ::-1].reshape(-1)  # up to its end; behind x there are zeros
    within = np.where(low % width == 0, begins[last], ends[low])
    total = np.where(low // width == last // width, within, ends[low] + begins[last])
    return total / (last - low + 1)


def _overlap_norm(a: np.ndarray, b: np.ndarray, lag: int) -> float:
    first, second = (a[: a.size - lag], b[lag:]) if lag >= 0 else (a[-lag:], b[:lag])
    return float(np.sqrt((first**2).sum() * (second**2).sum())) or 1.0
