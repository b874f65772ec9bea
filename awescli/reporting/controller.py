"""The controller: how well the fitted law repeats what was flown, and whether it flies."""

import numpy as np

from awescli.flightlog.split import PARTS
from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Body, Cell, Folded, Group, Paragraph, Section, absent, table
from awescli.reporting.plots import Figure, axis, dots, hover, line, stride
from awescli.reporting.words import COLOURS, listed, number, percent

OUTCOMES = {
    "flies": "In closed loop with the declared model it completes the required time from every start.",
    "does_not_fly": "In closed loop with the declared model it does not fly.",
    "departs": "In closed loop with the declared model it departs before the required time from at least one start.",
}


def controller(evidence: Evidence) -> Section:
    title = "The controller"
    if evidence.controller is None:
        return Section(
            "controller", title, absent("awes fit-controller", "no control law was fitted; set-points are replayed from the log")
        )
    against = tuple(law_against_log(evidence, s) for s in evidence.commanded)
    body = Paragraph(sentence(evidence)), fit_table(evidence), against, survival(evidence), steering(evidence), features(evidence)
    return Section("controller", title, body)


def sentence(evidence: Evidence) -> str:
    """What the law is."""
    report = evidence.fitted_controller
    names = report.get("surfaces", [])
    seen = (report.get("features") or {}).get("chosen", [])
    delay = (report.get("delay") or {}).get("delay_s")
    law = f"A {report.get('kind', 'fitted')} law with {report.get('nonzeros', '?')} terms"
    text = f"{law} drives {listed(list(names))} from {len(seen)} quantities"
    return f"{text}{f', delayed by {number(delay)} s' if delay else ''}."


def fit_table(evidence: Evidence) -> Group:
    """NRMSE per surface and part, with the share that noise in the law's inputs explains."""
    report, rows = evidence.fitted_controller, []
    head = ["surface"]
    for part in PARTS:
        head += [part, f"{part}: noise"]
    for surface in report.get("surfaces", []):
        row: list = [surface]
        for part in PARTS:
            for key in ("nrmse", "noise_nrmse"):
                value = ((report.get(key) or {}).get(part) or {}).get(surface)
                row.append(Cell(percent(value), value))
        rows.append(row)
    note = Paragraph(
        "NRMSE of the set-point, in percent of its range; beside it, what the sensor noise in the law's inputs alone would cause.", "soft"
    )
    return Group("tab-controller", "", (note, table(head, rows)))


def law_against_log(evidence: Evidence, surface: str) -> Body:
    """Measured and commanded set-point over the test part."""
    log = evidence.log
    if surface not in log:
        return ""
    rows = np.concatenate([np.append(np.arange(a, b), -1) for a, b in evidence.parts.test])
    gap = rows < 0
    step = stride(len(rows))
    degrees = lambda values: np.where(gap, np.nan, np.degrees(values[rows]))[::step]  # noqa: E731
    t = np.where(gap, np.nan, log.time[rows])[::step]
    data = [
        line(t, degrees(log[surface]), "flown", COLOURS["measured"]),
        line(t, degrees(evidence.commanded[surface]), "law, at the measured states", COLOURS["with_effects"]),
    ]
    return Figure(
        f"fig-law-{surface}", f"{surface.capitalize()}: flown, and what the law commands", data,
        {"xaxis": axis("time [s]"), "yaxis": axis(f"{surface} [°]")}, split=f"test {evidence.parts.of}", height=280, linked="test",
    )  # fmt: skip


def survival(evidence: Evidence) -> Body:
    """How long the law flies the model by itself, from several starts."""
    proof = evidence.fitted_controller.get("closed_loop") or {}
    flown, starts = proof.get("survival_s") or [], proof.get("starts_s") or []
    if not flown or len(flown) != len(starts):
        return ""
    asked = proof.get("asked_s", max(flown))
    text = OUTCOMES.get(outcome := str(proof.get("outcome", "")), outcome)
    error = proof.get("path_error_5s_m")
    text += f" After 5 s it is {number(error)} m off the measured path." if error is not None else ""
    ends = [c for s, f in zip(starts, flown, strict=True) for c in (s, s, None)]
    heights = [c for f in flown for c in (0, f, None)]
    data = [
        line(ends, heights, "flown", COLOURS["initial"], width=3, showlegend=False, hoverinfo="skip"),
        dots(
            list(starts),
            list(flown),
            "flown",
            COLOURS["initial"],
            hovertemplate=hover("from %{x:.0f} s: %{y:.1f} s"),
            showlegend=False,
        ),
    ]
    layout = {
        "xaxis": axis("start in the flight [s]", range=[-1.0, float(evidence.log.time[-1])]),
        "yaxis": axis("flown [s]", range=[0, 1.1 * asked]),
        "shapes": [dict(type="line", xref="paper", x0=0, x1=1, y0=asked, y1=asked, line={"color": "@grey", "dash": "dot"})],
        "annotations": [dict(xref="paper", x=1, y=asked, text="required", showarrow=False, yanchor="top", xanchor="right")],
    }  # fmt: skip
    return Figure(
        "fig-survival", "Closed loop with the declared model", data, layout, split="starts over the whole flight", note=text, height=240
    )


def steering(evidence: Evidence) -> Body:
    """What the law steers for, and what the loop makes of its errors."""
    report = evidence.fitted_controller
    found, gains = report.get("steering") or {}, report.get("gain") or {}
    said = []
    if found.get("circle") == "commanded":
        said.append(f"The commanded circle is {number(found['moved_deg'])}° away from the flown one.")
    if any(source != "does not steer" for source in (found.get("slopes") or {}).values()):
        said.append(
            "The kite hardly left its circle, so the log does not show how the controller corrects it. A law that steers back "
            f"to it was preferred, with {number(report.get('hold', 0.0))} of the weight of the log."
        )
    for surface, gain in gains.items():
        if gain.get("plant_gain") is not None:
            said.append(
                f"A disturbance of the {surface} moves what the law sees by up to {number(gain['plant_gain'])} standard deviations "
                "per rad (measured in closed loop); from one state to the next the law's own error changes by "
                f"{number(gain['gamma_error'])} rad per standard deviation."
            )
    return Paragraph(" ".join(said)) if said else ""


def features(evidence: Evidence) -> Body:
    """What the law sees and why."""
    found = evidence.fitted_controller.get("features") or {}
    reasons = found.get("reasons") or {}
    rows = [
        (name, Cell(percent((reasons.get(name) or {}).get("cost_of_omission")), (reasons.get(name) or {}).get("cost_of_omission")))
        for name in found.get("chosen", [])
    ]
    if not rows:
        return ""
    content = Paragraph(str(found.get("how", ""))), table(("quantity", "error grows without it by"), rows)
    return Folded(f"The {len(rows)} quantities the law sees", content)
