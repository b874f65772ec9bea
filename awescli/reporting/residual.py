"""The residual and what it was traced to: errors before and after, candidates, the loop-averaged residual, parameter shifts."""

import numpy as np

from awescli.reporting.candidates import ranking
from awescli.reporting.criteria import criteria, probabilities
from awescli.reporting.evidence import Evidence
from awescli.reporting.headline import lead, shows_phase
from awescli.reporting.in_action import in_action
from awescli.reporting.marks import Body, Cell, Chip, Code, Group, Keys, Paragraph, Section, Strong, absent, table
from awescli.reporting.plots import Figure, Shared, axis, bars, dots, grid, hover, line, log_axis
from awescli.reporting.whiteness import whiteness
from awescli.reporting.words import COLOURS, channel, effect_words, listed, number, percent, scale_of, short, with_std

PANELS = 6
"""Channels shown over the loop: those whose error before stands highest above the noise."""
BINS = 24
"""Parts of a loop: 15 degrees each."""


def residual(evidence: Evidence) -> Section:
    title = "The residual, and what it was traced to"
    if evidence.effects is None:
        return Section("residual", title, absent("awes trace-residual", "the residual was not traced"))
    found = Paragraph((verdict_chip(evidence), " ", lead(evidence))), sizes(evidence), in_action(evidence), before_after(evidence)
    found = (*found, over_loop(evidence), roll_gusts(evidence), rolled_parameters(evidence))
    why = criteria(evidence), probabilities(evidence), ranking(evidence)
    return Section("residual", title, (found, unexplained(evidence), why, whiteness(evidence), outliers(evidence), shifts(evidence)))


def verdict_chip(evidence: Evidence) -> Chip:
    return Chip(evidence.traced["verdict"].replace("_", " "), "good" if evidence.traced["verdict"] in ("found", "none") else "bad")


def sizes(evidence: Evidence) -> Body:
    """The effects that were accepted, or that a parameter at its bound absorbs, with intervals and rivals."""
    rows = [
        (effect_words(e["name"], e.get("acts_on", "")), e.get("doc", ""), name,
         Cell(with_std(p["value"], p["std"], p["unit"]), p["value"]),
         listed([effect_words(r["name"], r.get("acts_on", "")) for r in e["rivals"]]) or "none")
        for e in evidence.named
        for name, p in e["parameters"].items()
    ]  # fmt: skip
    gust = evidence.traced.get("gust_m_s")
    air = Paragraph(f"Gusts that the flight shows: {number(gust)} m/s.") if gust else ""
    head = ("effect", "what it is", "parameter", "size ± 2 std", "rivals")
    return Group("tab-effects", "", table(head, rows, sortable=False)) if rows else "", air


def labels(evidence: Evidence) -> tuple[str, str]:
    """What before and after mean."""
    return "before: model as declared, fitted", f"after: {evidence.label('with_effects')}"


def before_after(evidence: Evidence) -> Figure:
    """Errors per channel before and after, with the noise floor."""
    error = evidence.traced["error"]
    names = [n for n in error["after"] if n != "mean"] + ["mean"]
    x = ["mean" if n == "mean" else short(n) for n in names]
    content = [channel(n) for n in names]
    shown = [w for w in ("before", "after") if w in error and (w == "before" or evidence.tracing_added)]
    data = [
        bars(x, [100 * error[which][n] for n in names], label, COLOURS[model], text=content, textposition="none",
             hovertemplate=hover("%{text}: %{y:.3g} %"))
        for which, label, model in zip(shown, labels(evidence), ("identified", "with_effects"), strict=False)
    ]  # fmt: skip
    data.append(
        dots(
            x, [100 * error["noise_floor"][n] for n in names], "noise alone", "@ink", symbol="line-ew", size=14,
            marker={"line": {"width": 2, "color": "@ink"}}, hovertemplate=hover("noise alone: %{y:.3g} %"),
        )
    )  # fmt: skip
    lost = error.get("diverged_before", 0), error.get("diverged_after", 0)
    note = f"Predictions that diverged: {lost[0]} before, {lost[1]} after." if any(lost) else ""
    return Figure(
        "fig-residual", f"Error {error['horizon_s']:g} s ahead, before and after", data,
        {"yaxis": axis("NRMSE [% of range]", rangemode="tozero"), "xaxis": {"type": "category"}},
        split=f"{error.get('split', 'test')} {evidence.parts.of}", note=note, height=320,
    )  # fmt: skip


def over_loop(evidence: Evidence) -> Body:
    """What repeats: the residual averaged over loops, at every phase of a loop, and what the effect explains of it."""
    if not shows_phase(evidence):
        return Paragraph("The flight does not loop, so there is no residual per phase of a loop.", "absent") if evidence.residuals else ""
    r = evidence.residual_series
    phase = loop_phase(evidence, r["test_first"][:, None] + np.arange(len(r["time"]))[None])
    names = [k.removeprefix("test_before_") for k in r if k.startswith("test_before_")]
    error = evidence.traced["error"]
    first = error.get("before", error["after"])
    names = sorted(names, key=lambda n: -(first.get(n, 0.0) / max(error["noise_floor"].get(n, 1.0), 1e-12)))[:PANELS]
    panels = [_panel(evidence, name, phase) for name in names if f"test_after_{name}" in r]
    middle = (np.arange(BINS) + 0.5) * 360 / BINS
    note = (
        "Measured minus predicted, averaged over the test loops at each phase of a loop. What repeats before and is gone after was the "
        "missing effect; the dashed line is what the effect puts in. Shaded: ± 1 standard deviation over loops. "
        "Shown: the six channels that stand highest above noise."
        if evidence.tracing_added
        else "Measured minus predicted, averaged over the test loops at each phase of a loop; shaded: ± 1 standard deviation over loops."
    )
    entries = [("before", COLOURS["identified"], "dotted")]
    if evidence.tracing_added:
        entries += [("what the effect explains", COLOURS["measured"], "dashed"), ("after", COLOURS["with_effects"], "solid")]
    content = Paragraph(note, "soft"), Keys(tuple(entries)), Shared("phase", middle), grid(panels)
    return Group("fig-phase", "What repeats in every loop", content)


def loop_phase(evidence: Evidence, samples: np.ndarray) -> np.ndarray:
    """0..1 through its loop for sample indices of any shape; NaN in no loop."""
    phase = np.full(len(evidence.log), np.nan)
    for first, last in evidence.loops.bounds:
        phase[first:last] = np.arange(last - first) / (last - first)
    inside = samples < len(phase)
    return np.where(inside, phase[np.minimum(samples, len(phase) - 1)], np.nan)


def _panel(evidence: Evidence, name: str, phase: np.ndarray) -> Figure:
    before, after = evidence.residual_series[f"test_before_{name}"], evidence.residual_series[f"test_after_{name}"]
    unit, factor = scale_of(name, before)
    width = {"width": 2}
    mean, spread = loop_mean(before * factor, phase)
    data = [*_band(mean, spread, "before", "@blue"), dots("$phase", mean, "before", COLOURS["identified"], size=5)]
    if evidence.tracing_added:
        data.append(
            line("$phase", loop_mean((before - after) * factor, phase)[0], "what the effect explains", COLOURS["measured"], dash="dash")
        )
        mean, spread = loop_mean(after * factor, phase)
        data += [*_band(mean, spread, "after", "@green"), line("$phase", mean, "after", COLOURS["with_effects"], **width)]
    layout = {
        "xaxis": axis("phase of the loop [°]", range=[0, 360], dtick=90), "yaxis": axis(f"[{unit}]" if unit else "", zeroline=True),
        "margin": {"t": 24}, "showlegend": False,
    }  # fmt: skip
    return Figure(f"fig-phase-{name}", channel(name), data, layout, split=f"test {evidence.parts.of}", height=240, part=True)


def _band(mean: np.ndarray, spread: np.ndarray, name: str, colour: str) -> list[dict]:
    """Shaded mean ± spread."""
    common = {"type": "scatter", "mode": "lines", "x": "$phase", "hoverinfo": "skip", "showlegend": False, "line": {"width": 0}}
    upper = {"fill": "tonexty", "fillcolor": f"{colour}/0.18"}
    return [
        {**common, "y": mean - spread, "name": f"{name} - 1 std"}, {**common, "y": mean + spread, "name": f"{name} + 1 std", **upper},
    ]  # fmt: skip


def loop_mean(values: np.ndarray, phase: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(mean, standard deviation) per bin of the phase; NaN where a bin is empty."""
    known = np.isfinite(phase) & np.isfinite(values)
    index = (phase[known] * BINS).astype(int)
    count = np.bincount(index, minlength=BINS).astype(float)
    count[count == 0] = np.nan
    mean = np.bincount(index, values[known], BINS) / count
    return mean, np.sqrt(np.maximum(np.bincount(index, values[known] ** 2, BINS) / count - mean**2, 0.0))


def unexplained(evidence: Evidence) -> Body:
    """The empirical expression for what has no name in the library."""
    found = evidence.traced.get("unexplained")
    if not found:
        return ""
    where, what = Strong(channel(found.get("channel", ""))), Code(found["expression"]) if found.get("expression") else "nothing simple"
    share = f", {percent(found.get('share'))} of the gap on validation is described by "
    content = Paragraph(("In ", where, share, what, ". These terms are empirical: they describe, they do not explain."))
    return Group("unexplained", "Without a name in the library", content)


def shifts(evidence: Evidence) -> Body:
    """How far each parameter lay from its prior before and after: parameters that compensated for the effect move back."""
    moved = evidence.traced.get("parameter_shifts") or {}
    note = (
        "A parameter that compensated for the missing effect moves back towards its prior when the effect is added. "
        "Shaded: ± 1 prior standard deviation."
    )
    note = note if evidence.tracing_added else "Nothing was added, so nothing moved."
    return _shifted("fig-shifts", "Parameters before and after adding it", moved, evidence.tracing_added, note) if moved else ""


def _shifted(id: str, title: str, moved: dict, added: bool, note: str) -> Figure:
    """Distances from the prior before, and after where something was added."""
    names = sorted(moved, key=lambda n: -abs(moved[n]["before_in_prior_std"]))
    before, after = ([moved[n][f"{w}_in_prior_std"] for n in names] for w in ("before", "after"))
    ways = [v for b, a in zip(before, after, strict=True) for v in (b, a, None)]
    data = [line(ways, [v for n in names for v in (n, n, None)], "", "@grey/0.6", width=2, showlegend=False, hoverinfo="skip")]
    data.append(dots(before, names, "before", COLOURS["identified"], size=8, hovertemplate=hover("%{y} before: %{x:.2f} prior std")))
    if added:
        data.append(dots(after, names, "after", COLOURS["with_effects"], size=8, hovertemplate=hover("%{y} after: %{x:.2f} prior std")))
    layout = {
        "xaxis": axis("distance from the prior, in prior standard deviations", zeroline=True),
        "yaxis": {"autorange": "reversed", "type": "category", "categoryorder": "array", "categoryarray": names, "dtick": 1},
        "shapes": [{"type": "rect", "yref": "paper", "y0": 0, "y1": 1, "x0": -1, "x1": 1, "fillcolor": "@grey/0.12", "line": {"width": 0}}],
    }
    return Figure(id, title, data, layout, split="fitted to train", note=note, height=90 + 17 * len(names))


def outliers(evidence: Evidence) -> Body:
    """Values that no model was asked to follow."""
    many = evidence.traced.get("outliers")
    if not many:
        return ""
    values = listed([f"{count} of {channel(name)}" for name, count in many.items()])
    return Paragraph((f"Values that were left out, for they are far off for a moment, or from one to the next and back: {values}.",))


def roll_gusts(evidence: Evidence) -> Body:
    """What roll gusts explain of every channel on unseen segments."""
    roll = evidence.traced.get("roll_gusts")
    if not roll:
        return ""
    names = list(roll["channels"])
    before, after = ([roll["channels"][n][which] for n in names] for which in ("before", "after"))
    more = {"text": [channel(n) for n in names], "hovertemplate": hover("%{text}: %{x:.3g} times the noise")}
    y = [short(n) for n in names]
    data = [
        dots(before, y, "gusts that move the kite", COLOURS["identified"], **more),
        dots(after, y, "and gusts that roll it", COLOURS["with_effects"], **more),
    ]
    layout = {
        "xaxis": log_axis("squared residual over that of the noise", before, after),
        "yaxis": {"autorange": "reversed", "type": "category", "dtick": 1},
    }
    note = (
        f"Gusts of {number(roll['std_rad_s'])} rad/s that roll the kite, each lasting {number(roll['lasts_s'])} s, are worth a deviance of "
        f"{number(roll['worth'])}. Both models are fitted alike; on the segments shown only starts and gusts are fitted."
    )
    return Figure("fig-roll", "What roll gusts explain", data, layout, split=roll["split"], note=note, height=110 + 20 * len(names))


def rolled_parameters(evidence: Evidence) -> Body:
    """What the derivatives are once roll gusts are in the model."""
    roll = evidence.traced.get("roll_gusts")
    if not roll:
        return ""
    note = (
        "The controller reacts to roll gusts. To a model without them the surfaces move and the kite does not follow, so the fit reduces "
        "the control derivatives. After: fitted with roll gusts. The kite file keeps the values before, which predict recorded flight "
        "better: recorded surfaces contain the reaction to gusts that cannot be predicted. Shaded: ± 1 prior standard deviation."
    )
    return _shifted("fig-rolled", "What roll gusts do to the derivatives", roll["parameter_shifts"], True, note)
