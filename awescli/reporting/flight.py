"""The flight: its path in space, what it was doing when, the wind, and how good the data are."""

import numpy as np

from awescli.flightlog.log import runs_of
from awescli.flightlog.split import PARTS
from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Body, Cell, Chip, Code, Folded, Group, Heading, Paragraph, Section, bullets, table
from awescli.reporting.plots import Figure, axis, grid, hover, line, scene, stride, strip, swatch
from awescli.reporting.wind_profile import wind_profile
from awescli.reporting.words import COLOURS, channel, number, percent

PHASE_COLOURS = {
    "ground": "@grey", "hover": "@ochre", "traction": "@green", "retraction": "@purple", "transition": "@steel", "flight": "@green",
}  # fmt: skip
MOST = 6000
"""Points of a path in space."""


def flight(evidence: Evidence) -> Section:
    log, quality = evidence.log, evidence.quality
    counts = ", ".join(f"{n} {part}" for n, part in zip(evidence.parts.counts, PARTS, strict=True))
    facts = (
        f"{log.name}: {quality.duration:.1f} s at {quality.rate:.3g} Hz, {quality.samples} samples. {quality.loops}, "
        f"dealt whole to the three parts: {counts}. Models are fitted to train, chosen on validation, judged on test."
    )
    air = timeline(evidence), wind(evidence), wind_profile(evidence)
    body = Paragraph(facts), path(evidence), *air, checks(evidence), ranges(evidence), signals(evidence)
    return Section("flight", "The flight", body)


def path(evidence: Evidence) -> Figure:
    """The measured path, coloured by part."""
    log, step = evidence.log, stride(len(evidence.log), MOST)
    owner = np.full(len(log), -1)
    for k, part in enumerate(PARTS):
        for first, last in getattr(evidence.parts, part):
            owner[first:last] = k
    data = []
    for k, name in ((-1, f"outside the {evidence.parts.of}"), *enumerate(PARTS)):
        here = owner == k
        if not here.any():
            continue
        # a part goes one sample on, so that the path has no holes where parts meet
        here[1:] |= here[:-1]
        x, y, z = (np.where(here, s, np.nan)[::step] for s in (log["p_e"], log["p_n"], -log["p_d"]))
        data.append({
            "type": "scatter3d", "mode": "lines", "x": x, "y": y, "z": z, "name": name,
            "line": {"color": COLOURS.get(name, "@grey/0.6"), "width": 3 if name in PARTS else 1.5},
            "hovertemplate": hover("east %{x:.1f} m, north %{y:.1f} m, up %{z:.1f} m", aside=name),
        })  # fmt: skip
    data.append({
        "type": "scatter3d", "mode": "markers", "x": [0], "y": [0], "z": [0], "name": "winch" if log.on_line else "origin",
        "marker": {"size": 5, "color": COLOURS["measured"], "symbol": "diamond"},
    })  # fmt: skip
    return Figure(
        "fig-3d-flight", "The measured path", data,
        {"scene": scene(log["p_e"], log["p_n"], -log["p_d"], winch=log.on_line), "margin": {"l": 0, "r": 0, "t": 0, "b": 0}},
        split="whole flight, by part", note="Drag to turn, scroll or pinch to come nearer.", height=460,
    )  # fmt: skip


def timeline(evidence: Evidence) -> Figure:
    """Height and tether length over time, with phases below and parts above."""
    log, step = evidence.log, stride(len(evidence.log))
    t, height = log.time[::step], -log["p_d"][::step]
    data = [line(t, height, "height above the winch" if log.on_line else "height", COLOURS["measured"])]
    if "tether_length" in log:
        data.append(line(t, log["tether_length"][::step], "tether length", COLOURS["floor"], dash="dot"))
    shapes = []
    for part in PARTS:
        data.append(swatch(part, COLOURS[part]))
        shapes += [strip(log.time[a], log.time[b - 1], 0.955, 1.0, COLOURS[part]) for a, b in getattr(evidence.parts, part)]
    for name in [p for p in PHASE_COLOURS if (evidence.phases == p).any()]:
        data.append(swatch(name, PHASE_COLOURS[name], "phase: "))
        shapes += [strip(log.time[a], log.time[b - 1], 0.0, 0.045, PHASE_COLOURS[name]) for a, b in runs_of(evidence.phases == name)]
    spent = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in evidence.quality.phases.items())
    return Figure(
        "fig-timeline", "Height over time", data, {"xaxis": axis("time [s]"), "yaxis": axis("[m]", rangemode="tozero"), "shapes": shapes},
        split="whole flight", note=f"Strip above: parts; strip below: phases ({spent}).", height=300, linked="flight",
    )  # fmt: skip


def wind(evidence: Evidence) -> Body:
    """Speed and direction as recorded, per height."""
    record = evidence.log.wind
    if record is None:
        return Paragraph("The log has no wind record.", "absent")
    step = stride(len(record.time))
    shown = np.unique(np.linspace(0, len(record.height) - 1, min(len(record.height), 5)).astype(int))
    shades = ["@blue", "@green", "@ochre", "@red", "@purple"]
    inside = (record.time >= evidence.log.time[0] - 60) & (record.time <= evidence.log.time[-1] + 60)
    inside = inside if inside.any() else np.ones(len(record.time), bool)
    t = record.time[inside][::step]
    panels = []
    for id, title, unit, values in (
        ("fig-wind-speed", "Wind speed", "m/s", record.speed),
        ("fig-wind-direction", "Wind direction, where it comes from", "°", turns(np.degrees(record.direction))),
    ):
        data = [
            line(t, values[inside, k][::step], f"{record.height[k]:.0f} m", shades[i % 5], mode="lines+markers", marker={"size": 3})
            for i, k in enumerate(shown)
        ]
        layout = {"xaxis": axis("time [s]"), "yaxis": axis(f"[{unit}]"), "showlegend": True}
        panels.append(Figure(id, title, data, layout, split="whole flight", height=230, part=True))
    mean = f"Mean wind {number(float(record.speed[inside].mean()))} m/s at the recorded heights."
    return grid(panels), Paragraph(mean)


def turns(degrees: np.ndarray) -> np.ndarray:
    """The same directions, by whole turns moved to where their mean is a compass bearing (0 to 360)."""
    return degrees - 360 * np.floor(degrees.mean() / 360)


def checks(evidence: Evidence) -> Group:
    """The named numbers that data must keep, those that it does not keep first."""
    rows = [
        (c.name, Cell(f"{number(c.value)} {c.unit}", c.value), Cell(f"{number(c.threshold)} {c.unit}", c.threshold),
         Cell(Chip("passed", "good") if c.ok else Chip("look here", "bad"), str(c.ok)), c.sentence)
        for c in sorted(evidence.quality.checks, key=lambda c: (c.ok, not c.stops))
    ]  # fmt: skip
    body = table(("check", "value", "limit", "", "what it means"), rows)
    left = {k: v for k, v in evidence.quality.left_out.items() if v > 0}
    out = Paragraph(f"Left out: {', '.join(f'{k} {v:.1f} s' for k, v in left.items())}.") if left else ()
    return Group("tab-quality", "Data quality", (out, body))


def ranges(evidence: Evidence) -> Body:
    """What each part flew, so that nobody reads a test that left train as one that did not."""
    rows = [
        (r.name, r.unit, *(Cell(f"{number(low)} to {number(high)}", high) for low, high in (r.train, r.validation, r.test)),
         Cell(f"{r.validation_reach:.2f}", r.validation_reach), Cell(f"{r.test_reach:.2f}", r.test_reach))
        for r in evidence.quality.ranges
    ]  # fmt: skip
    if not rows:
        return ""
    content = (
        "Smallest and largest of each part; then how far validation and test go in times of what train flew: magnitudes of rates and "
        "deflections, and for the others the range of both together."
    )
    head = ("quantity", "unit", *PARTS, "validation goes", "test goes")
    return Group("tab-ranges", "Ranges of the parts", (Paragraph(content), table(head, rows)))


def signals(evidence: Evidence) -> Folded:
    """Every signal, and what the reader did to the file."""
    rows = [
        (channel(c.name), Cell(Code(c.name), c.name), c.unit, Cell(number(c.low), c.low), Cell(number(c.high), c.high),
         Cell(number(c.noise, 2), c.noise), c.group)
        for c in evidence.quality.channels
    ]  # fmt: skip
    head = ("signal", "name", "unit", "smallest", "largest", "white noise (1 std)", "clock")
    notes = bullets(evidence.quality.notes)
    content = (Heading("What the reader did"), notes) if notes else ()
    valid = Paragraph(f"{percent(float(evidence.log.valid.mean()))} of the samples are valid.")
    return Folded(f"All {len(rows)} signals, ranges and noise", (valid, table(head, rows), content))
