"""Blocks of rows that a log holds twice: noise never repeats, so a block that does was pasted."""

from collections.abc import Iterable

import numpy as np

LONGEST_ALIKE = 25
"""Rows in a row that are equal, in every signal, to as many earlier ones: no flight repeats its noise for half a second."""

FACTOR = np.uint64(0x9E3779B97F4A7C15)
"""Odd number of 64 bits that spreads (2^64 over the golden ratio; Knuth, TAOCP 3, 6.4)."""


def repeated_rows(signals: Iterable[np.ndarray]) -> np.ndarray:
    """(N,) bool: rows of a block that stands in the log before, equal in every one of the signals (each (N,), NaN equal to NaN).

    A sensor that stands still repeats the row before it, which is no block: rows equal to their neighbour do not count.
    """
    columns = list(signals)
    rows = columns[0].shape[0] if columns else 0
    repeated = np.zeros(rows, bool)
    if rows < 2 * LONGEST_ALIKE:
        return repeated
    # one number for a row: two different rows have the same once in 2^64
    row = np.zeros(rows, np.uint64)
    for column in columns:
        bits = (np.where(np.isnan(column), np.inf, column) + 0.0).view(np.uint64)
        row = (row * FACTOR) ^ (bits * FACTOR + (bits >> np.uint64(29)))
    _, first, group = np.unique(row, return_index=True, return_inverse=True)
    apart = np.arange(rows) - first[group]
    # the same distance to the first of its kind, row after row
    edges = np.flatnonzero(np.diff(apart) != 0) + 1
    for a, b in zip(np.r_[0, edges], np.r_[edges, rows], strict=True):
        if apart[a] >= LONGEST_ALIKE and b - a >= LONGEST_ALIKE:
            repeated[a:b] = True
    return repeated
