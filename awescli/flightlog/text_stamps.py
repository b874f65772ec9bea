"""Clocks that are written as text: ISO 8601 dates and times, or times of day."""

from datetime import UTC, datetime, time
from pathlib import Path

import numpy as np

from awescli.flightlog.table import GARBAGE_SHARE, read_text
from awescli.notation.errors import BadInput

ISO = "iso"
"""What stands for a unit where stamps are text."""


def read_stamps(path: Path, name: str) -> np.ndarray:
    """(N,) s: unix time of dates with times (UTC where no zone is named), seconds since midnight of times of day; NaN where a cell is empty
    or cannot be read. Raises BadInput where too many are neither."""
    cells = read_text(path, name)
    stamps = np.array([_seconds(cell) for cell in cells], dtype=float)
    unreadable = ~np.isfinite(stamps) & np.array([bool(cell.strip()) for cell in cells])
    if unreadable.mean() > GARBAGE_SHARE:
        at = int(np.argmax(unreadable))
        what = f"'{cells[at][:40]}' is no date and time"
        raise BadInput(what, f"{path}:{at + 2}: column {name}", "Expected 2022-04-15T05:20:00.040 or 05:20:00.040.")
    return stamps


def _seconds(cell: str) -> float:
    """One stamp; NaN where it is none."""
    text = cell.strip().strip('"')
    try:
        moment = datetime.fromisoformat(text)
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError):
        pass
    try:
        t = time.fromisoformat(text)
    except ValueError:
        return np.nan
    return 3600.0 * t.hour + 60.0 * t.minute + t.second + 1e-6 * t.microsecond
