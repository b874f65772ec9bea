"""Pumping cycles: from where the line begins to be paid out in traction to where it begins again, with a retraction between."""

import numpy as np

from awescli.flightlog.log import runs_of


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
