"""Copies of a measured flight in which nothing new may be found: cut, resampled, noisier."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from awescli.flightlog.log import FlightLog
from awescli.notation.angles import wrap
from awescli.notation.quantities import ANGLES
from awescli.physics.declaration import KiteDeclaration
from awescli.simulation.segments import noise_std


def cut(first: float, last: float, log: FlightLog, kite: KiteDeclaration) -> FlightLog:
    """The flight from one share of its time to another."""
    return log.between(int(first * len(log)), int(last * len(log)))


def every(k: int, phase: int, log: FlightLog, kite: KiteDeclaration) -> FlightLog:
    """Every k-th sample, as a slower logger would have it; an interval with an invalid sample is not valid."""
    take = slice(phase, None, k)
    whole = np.convolve(~log.valid, np.ones(2 * k - 1), "same")[take] < 0.5
    signals = ({n: s[take].copy() for n, s in table.items()} for table in (log.measured, log.inputs))
    measured, inputs = signals
    fresh = {n: np.convolve(new, np.ones(k), "full")[: len(new)][take] > 0.5 for n, new in log.fresh.items()}
    bounds = {cause: np.maximum((b - phase + k - 1) // k, 0) for cause, b in log.causes.items()}
    return replace(
        log, dt=k * log.dt, time=log.time[take].copy(), measured=measured, inputs=inputs, valid=whole & log.valid[take], fresh=fresh,
        causes=bounds,
    )  # fmt: skip


def noisier(share: float, seed: int, log: FlightLog, kite: KiteDeclaration) -> FlightLog:
    """With white noise of `share` of what the kite file declares on every sensor."""
    random = np.random.default_rng(seed)
    measured = {}
    for name, signal in log.measured.items():
        noisy = signal + share * noise_std(kite.noise, name, signal) * random.standard_normal(len(log))
        measured[name] = wrap(noisy) if name in ANGLES else noisy
    return replace(log, measured=measured)


COPIES: dict[str, Callable[[FlightLog, KiteDeclaration], FlightLog]] = {
    "first 70 %": partial(cut, 0.0, 0.7),
    "middle 70 %": partial(cut, 0.15, 0.85),
    "last 70 %": partial(cut, 0.3, 1.0),
    "first 85 %": partial(cut, 0.0, 0.85),
    "every second": partial(every, 2, 0),
    "every second, odd": partial(every, 2, 1),
    "every third": partial(every, 3, 0),
    "half the noise": partial(noisier, 0.5, 1),
    "half the noise, again": partial(noisier, 0.5, 2),
    "as much noise": partial(noisier, 1.0, 3),
    "as much noise, again": partial(noisier, 1.0, 4),
}
"""Name -> how the copy is made."""
