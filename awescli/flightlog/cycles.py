"""Pumping cycles: from where the line begins to be paid out in traction to where it begins again, with a retraction between."""

from typing import Literal

import numpy as np

from awescli.flightlog.log import FlightLog, runs_of
from awescli.flightlog.loops import Loops, find_loops, left_out_in_words
from awescli.flightlog.phases import phases
from awescli.flightlog.usable import usable
from awescli.notation.phases import WORKING

Whole = Literal["loops", "cycles"]
"""What is dealt whole to the parts of a split."""


def cycles(labels: np.ndarray) -> np.ndarray:
    """(K, 2) half-open sample ranges of cycles, in order: each begins with a traction and holds one retraction at least; the last one may
    end with the log. What comes before the first traction, or ends without a retraction, is no cycle.

    labels: (N,) names of phases (`phases.PHASES`).
    """
    pulls, pulled_in = runs_of(labels == "traction"), labels == "retraction"
    bounds, first = [], None
    for begin, _ in pulls.tolist():
        if first is None:
            first = begin
        elif pulled_in[first:begin].any():
            bounds.append((first, begin))
            first = begin
    if first is not None and pulled_in[first:].any():
        bounds.append((first, len(labels)))
    return np.array(bounds, dtype=int).reshape(-1, 2)


def pieces(log: FlightLog, of: Whole) -> Loops:
    """What is dealt to train, validation and test: loops of the traction (or blocks: `find_loops`), or whole pumping cycles with all their
    phases, each as far as it is in the air."""
    if of == "loops":
        return find_loops(log)
    labels = phases(log)
    down, bounds = ~np.isin(labels, WORKING), cycles(labels)
    bounds = [(a, a + int(np.argmax(down[a:b])) if down[a:b].any() else b) for a, b in bounds.tolist()]
    good, out = usable(log, np.array(bounds, dtype=int).reshape(-1, 2))
    seconds = (good[:, 1] - good[:, 0]) * log.dt
    sentence = f"{len(good)} pumping cycles" + (f" of {seconds.mean():.0f} s" if len(good) else "")
    return Loops("cycles", good, sentence + left_out_in_words(out), out)
