"""Is there enough of a flight: rows, loops, surfaces that move, and none of it twice?"""

import numpy as np

from awescli.flightlog.consistency import Check, least, most
from awescli.flightlog.log import FlightLog
from awescli.flightlog.loops import Loops
from awescli.notation.quantities import CONTROL_SURFACES

MISSING_ROWS = (10.0, 70.0)
"""Percent of the clock's ticks without a row: radio links lose some; of less than a third the fast motion is gone."""

REPEATED = (0.0, 10.0)
"""Percent of the rows that stand there twice: a block is a slip of the logger; more makes test loops the same as train loops."""

LOOPS = 6
"""Whole loops or blocks: below two for each part no error bar means much; below three there is no split, which stops of itself."""

MOVED = (np.rad2deg(2e-3), np.rad2deg(2e-4))
"""deg, standard deviation of the surface that moves most: below, the controller and what surfaces do cannot be seen."""


def enough_checks(log: FlightLog, airborne: np.ndarray, loops: Loops) -> list[Check]:
    """All of them. airborne: (N,) bool, the flown samples; loops: those that are fit for use."""
    ticks, rows = len(log), log.counters.get("rows", len(log))
    used = rows - sum(log.counters.get(name, 0) for name in ("unreadable", "stray", "repeated", "backward"))
    # a reader may cut the ground off: what was cut counts on both sides
    missing = 100 * max(0.0, 1 - used / max(ticks, 1))
    said = "Ticks of the clock without a row of their own; they are filled from their neighbours."
    checks = [most("missing rows", missing, "%", *MISSING_ROWS, said, "Use the whole log, or one that was thinned evenly.")]
    twice = 100 * log.counters.get("pasted_rows", 0) / max(rows, 1)
    said = "Rows in blocks that stand in the log twice, noise included: unseen loops would be loops that were fitted."
    checks.append(most("repeated blocks", twice, "%", *REPEATED, said, "Remove what was pasted twice."))
    said = f"Usable {loops.kind}; train, validation and test need one each, and the more of them the better they are known."
    checks.append(least("usable loops", len(loops), "", LOOPS, None, said, "Use a longer flight; see what was left out and why."))
    if there := [name for name in CONTROL_SURFACES if name in log]:
        where = airborne & log.valid
        moved = max(float(np.rad2deg(log[name][where].std())) for name in there) if where.any() else 0.0
        said = "Standard deviation of the surface that moves most: what never moves shows nothing of what it does."
        checks.append(least("moving surfaces", moved, "deg", *MOVED, said, "Is the column that of the set-point?"))
    return checks
