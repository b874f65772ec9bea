"""Slow sensors in the rows of a fast log: each value stands there until the next one comes, and only its first row is a measurement."""

from collections.abc import Mapping

import numpy as np

EVEN = 0.9
"""Share of the values that must stand as long as most do, to a row: a coarse reading of fast rows stands as long as chance has it."""

OFTEN = 0.3
"""Share of the values that stand in two rows or more, from which a sensor is slower than its rows: 0.02 of a coarse airspeed's do."""

TOGETHER = 0.95
"""Share of their new values that two channels have in the same rows, if one sensor gave both: chance has it only where all rows are new."""

COUNTED = ("tether_length",)
"""What an encoder counts: at a steady speed it changes evenly, by one step, and each value is a coarse reading and no slow one."""

ONE_STEP = 0.9
"""Share of the changes of one size, from which they are an encoder's steps."""

EQUAL = 0.4
"""Share of samples equal to the one before from which values stand, evenly or not: noise hardly ever repeats."""


def stands(signal: np.ndarray) -> bool:
    """Does a signal (N,), already on a uniform clock, stand for several samples at a time, so that each value is late by chance?"""
    return bool((np.diff(signal) == 0).mean() > EQUAL and np.ptp(signal) > 0)


def first_rows(stamps: np.ndarray, columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Column -> (N,) stamps [s] of the rows in which its sensor gave a new value, NaN in all others; only columns that hold their values:
    most of them for two rows or more, or some of them if another column changes in the same rows (6.7 Hz in rows of 10 Hz).

    stamps: (N,) rising; columns: name -> (N,). When the first value came is not known, nor one behind missing rows: both are left out.
    """
    step = np.diff(stamps)
    beside = step < 1.5 * np.median(step)
    changes = {}
    for name, column in columns.items():
        changed = np.isfinite(column[1:]) & np.isfinite(column[:-1]) & beside & (column[1:] != column[:-1])
        stood = np.diff(np.flatnonzero(changed))
        if name in COUNTED and stood.size and _steps(np.diff(column)[changed]):
            continue
        if stood.size >= 2 and (stood >= 2).mean() >= OFTEN and (np.abs(stood - np.median(stood)) <= 1).mean() >= EVEN:
            changes[name] = changed
    found = {}
    for name, changed in changes.items():
        others = [other for n, other in changes.items() if n != name]
        if np.median(np.diff(np.flatnonzero(changed))) >= 2 or any(_together(changed, other) for other in others):
            found[name] = np.where(np.r_[False, changed], stamps, np.nan)
    return found


def _steps(changes: np.ndarray) -> bool:
    """Are changes an encoder's, all of one size?"""
    size = np.abs(changes)
    return bool(np.isclose(size, np.median(size), rtol=1e-3).mean() >= ONE_STEP)


def _together(first: np.ndarray, second: np.ndarray) -> bool:
    return bool((first & second).sum() >= TOGETHER * max(first.sum(), second.sum()))
