"""The hybrid: what a network on top of physics adds (Rositani (2025), figures 3 and 4), and how it was trained."""

import math
from collections.abc import Mapping

import numpy as np

from awescli.notation.quantities import UNITS
from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Body, Cell, Code, Group, Heading, Keys, Paragraph, Section, absent, bullets, table
from awescli.reporting.plots import PANEL_POINTS, Figure, Shared, axis, bars, dots, grid, line, log_axis, stride
from awescli.reporting.words import COLOURS, channel, listed, number, percent, short, unit_of

CORRECTED = ("u", "v", "w", "p", "q", "r")
"""States whose derivatives the network corrects: the columns of correction.npz."""


def hybrid(evidence: Evidence) -> Section:
    title = "The hybrid: physics with a network"
    if evidence.hybrid is None:
        return Section("hybrid", title, absent("awes train-hybrid", "no network was trained on what is left"))
    if "hybrid" not in evidence.models:
        return Section("hybrid", title, (Paragraph(sentence(evidence)), history(evidence)))
    trained = optimisers(evidence), history(evidence)
    return Section("hybrid", title, (Paragraph(sentence(evidence)), scores(evidence), along_flight(evidence), trained, shares(evidence)))


def training(evidence: Evidence) -> Mapping:
    """Training's numbers, wherever the stage put them."""
    report = evidence.hybrid or {}
    inner = report.get("training")
    return {**report, **inner} if isinstance(inner, Mapping) else report


def sentence(evidence: Evidence) -> str:
    """Size, inputs and outcome."""
    report, network = training(evidence), evidence.network or {}
    text = [f"Outcome: {str(report.get('outcome', '?')).replace('_', ' ')}."]
    if report.get("sentence"):
        text.append(str(report["sentence"]).capitalize() + ".")
    if isinstance(network.get("inputs"), (list, tuple)):
        hidden = " × ".join(str(h) for h in network.get("hidden", []))
        text.append(f"A network with hidden layers of {hidden} sees {listed([str(i) for i in network['inputs']])}.")
    if isinstance(report.get("outside_box_test"), (int, float)):
        text.append(f"On {percent(report['outside_box_test'])} of the test samples it faded, as the flight left what it was trained on.")
    return " ".join(text)


def scores(evidence: Evidence) -> Body:
    """Errors as in Rositani (2025), figure 4, and the same for positions, attitude and rates."""
    models = [m for m in ("identified", "with_effects", "hybrid") if m in evidence.models]
    panels = []
    for id, title, names in (
        ("fig-hybrid-velocities", "Linear velocities", ("u", "v", "w")),
        ("fig-hybrid-rates", "Angular velocities", ("p", "q", "r")),
        ("fig-hybrid-positions", "Positions", ("p_n", "p_e", "p_d")),
        ("fig-hybrid-attitude", "Attitude", ("phi", "theta", "psi")),
    ):
        data = [
            bars([short(n) for n in names], [100 * evidence.nrmse(m)[n] for n in names], evidence.label(m), COLOURS[m])
            for m in models if all(n in evidence.nrmse(m) for n in names)
        ]  # fmt: skip
        data.append(
            dots(
                [short(n) for n in names], [100 * evidence.floor[n] for n in names], "noise alone", "@ink", symbol="line-ew", size=14,
                marker={"line": {"width": 2, "color": "@ink"}},
            )
        )  # fmt: skip
        layout = {"yaxis": axis("NRMSE [% of range]", rangemode="tozero"), "showlegend": False, "margin": {"t": 24}}
        panels.append(Figure(id, title, data, layout, split=f"test {evidence.parts.of}", height=240, part=True))
    entries = [*((evidence.label(m), COLOURS[m], "solid") for m in models), ("noise alone", "@ink", "solid")]
    return Heading(f"Error {evidence.horizon:g} s ahead, with and without the network"), Keys(tuple(entries)), grid(panels)


OPTIMISERS = {
    "adam": ("Adam alone, as many gradients", COLOURS["initial"]), "adam_equal_time": ("Adam alone, as many seconds", COLOURS["train"]),
    "adam_lbfgs": ("Adam, then L-BFGS", COLOURS["identified"]),
}  # fmt: skip
"""Trainings that `train-hybrid.compare` leaves: words and colour."""


def optimisers(evidence: Evidence) -> Body:
    """Rositani (2025), figure 3: positions with Adam alone against Adam and L-BFGS, where the stage compared them."""
    found = training(evidence).get("comparison")
    test = (found.get("test") or {}) if isinstance(found, Mapping) else {}
    runs = {k: words for k, words in OPTIMISERS.items() if isinstance(test.get(k), Mapping)}
    names = [n for n in ("p_n", "p_e", "p_d", "mean") if runs and all(n in test[k] for k in runs)]
    if not names or "adam_lbfgs" not in runs:
        how = Code("awes train-hybrid --set train-hybrid.compare=true")
        return Paragraph(("Adam alone was not trained for comparison; ", how, " does so."), "absent")
    x = [channel(n) for n in names]
    data = [bars(x, [100 * test[k][n] for n in names], words, colour) for k, (words, colour) in runs.items()]
    return Figure(
        "fig-optimisers", "Adam alone, and Adam followed by L-BFGS, from the same weights at equal cost", data,
        {"yaxis": axis("NRMSE [% of range]", rangemode="tozero")}, split=f"test {evidence.parts.of}", height=300,
    )  # fmt: skip


def along_flight(evidence: Evidence) -> Body:
    """What the network adds to each derivative over the whole flight."""
    c = evidence.correction
    if c is None:
        return ""
    step = stride(len(c["time"]), PANEL_POINTS)
    panels = []
    for i, name in enumerate(CORRECTED):
        unit, factor = ("m/s²", 1.0) if name in "uvw" else ("°/s²", 180 / math.pi)
        data = [line("$correction_time", factor * c["correction"][::step, i], "network", COLOURS["hybrid"])]
        layout = {"xaxis": axis("time [s]"), "yaxis": axis(f"[{unit}]", zeroline=True), "showlegend": False, "margin": {"t": 24}}
        panels.append(
            Figure(f"fig-correction-{name}", f"d{name}/dt", data, layout, split="whole flight", height=210, linked="flight", part=True)
        )
    text = "Added to the accelerations at the measured states. It fades to nothing where the flight leaves what it was trained on."
    content = Paragraph(text, "soft"), Shared("correction_time", c["time"][::step]), grid(panels)
    return Group("fig-correction", "What the network adds", content)


def history(evidence: Evidence) -> Body:
    """Loss over gradient evaluations."""
    rows = _history(evidence)
    if len(rows) < 2:
        return ""
    along = np.cumsum([float(r.get("evaluations") or 1.0) for r in rows])
    data = [
        line(along, [r.get(key) for r in rows], words, colour, mode="lines+markers")
        for key, words, colour in (
            ("train", "train", COLOURS["train"]),
            ("validation_last_horizon", "validation, full horizon", COLOURS["validation"]),
        )
        if any(isinstance(r.get(key), (int, float)) for r in rows)
    ]
    kept = ((training(evidence).get("validation") or {}).get("prediction") or {}).get("hybrid")
    judged = [r.get("validation_last_horizon") for r in rows]
    chosen = [k for k, v in enumerate(judged) if kept and v and math.isclose(v, kept, rel_tol=1e-9)]
    if chosen and "hybrid" in evidence.models:
        data.append(dots([along[chosen[0]]], [kept], "kept: best on validation", COLOURS["hybrid"], size=13, symbol="diamond"))
    layout = {"xaxis": axis("gradient evaluations"), "yaxis": log_axis("squared error / physics alone", *(t["y"] for t in data))}
    return Figure(
        "fig-training", "Training", data, layout, split="train and validation", height=280,
        note="1 is physics without the network. Horizons grow during training, so train errors of different rounds do not compare.",
    )  # fmt: skip


def _history(evidence: Evidence) -> list[dict]:
    """Rows of the training history by column."""
    found = training(evidence).get("history")
    if not isinstance(found, Mapping) or not isinstance(found.get("rows"), (list, tuple)):
        return []
    return [dict(zip(found.get("columns", ()), row, strict=False)) for row in found["rows"]]


def shares(evidence: Evidence) -> Body:
    """How large the network's part in the motion is, and the formulas nearest to it."""
    report = training(evidence)
    found = report.get("share_of_acceleration") or {}
    ratio = report.get("validation_rmse_ratio") or {}
    rows = [(f"d{k}/dt", Cell(percent(v), v)) for k, v in found.items() if isinstance(v, (int, float))]
    more = [(channel(k), Cell(number(v), v)) for k, v in ratio.items() if isinstance(v, (int, float))]
    formulas = bullets(Code(f) for f in report.get("distilled") or ())
    return (
        (Heading("Share of the network in the motion"), table(("derivative", "share"), rows)) if rows else "",
        (Heading("Error with the network over error without, validation"), table(("channel", "ratio"), more)) if more else "",
        ensemble(report),
        (Heading("Formulas nearest to what the network learned"), formulas) if formulas else "",
    )


def ensemble(report: Mapping) -> Body:
    """How far networks from different seeds agree: their spread is what the hybrid does not know."""
    found = report.get("ensemble") or {}
    spread = found.get("spread") or {}
    if not spread:
        return ""
    rows = []
    for name, value in spread.items():
        unit, factor = unit_of(UNITS.get(name, ""))
        rows.append((channel(name), unit, Cell(number(value * factor), value)))
    text = f"{found.get('learned', '?')} of {found.get('members', '?')} networks from different seeds learned something."
    return Group("ensemble", "Spread of the ensemble, test", (Paragraph(text), table(("channel", "unit", "1 std"), rows)))
