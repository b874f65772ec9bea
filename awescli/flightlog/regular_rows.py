"""Were rows taken at regular times and stamped when they came, or when their stamps say? Quick motion tells."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from awescli.notation.quantities import ANGLES

WINDOW = 101
"""Rows over which the clock of the rows is followed: two seconds at 50 Hz, in which no clock drifts."""

APART = 5.0
"""Standard deviations by which the share that motion shows must stay below a half: rows are taken as stamped unless that is clear."""

INTERPOLATION = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / 6.0
"""What a row differs from the cubic through its two neighbours on either side, as weights."""

ALONG = 1.5
"""Times what chance makes of the phase by which it may leave a straight line: a clock of a steady rate, if not quite the nominal one."""

PHASED = 0.3
"""Least concentration of the phases about their mean, 1 without any wobble: three times what chance makes of `WINDOW` of them."""

ALONE = 0.8
"""Share of the rows whose turn must be clear: with more that came late by half an interval nobody knows which row is which."""


@dataclass(frozen=True)
class RegularRows:
    """times: (N,) [s] at which rows were taken, regular but for a slow drift; alone: (N,) bool, rows that it is clear for; wobble: [s]
    standard deviation of their stamps about these; share: of that wobble which motion shows, 0 where rows are regular and 1 where stamps
    are true; error: of the share, one standard deviation."""

    times: np.ndarray
    alone: np.ndarray
    wobble: float
    share: float
    error: float

    @property
    def clear(self) -> bool:
        """Does motion show that the rows are regular?"""
        return self.share + APART * self.error < 0.5 and bool(self.alone.mean() >= ALONE)


def regular_rows(stamps: np.ndarray, dt: float, columns: Mapping[str, np.ndarray], least: float = 0.0) -> RegularRows | None:
    """What motion says of stamps that are not regular; None where they are, where no column moves, or where there are too few rows.

    stamps: (N,) rising [s]; dt: interval of the rows [s]; columns: name -> (N,), measured channels; least: [s] standard deviation up to
    which stamps are regular. If stamps are true, a channel x misses what its neighbours let expect by dx/dt (stamp - regular time); that
    product's coefficient, over all channels, is the share.
    """
    if stamps.size < 2 * WINDOW:
        return None
    times, alone = _clock(stamps, dt)
    off = stamps - times
    wobble = float(off[alone].std()) if alone.any() else 0.0
    if wobble <= least:
        return None
    beside = (np.abs(np.diff(times) - dt) < dt / 2) & alone[1:] & alone[:-1]
    whole = beside[:-3] & beside[1:-2] & beside[2:-1] & beside[3:]
    products = squares = 0.0
    for name, column in columns.items():
        x = np.unwrap(np.nan_to_num(column)) if name in ANGLES else np.nan_to_num(column)
        slope = uniform_filter1d(np.gradient(x), 5) / dt
        seen, meant = (np.convolve(v, INTERPOLATION, "valid") for v in (x, slope * off))
        there = whole & (np.convolve(np.isfinite(column), np.ones(5), "valid") > 4.5)
        variance = float(np.var(seen[there])) if there.any() else 0.0
        if variance > 0:
            products += float(meant[there] @ seen[there]) / variance
            squares += float(meant[there] @ meant[there]) / variance
    return RegularRows(times, alone, wobble, products / squares, squares**-0.5) if squares > 0 else None


def _clock(stamps: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """(N,) [s] the regular clock that rows were taken by, from the circular mean of their phases, which no missing row disturbs, along a
    line where it goes along one; (N,) bool, rows whose turn is clear: of two that seem to have come in the same one it is not, unless the
    one beside it is free."""
    turns = (stamps - stamps[0]) / dt
    phasor = np.exp(2j * np.pi * turns)
    real, imaginary, seen = (uniform_filter1d(x, WINDOW, mode="constant") for x in (phasor.real, phasor.imag, np.ones(turns.size)))
    phase, concentration = np.unwrap(np.arctan2(imaginary, real)) / (2 * np.pi), np.hypot(real, imaginary) / seen
    line = np.polynomial.Polynomial.fit(turns, phase, 1)(turns)
    if (phase - line).std() < ALONG * (turns - line - np.rint(turns - line)).std() / np.sqrt(WINDOW):
        phase = line
    turn = np.rint(turns - phase)
    alone = np.diff(turn, prepend=-np.inf, append=np.inf) > 0
    clear, rows = np.flatnonzero(alone[1:] & alone[:-1]), np.arange(stamps.size)
    if not clear.size:
        return stamps, np.zeros(stamps.size, bool)
    # between two rows whose turn is clear each has its own, if they are as many as the turns
    as_many = np.diff(turn[clear]) == np.diff(clear)
    after = np.searchsorted(clear, rows, side="right")
    known = np.isin(rows, clear) | ((after > 0) & np.r_[False, as_many, False][np.minimum(after, as_many.size + 1)])
    return stamps[0] + dt * (np.where(known, np.interp(rows, clear, turn[clear]), turn) + phase), known & (concentration > PHASED)
