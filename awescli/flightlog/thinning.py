"""Fast logs -> the rate that a kite's motion asks for, so that neither time nor verdict depends on the logger."""

from dataclasses import replace

import numpy as np

from awescli.flightlog.clocks import moving_average
from awescli.flightlog.log import FlightLog
from awescli.notation.angles import wrap
from awescli.notation.quantities import ANGLES, SURFACES

ENOUGH = 50.0
"""[Hz] The short-period and roll motion of a kite of some metres is below 5 Hz; ten samples of the fastest motion show all of it."""

SLOWER = 0.75
"""Share of new values up to which a sensor is slower than the log; of a log with missing rows more are new."""


def thinned(log: FlightLog) -> FlightLog:
    """Every k-th sample of a log of 2 `ENOUGH` or more, at `ENOUGH` at least: sensors as the mean of the samples around (an odd number,
    at most k: centred, and none in two means), set-points as they stood then. A sample is valid where all around it are."""
    k = int(1 / (log.dt * ENOUGH) + 1e-6)
    if k < 2:
        return log
    width = k - 1 + k % 2

    def mean(name: str, signal: np.ndarray) -> np.ndarray:
        if name in SURFACES:
            return signal[::k].copy()
        if name in ANGLES:
            return wrap(moving_average(np.unwrap(signal), width)[::k])
        return moving_average(signal, width)[::k]

    def any_around(mask: np.ndarray) -> np.ndarray:
        return moving_average(mask.astype(float), k)[::k] > 0.5 / k

    # a sensor slower than the log is on the line between its values already: their mean would only cut its corners
    slow = {n for n, new in log.fresh.items() if new[log.valid].mean() < SLOWER}
    measured = {n: (s[::k].copy() if n in slow else mean(n, s)) for n, s in log.measured.items()}
    how = f"each value the mean of {width} samples, " if width > 1 else ""
    return replace(
        log, dt=k * log.dt, time=log.time[::k].copy(), measured=measured, inputs={n: mean(n, s) for n, s in log.inputs.items()},
        valid=~any_around(~log.valid), fresh={n: any_around(new) for n, new in log.fresh.items()},
        causes={cause: -(-bounds // k) for cause, bounds in log.causes.items()},
        notes=(*log.notes, f"Logged at {1 / log.dt:.4g} Hz, used at {1 / (k * log.dt):.4g} Hz: {how}set-points as they stood."),
    )  # fmt: skip
