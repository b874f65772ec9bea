"""The hybrid: what a network on top of physics adds (figures 3 and 4 of the seed), and how it was trained."""

from collections.abc import Mapping

from awescli.report.evidence import Evidence
from awescli.report.marks import Cell, Section, absent, esc, paragraph, table
from awescli.report.plots import axis, bars, figure, grid, line
from awescli.report.words import COLOURS, channel, listed, number, percent

COLUMNS = ("phase", "round", "horizon", "train", "validation", "validation_last_horizon", "diverged", "evaluations", "seconds")
"""Columns of a training history that comes as rows without names."""


def hybrid(evidence: Evidence) -> Section:
    title = "The hybrid: physics with a network"
    if evidence.hybrid is None or "hybrid" not in evidence.models:
        return Section("hybrid", title, absent("awes train-hybrid", "no network was trained on what is left"))
    body = paragraph(sentence(evidence)) + scores(evidence) + optimisers(evidence) + history(evidence) + shares(evidence)
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
    if isinstance(report.get("seconds"), (int, float)):
        text.append(f"Training took {number(report['seconds'])} s.")
    return " ".join(text)


def scores(evidence: Evidence) -> str:
    """Figure 4 of the seed, and the same for positions, attitude and rates."""
    models = [m for m in ("identified", "with_effects", "hybrid") if m in evidence.models]
    panels = []
    for id, title, names in (
        ("fig-hybrid-velocities", "Linear velocities (figure 4)", ("u", "v", "w")), ("fig-hybrid-rates", "Angular velocities", ("p", "q", "r")),
        ("fig-hybrid-positions", "Positions (figure 3)", ("p_n", "p_e", "p_d")), ("fig-hybrid-attitude", "Attitude", ("phi", "theta", "psi")),
    ):  # fmt: skip
        data = [
            bars([channel(n) for n in names], [100 * evidence.nrmse(m)[n] for n in names], evidence.label(m), COLOURS[m])
            for m in models if all(n in evidence.nrmse(m) for n in names)
        ]  # fmt: skip
        layout = {"yaxis": axis("NRMSE [% of range]", rangemode="tozero")}
        panels.append(figure(id, title, data, layout, split=f"test {evidence.parts.of}", height=260, part=True))
    return grid(panels)


def optimisers(evidence: Evidence) -> str:
    """Adam alone against Adam and L-BFGS, where the stage compared them (figure 3 of the seed)."""
    rows = (training(evidence).get("comparison") or {}).get("channels") or {}
    rows = {n: r for n, r in rows.items() if isinstance(r, Mapping) and {"adam", "adam_lbfgs"} <= set(r)}
    if not rows:
        return ""
    x = [channel(n) for n in rows]
    data = [
        bars(x, [r["adam"] for r in rows.values()], "Adam alone", COLOURS["initial"]),
        bars(x, [r["adam_lbfgs"] for r in rows.values()], "Adam, then L-BFGS", COLOURS["identified"]),
    ]
    return figure(
        "fig-optimisers", "Adam alone, and Adam followed by L-BFGS, at equal cost", data,
        {"yaxis": axis("RMSE / noise", rangemode="tozero")}, split=f"validation {evidence.parts.of}", height=300,
    )  # fmt: skip


def history(evidence: Evidence) -> str:
    """Loss over gradient evaluations."""
    rows = _history(evidence)
    if len(rows) < 2:
        return ""
    x = [r.get("evaluations", i) for i, r in enumerate(rows)]
    # the count begins anew in every phase
    total, last, along = 0.0, 0.0, []
    for value in x:
        total += value - last if value >= last else value
        last = value
        along.append(total)
    data = [
        line(along, [r.get(key) for r in rows], words, colour, mode="lines+markers")
        for key, words, colour in (("train", "train", COLOURS["train"]), ("validation_last_horizon", "validation, full horizon", COLOURS["validation"]))
        if any(isinstance(r.get(key), (int, float)) for r in rows)
    ]
    layout = {"xaxis": axis("gradient evaluations"), "yaxis": axis("squared error / physics alone", type="log")}
    return figure(
        "fig-training", "Training", data, layout, split="train and validation", height=280,
        note="1 is physics without the network. Horizons grow during training, so train errors of different rounds do not compare.",
    )  # fmt: skip


def _history(evidence: Evidence) -> list[dict]:
    """Rows of the training history with names, from any of the shapes a stage may store."""
    for source in (training(evidence), evidence.network or {}):
        found = source.get("history")
        if isinstance(found, Mapping):
            keys = [k for k, v in found.items() if isinstance(v, (list, tuple))]
            count = min((len(found[k]) for k in keys), default=0)
            return [{k: found[k][i] for k in keys} for i in range(count)]
        if isinstance(found, (list, tuple)) and found:
            if isinstance(found[0], Mapping):
                return [dict(r) for r in found]
            columns = source.get("history_columns") or COLUMNS
            return [dict(zip(columns, r, strict=False)) for r in found if isinstance(r, (list, tuple))]
    return []


def shares(evidence: Evidence) -> str:
    """How large the network's part is, and the formula nearest to it, where the stage tells."""
    report = training(evidence)
    found = report.get("shares") or report.get("correction_share") or {}
    rows = [(str(k), Cell(percent(v), v)) for k, v in found.items() if isinstance(v, (int, float))] if isinstance(found, Mapping) else []
    ratio = report.get("validation_rmse_ratio") or {}
    more = [(channel(k), Cell(number(v), v)) for k, v in ratio.items() if isinstance(v, (int, float))]
    text = f"<h3>Share of the network in the motion</h3><br>{table(('derivative', 'share'), rows)}" if rows else ""
    return text + (f"<h3>Error with the network over error without, validation</h3><br>{table(('channel', 'ratio'), more)}" if more else "")
