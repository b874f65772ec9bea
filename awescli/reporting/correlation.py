"""Which parameters the flight cannot tell apart: correlations of the final fit, as squares whose size is the correlation."""

import numpy as np

from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Body
from awescli.reporting.plots import Figure, axis, dots, hover
from awescli.reporting.words import number

STEPS = ((0.3, 0.6, 5), (0.6, 0.8, 8), (0.8, 0.95, 11), (0.95, 1.0, 14))
"""From, to, size of the square [pixels]: what is less is not drawn."""


def correlation(evidence: Evidence) -> Body:
    """Of the last model that was fitted; empty where the fit left no matrix, or nothing is correlated."""
    params = evidence.traced_params if evidence.tracing_added and evidence.traced_params is not None else evidence.params
    params = params or {}
    found = params.get("correlation") or {}
    names = [n for n in found.get("names", ()) if n in params["parameters"]]
    if len(names) < 2:
        return ""
    at = [found["names"].index(n) for n in names]
    matrix = np.asarray(found["matrix"], dtype=float)[np.ix_(at, at)]
    rows, columns = np.tril_indices(len(names), -1)
    values = matrix[rows, columns]
    data = []
    for low, high, size in STEPS:
        for sign, colour, word in ((1, "@blue", "together"), (-1, "@red", "against each other")):
            here = np.flatnonzero((sign * values >= low) & (sign * values < high + (high == 1.0)))
            if here.size:
                x, y = ([names[i] for i in way[here]] for way in (columns, rows))
                said = [number(v) for v in values[here]]
                data.append(dots(x, y, f"{word}, {low:g} to {high:g}", colour, size=size, symbol="square", text=said,
                                 hovertemplate=hover("%{x}, %{y}: %{text}")))  # fmt: skip
    if not data:
        return ""
    one = {"type": "category", "categoryorder": "array", "categoryarray": names, "dtick": 1}
    note = "Two parameters with a correlation near 1 are known only together: raising one and the other hardly changes what is simulated."
    layout = {"xaxis": axis("parameter", **one, tickangle=-90), "yaxis": axis("parameter", **one, autorange="reversed")}
    return Figure(
        "fig-correlation", "Correlation of the parameters", data, layout,
        split="fitted to train", note=note, height=130 + 17 * len(names),
    )  # fmt: skip
