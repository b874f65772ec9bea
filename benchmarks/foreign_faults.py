"""What recorders lose and sensors make up: rows that are missing, sensors that are silent for a while, single values that are far off.

    columns = with_faults(columns, sensors, rate, seed)      # column -> values, NaN where a cell is empty, fewer rows
"""

from collections.abc import Mapping, Sequence

import numpy as np

GAPS, GAP = 2, (0.1, 0.6)
"""Stretches [s] without a row."""
SILENCES, SILENCE = 3, (0.3, 1.5)
"""Stretches [s] in which one sensor has no value."""
OUTLIERS = 1e-3
"""Share of a sensor's values that are far off."""
FAR = (10.0, 1000.0)
"""By how much: times the median step from one value to the next, evenly in the logarithm."""


def with_faults(columns: Mapping[str, np.ndarray], sensors: Sequence[str], rate: float, seed: int) -> dict[str, np.ndarray]:
    """columns: name -> (N,); sensors: those that a sensor fills; rate: of the rows [Hz]."""
    random = np.random.default_rng([seed, 5])
    found = {name: values.astype(float) if name in sensors else values for name, values in columns.items()}
    rows = len(next(iter(columns.values())))
    for name in sensors:
        where = random.random(rows) < OUTLIERS
        far = np.exp(random.uniform(*np.log(FAR), where.sum())) * random.choice((-1.0, 1.0), where.sum())
        found[name][where] += far * np.median(np.abs(np.diff(columns[name])))
    for name in random.choice(sensors, SILENCES, replace=False):
        found[name][_stretch(random, rows, rate, SILENCE)] = np.nan
    kept = np.ones(rows, bool)
    for _ in range(GAPS):
        kept[_stretch(random, rows, rate, GAP)] = False
    return {name: values[kept] for name, values in found.items()}


def _stretch(random: np.random.Generator, rows: int, rate: float, seconds: tuple[float, float]) -> slice:
    length = max(1, round(random.uniform(*seconds) * rate))
    first = int(random.integers(rows - length))
    return slice(first, first + length)
