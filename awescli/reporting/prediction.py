"""Measured against simulated: the paths (Rositani (2025), figure 5), every channel over time, and the error over the horizon."""

import numpy as np

from awescli.flightlog.split import PARTS
from awescli.notation.angles import wrap
from awescli.notation.quantities import ANGLES
from awescli.reporting.evidence import Document, Evidence
from awescli.reporting.marks import Body, Cell, Folded, Group, Heading, Keys, Paragraph, Section, table
from awescli.reporting.plots import LINE, Figure, Shared, axis, dots, grid, hover, line, log_axis, scene, stride, strip, swatch, with_gaps
from awescli.reporting.published import published
from awescli.reporting.words import COLOURS, GROUPS, channel, listed, number, percent, scale_of

BAND_POINTS = 500
"""Samples of the edge of a band at most: it hardly changes between."""
LOOP_TICKS = 12
"""Most ticks of an axis of loops, which are whole numbers."""
SPATIAL = ("p_n", "p_e", "p_d")
BEGINS = {
    "measured": "the measured state",
    "free": "a start fitted to the second before it",
    "filtered": "the state and the air that a filter over the second before it sees (what acts beside the model then fades)",
}
"""Where predictions begin, in words."""


def prediction(evidence: Evidence) -> Section:
    count = len(evidence.predictions["first"])
    closed = evidence.scores.get("surfaces") == "controller"
    known = (*(() if closed else ("set-points",)), *(("winch",) if evidence.log.on_line else ()), "wind")
    start = BEGINS[evidence.scores.get("initial_states", "free")]
    text = (
        f"{count} predictions of {evidence.horizon:g} s on the test {evidence.parts.of}: each sets out from {start}, "
        f"{'is flown by the fitted controller (closed loop), ' if closed else ''}and sees nothing of the flight after that but "
        f"{listed(list(known))}. "
        "Where a line breaks, the next prediction begins."
    )
    by_horizon_and_loop = over_horizon(evidence), horizons(evidence), over_loops(evidence)
    text = f"{text} {bands_said(evidence)}".strip()
    body = Paragraph(text), paths(evidence), by_horizon_and_loop, channels(evidence), scores(evidence), published(evidence)
    return Section("prediction", "Measured against simulated", body)


def banded(evidence: Evidence) -> str | None:
    """The last model that has bands."""
    return next((m for m in reversed(evidence.models) if (evidence.scores[m].get("bands") or {}).get("inside")), None)


def bands_said(evidence: Evidence) -> str:
    """How often the bands hold, in a sentence or two; of models without, why."""
    if (model := banded(evidence)) is None:
        return ""
    bands = evidence.scores[model]["bands"]
    lost = "" if bands["outcome"] == "computed" else f" ({bands['outcome']}, and have none)"
    without = [evidence.label(m) for m in evidence.compared if "inside" not in evidence.scores[m].get("bands", {})]
    return (
        f"Shaded: where {100 * bands['level']:.0f} % of all measured samples should lie, with what is known of parameters, start, air and "
        f"sensors ({evidence.label(model)}); {100 * bands['inside']['all']:.0f} % do{lost}."
        + (f" No band: {listed(without)}." if without else "")
    )


def paths(evidence: Evidence) -> Figure:
    """Rositani (2025), figure 5: measured and simulated paths in space."""
    arrays = evidence.predictions
    step = stride(arrays["measured_p_n"].size, 4000)

    def path(model: str, name: str, **more) -> dict:
        n, e, d = (with_gaps(arrays[f"{model}_{c}"], step) for c in SPATIAL)
        return {
            "type": "scatter3d",
            "mode": "lines",
            "x": e,
            "y": n,
            "z": -d,
            "name": name,
            "line": {"color": COLOURS[model], "width": 4},
            **more,
        }

    data = [path("measured", "measured")]
    data += [path(m, evidence.label(m), visible=True if m in (evidence.best, "initial") else "legendonly") for m in evidence.compared]
    starts = [arrays[f"measured_{c}"][:, 0] for c in SPATIAL]
    data.append({
        "type": "scatter3d", "mode": "markers", "x": starts[1], "y": starts[0], "z": -starts[2], "name": "starts",
        "marker": {"size": 3.5, "color": COLOURS["measured"]},
    })  # fmt: skip
    view = scene(arrays["measured_p_e"], arrays["measured_p_n"], -arrays["measured_p_d"])
    note = (
        "Drag to turn; a click in the legend shows or hides a model. "
        "Where only one line is to be seen, the simulation lies on the measurement."
    )
    return Figure(
        "fig-3d-prediction", "Measured and simulated paths", data, {"scene": view, "margin": {"l": 0, "r": 0, "t": 0, "b": 0}},
        split=f"test {evidence.parts.of}", note=note, height=480,
    )  # fmt: skip


def over_horizon(evidence: Evidence) -> Body:
    """Mean error against how far ahead is predicted."""
    data = []
    for m in evidence.compared:
        at = evidence.scores[m].get("by_horizon") or {}
        errors = [100 * row["nrmse"]["mean"] for row in at.values()]
        data.append(line([float(h) for h in at], errors, evidence.label(m), COLOURS[m], width=2, mode="lines+markers"))
    if not any(t["x"] for t in data):
        return ""
    floor = 100 * evidence.floor["mean"]
    ends = [min(min(t["x"]) for t in data if t["x"]), max(max(t["x"]) for t in data if t["x"])]
    data.append(line(ends, [floor, floor], "noise alone", COLOURS["floor"], dash="dot", width=2))
    layout = {
        "xaxis": axis("predicted ahead [s]", type="log", tickvals=data[0]["x"]),
        "yaxis": log_axis("mean NRMSE [% of range]", *(t["y"] for t in data)),
    }
    return Figure("fig-horizon", "How far ahead", data, layout, split=f"test {evidence.parts.of}", height=300)


def horizons(evidence: Evidence) -> Group:
    """Mean error one step and more ahead, and for the best model every channel in its unit."""
    steps = [("one_step", f"one step ({evidence.log.dt:g} s)"), *((h, f"{h} s") for h in evidence.scores[evidence.best]["by_horizon"])]
    rows = []
    for m in evidence.compared:
        found = [evidence.ahead(m, key) for key, _ in steps]
        errors = [None if a is None else a["nrmse"]["mean"] for a in found]
        rows.append((evidence.label(m), *(Cell(percent(error), error) for error in errors)))
    lost = [(evidence.label(m), *(_lost(evidence.ahead(m, key)) for key, _ in steps)) for m in evidence.compared]
    own = []
    for name in (n for n in evidence.nrmse(evidence.best) if f"measured_{n}" in evidence.predictions):
        unit, factor = scale_of(name, evidence.predictions[f"measured_{name}"])
        sizes = [(evidence.ahead(evidence.best, key) or {}).get("rmse", {}).get(name) for key, _ in steps]
        own.append((channel(name), unit, *(Cell(number(None if s is None else s * factor), s) for s in sizes)))
    words = [w for _, w in steps]
    more = Folded(f"Every channel in its unit (RMSE), {evidence.label(evidence.best)}, test", table(("channel", "unit", *words), own))
    fell = Folded("Predictions that diverged, of how many", table(("model", *words), lost))
    note = Paragraph(f"Mean NRMSE of the 12 states on the test {evidence.parts.of}, by how far ahead is predicted.", "soft")
    return Group("tab-horizon", "", (note, table(("model", *words), rows), more, fell))


def _lost(block: Document | None) -> Cell:
    """diverged of all predictions of a horizon."""
    return Cell(f"{block['diverged_predictions']} of {block['predictions']}", block["diverged_predictions"]) if block else Cell("–")


def over_loops(evidence: Evidence) -> Figure:
    """Mean error of every loop, part by part: whether the model is as good on loops it was not fitted to."""
    data, shapes = [], []
    for m in evidence.compared:
        rows = evidence.scores[m]["by_loop"]
        said = [f"{r['part']}, {r['from_s']:.0f} to {r['to_s']:.0f} s" for r in rows]
        errors = [100 * r["nrmse"]["mean"] for r in rows]
        data.append(dots([r["loop"] for r in rows], errors, evidence.label(m), COLOURS[m], size=7, text=said,
                         hovertemplate=hover("%{text}: %{y:.3g} %", aside=evidence.label(m))))  # fmt: skip
    rows = evidence.scores[evidence.best]["by_loop"]
    for part in PARTS:
        data.append(swatch(part, COLOURS[part]))
        shapes += [strip(r["loop"] - 0.5, r["loop"] + 0.5, 0.965, 1.0, COLOURS[part]) for r in rows if r["part"] == part]
    layout = {
        "xaxis": axis(f"{evidence.parts.of.removesuffix('s')} of the flight", dtick=max(-(-len(rows) // LOOP_TICKS), 1)), "shapes": shapes,
        "yaxis": log_axis("mean NRMSE [% of range]", *(t["y"] for t in data)),
    }  # fmt: skip
    return Figure(
        "fig-loops", f"Every {evidence.parts.of.removesuffix('s')}", data, layout, split="all parts, strip above", height=300,
        note=f"Error {evidence.horizon:g} s ahead of what was predicted of each, in percent of the part's range.",
    )  # fmt: skip


def channels(evidence: Evidence) -> Body:
    """Every channel over time: measured, and every model."""
    arrays = evidence.predictions
    dt = evidence.log.dt
    step = stride(arrays["measured_p_n"].size)
    time = evidence.log.time[0] + arrays["first"][:, None] * dt + arrays["time"][None]
    text = Paragraph(
        "All channels zoom in time together: drag sideways; a double click goes back. A click on a name shows or hides its line in all.",
        "soft",
    )
    entries = [("measured", COLOURS["measured"], "solid"), *((evidence.label(m), COLOURS[m], "solid") for m in evidence.compared)]
    out: list[Body] = [text, Keys(tuple(entries), "test")]
    for group, names in GROUPS.items():
        panels = [_channel(evidence, n, step) for n in names if f"measured_{n}" in arrays]
        if panels:
            out += [Heading(group), grid(panels)]
    shared = Shared("test_time", with_gaps(time, step)), Shared("band_time", with_gaps(time, stride(time.size, BAND_POINTS)))
    return shared, Group("fig-channels", "Every channel over time", tuple(out))


def _channel(evidence: Evidence, name: str, step: int) -> Figure:
    arrays = evidence.predictions
    measured = arrays[f"measured_{name}"]
    unit, factor = scale_of(name, measured)
    if name in ANGLES:
        # an angle that goes round is drawn on, not back by a turn; simulated ones follow it, so that none is a turn away
        measured = np.unwrap(measured, axis=1)
    data = [line("$test_time", with_gaps(measured * factor, step), "measured", COLOURS["measured"], width=2, meta="measured")]
    for m in evidence.compared:
        simulated = arrays.get(f"{m}_{name}")
        if simulated is None:
            continue
        if name in ANGLES:
            simulated = measured + np.unwrap(wrap(simulated - measured), axis=1)
        label = evidence.label(m)
        data.append(line("$test_time", with_gaps(simulated * factor, step), label, COLOURS[m], width=LINE, meta=label))
    data += _band(evidence, name, measured, factor)
    low, high = np.nanmin(measured * factor), np.nanmax(measured * factor)
    room = 0.15 * (high - low) or 1.0
    # a model that runs away must not flatten what was measured
    layout = {
        "xaxis": axis("time [s]"), "yaxis": axis(f"[{unit}]" if unit else "", range=[low - room, high + room]), "margin": {"t": 24},
        "showlegend": False, "uirevision": name,
    }  # fmt: skip
    return Figure(f"fig-{name}", channel(name), data, layout, split=f"test {evidence.parts.of}", height=230, linked="test", part=True)


def _band(evidence: Evidence, name: str, measured: np.ndarray, factor: float) -> list[dict]:
    """The shaded band of the last model that has one, as smooth as it is; measured: (K, N+1), near which angles are drawn."""
    model = banded(evidence)
    if model is None or f"low_{model}_{name}" not in evidence.predictions:
        return []
    low, high = (evidence.predictions[f"{which}_{model}_{name}"] for which in ("low", "high"))
    if name in ANGLES:
        middle = measured + np.unwrap(wrap((low + high) / 2 - measured), axis=1)
        low, high = middle - (high - low) / 2, middle + (high - low) / 2
    # a prediction without a band has one of no width
    drawn = np.any(high > low, axis=1, keepdims=True)
    low, high = (np.where(drawn, edge * factor, np.nan) for edge in (low, high))
    label = evidence.label(model)
    shaded = {"type": "scatter", "mode": "lines", "x": "$band_time", "hoverinfo": "skip", "showlegend": False, "line": {"width": 0}}
    step = stride(measured.size, BAND_POINTS)
    return [
        {**shaded, "y": with_gaps(low, step), "name": f"{label}, 5 %", "meta": label},
        {**shaded, "y": with_gaps(high, step), "name": f"{label}, 95 %", "meta": label, "fill": "tonexty",
         "fillcolor": f"{COLOURS[model]}/0.18"},
    ]  # fmt: skip


def scores(evidence: Evidence) -> Group:
    """Mean errors per part, how many predictions diverged, and every score of every channel and model."""
    rows = []
    for m in evidence.compared:
        block = evidence.scores[m]
        lost, count = (sum((block.get(key) or {}).values()) for key in ("diverged_predictions", "predictions"))
        mean = [Cell(percent(block["nrmse"][p]["mean"]), block["nrmse"][p]["mean"]) for p in PARTS]
        rows.append((evidence.label(m), *mean, Cell(f"{lost} of {count}", lost)))
    floor = evidence.floor["mean"]
    rows.append(("noise alone", Cell("–"), Cell("–"), Cell(percent(floor), floor), Cell("–")))
    parts = table(("model", *PARTS, "predictions that diverged"), rows)
    head = ("channel", "unit", "model", "NRMSE", "RMSE", "R²", "Theil U", "inside its 90 % band")
    every = table(head, [row for name in evidence.nrmse(evidence.best) if name != "mean" for row in _of_channel(evidence, name)])
    return Group("tab-scores", "Mean error by part", (parts, Folded("All scores per channel, test", every)))


def _of_channel(evidence: Evidence, name: str) -> list[tuple]:
    """All scores of a channel, a row for every model."""
    unit, factor = scale_of(name, evidence.predictions.get(f"measured_{name}", np.zeros(1)))
    rows = []
    for m in evidence.compared:
        block = evidence.scores[m]
        nrmse = block["nrmse"]["test"].get(name)
        rmse, r2, theil = (block.get(k, {}).get(name) for k in ("rmse", "r2", "theil"))
        in_unit = None if rmse is None else rmse * factor
        inside = block.get("bands", {}).get("inside", {}).get(name)
        numbers = Cell(percent(nrmse), nrmse), Cell(number(in_unit), in_unit), Cell(number(r2, 5), r2), Cell(number(theil), theil)
        rows.append((channel(name), unit, evidence.label(m), *numbers, Cell(percent(inside), inside)))
    return rows
