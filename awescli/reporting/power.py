"""Mechanical power of the test loops: one sentence, and the energy of every loop, measured against each model."""

from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Link, Words
from awescli.reporting.plots import Figure, axis, dots, hover, line
from awescli.reporting.words import COLOURS, number, percent

FIGURE = "fig-power"
KILO = 1e-3


def powers(evidence: Evidence) -> dict[str, dict]:
    """Model -> its power block, of those models that have one (a tethered flight, a load cell)."""
    return {m: evidence.scores[m]["power"] for m in evidence.models if evidence.scores[m].get("power")}


def power_claim(evidence: Evidence) -> Words:
    """What the line earned on the test loops, and how wrong each model is about it; empty for a flight without power."""
    found = powers(evidence)
    if not found:
        return ""
    block = found[list(found)[-1]]
    diverged = {m for m in found if sum(evidence.scores[m]["diverged_predictions"].values())}
    by_model = [f"{evidence.label(m)} {'(diverged)' if m in diverged else signed(b['error_share'])}" for m, b in found.items()]
    label, astray = evidence.label(list(found)[-1]), list(found)[-1] in diverged
    interval, known = (None, None) if astray else (block["interval_share"], block.get("interval_W"))
    between = f" ({signed(interval[0])} to {signed(interval[1])} over loops, 95 %)" if interval else ""
    held = known and known[0] <= block["measured_mean_W"] <= known[1]
    says = (
        f" With what other loops show of it, and from what is known of parameters and wind, {label} says {number(known[0] * KILO)} to "
        f"{number(known[1] * KILO)} kW (90 %), which {'holds' if held else 'does not hold'} the measured value."
        if known
        else ""
    )
    over = f"{block['seconds']:.0f} of {block['loop_seconds']:.0f} s of {block['loops']} test {evidence.parts.of}"
    measured = Link(FIGURE, f"{number(block['measured_mean_W'] * KILO)} kW")
    errors = f" measured; predicted power is off by: {', '.join(by_model)}{between}.{says}"
    return f"Mean mechanical power over {over}: ", measured, errors


def power_figure(evidence: Evidence) -> Figure | str:
    """Energy of every test loop, predicted against measured, on one scale; on the diagonal a model is right."""
    found = powers(evidence)
    if not found:
        return ""
    data = []
    for model, block in found.items():
        rows = block["by_loop"]
        label = f"{evidence.label(model)}, {signed(block['error_share'])}"
        data.append(
            dots(
                [row["measured_J"] * KILO for row in rows], [row["predicted_J"] * KILO for row in rows], label, COLOURS[model], size=9,
                text=[f"loop {row['loop']}, {row['seconds']:.1f} of {row['of_seconds']:.1f} s" for row in rows],
                hovertemplate=hover("%{text}", "measured %{x:.3g} kJ, predicted %{y:.3g} kJ", aside=evidence.label(model)),
            )
        )  # fmt: skip
    shown = [v for t in data for v in (*t["x"], *t["y"])]
    ends = [min(shown), max(shown)]
    data.insert(0, line(ends, ends, "as measured", COLOURS["measured"], width=1, dash="dot", hoverinfo="skip"))
    layout = {"xaxis": axis("energy of a loop, measured [kJ]"), "yaxis": axis("predicted [kJ]"), "margin": {"t": 24}}
    return Figure(
        FIGURE, "Energy of every loop, measured and predicted", data, layout, split=f"test {evidence.parts.of}", height=300,
        note="Tension times reel-out speed, over what predictions cover of a loop. The percentages are errors of the mean power.",
    )  # fmt: skip


def signed(share: float | None) -> str:
    """A share with its sign, in percent: +3.2 %, −28.7 %."""
    if share is None:
        return "–"
    text = percent(abs(share)) if abs(share) < 0.01 else f"{100 * abs(share):.1f} %"
    return f"{'+' if share >= 0 else '−'}{text}"
