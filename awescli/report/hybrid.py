"""The hybrid: what a network on top of physics adds (figures 3 and 4 of the seed), and how it was trained."""

from collections.abc import Mapping

import numpy as np

from awescli.report.evidence import Evidence
from awescli.report.marks import Body, Cell, Section, absent, bullets, esc, paragraph, table
from awescli.report.plots import Figure, axis, bars, grid, line, log_axis
from awescli.report.words import COLOURS, channel, listed, number, percent


def hybrid(evidence: Evidence) -> Section:
    title = "The hybrid: physics with a network"
    if evidence.hybrid is None:
        return Section("hybrid", title, absent("awes train-hybrid", "no network was trained on what is left"))
    if "hybrid" not in evidence.models:
        return Section("hybrid", title, (paragraph(sentence(evidence)), history(evidence)))
    body = paragraph(sentence(evidence)), scores(evidence), optimisers(evidence), history(evidence), shares(evidence)
    return Section("hybrid", title, body)


def training(evidence: Evidence) -> Mapping:
    """Training's numbers, wherever the stage put them."""
    report = evidence.hybrid or {}
    inner = report.get("training")
    return {**report, **inner} if isinstance(inner, Mapping) else report


def sentence(evidence: Evidence) -> str:
    """Size, inputs and outcome."""
    report, network = training(evidence), evidence.network or {}
    text = [f"Outcome: {esc(str(report.get('outcome', '?')).replace('_', ' '))}."]
    if report.get("sentence"):
        text.append(esc(str(report["sentence"])).capitalize() + ".")
    if isinstance(network.get("inputs"), (list, tuple)):
        hidden = " × ".join(str(h) for h in network.get("hidden", []))
        text.append(f"A network with hidden layers of {esc(hidden)} sees {esc(listed([str(i) for i in network['inputs']]))}.")
    if isinstance(report.get("outside_box_test"), (int, float)):
        text.append(f"On {percent(report['outside_box_test'])} of the test samples it faded, as the flight left what it was trained on.")
    return " ".join(text)


def scores(evidence: Evidence) -> Body:
    """Figure 4 of the seed, and the same for positions, attitude and rates."""
    models = [m for m in ("identified", "with_effects", "hybrid") if m in evidence.models]
    panels = []
    for id, title, names in (
        ("fig-hybrid-velocities", "Linear velocities", ("u", "v", "w")),
        ("fig-hybrid-rates", "Angular velocities", ("p", "q", "r")),
        ("fig-hybrid-positions", "Positions", ("p_n", "p_e", "p_d")),
        ("fig-hybrid-attitude", "Attitude", ("phi", "theta", "psi")),
    ):
        data = [
            bars([channel(n) for n in names], [100 * evidence.nrmse(m)[n] for n in names], evidence.label(m), COLOURS[m])
            for m in models if all(n in evidence.nrmse(m) for n in names)
        ]  # fmt: skip
        layout = {"yaxis": axis("NRMSE [% of range]", rangemode="tozero")}
        panels.append(Figure(id, title, data, layout, split=f"test {evidence.parts.of}", height=260, part=True))
    return grid(panels)


def optimisers(evidence: Evidence) -> Body:
    """Figure 3 of the seed: positions with Adam alone against Adam and L-BFGS, where the stage compared them."""
    found = training(evidence).get("comparison")
    test = (found.get("test") or {}) if isinstance(found, Mapping) else {}
    names = [n for n in ("p_n", "p_e", "p_d", "mean") if n in (test.get("adam") or {}) and n in (test.get("adam_lbfgs") or {})]
    if not names:
        return ""
    x = [channel(n) for n in names]
    data = [
        bars(x, [100 * test["adam"][n] for n in names], "Adam alone", COLOURS["initial"]),
        bars(x, [100 * test["adam_lbfgs"][n] for n in names], "Adam, then L-BFGS", COLOURS["identified"]),
    ]
    return Figure(
        "fig-optimisers", "Adam alone, and Adam followed by L-BFGS, at equal cost", data,
        {"yaxis": axis("NRMSE [% of range]", rangemode="tozero")}, split=f"test {evidence.parts.of}", height=300,
    )  # fmt: skip


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


def shares(evidence: Evidence) -> str:
    """How large the network's part in the motion is, and the formulas nearest to it."""
    report = training(evidence)
    found = report.get("share_of_acceleration") or {}
    ratio = report.get("validation_rmse_ratio") or {}
    rows = [(str(k), Cell(percent(v), v)) for k, v in found.items() if isinstance(v, (int, float))]
    more = [(channel(k), Cell(number(v), v)) for k, v in ratio.items() if isinstance(v, (int, float))]
    text = f"<h3>Share of the network in the motion</h3>{table(('derivative', 'share'), rows)}" if rows else ""
    text += f"<h3>Error with the network over error without, validation</h3>{table(('channel', 'ratio'), more)}" if more else ""
    formulas = [f"<code>{esc(f)}</code>" for f in report.get("distilled") or ()]
    return text + (f"<h3>Formulas nearest to what the network learned</h3>{bullets(formulas)}" if formulas else "")
