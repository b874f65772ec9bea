"""A model flown on its own: the simulated path beside the measured one (Rositani (2025), figure 5), and how far they come apart."""

import numpy as np

from awescli.flightlog.split import PARTS
from awescli.notation.angles import wrap
from awescli.notation.quantities import ANGLES
from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Body, Cell, Chip, Group, Keys, Paragraph, Section, Words, absent, table
from awescli.reporting.plots import PANEL_POINTS, Figure, Shared, axis, grid, line, scene, stride
from awescli.reporting.pumping import cycles, earned
from awescli.reporting.words import COLOURS, channel, listed, number, percent, scale_of

SURFACES = {
    "controller": "the fitted controller moves the surfaces",
    "recorded": "the recorded set-points move the surfaces",
    "path_following": "a built-in law moves the surfaces along the circle that was flown",
}
CHANNELS = ("p_d", "V_a", "tension", "phi", "theta", "r")
"""Shown over time."""


def free_flight(evidence: Evidence) -> Section:
    title = "Flown on its own"
    if evidence.flown is None or evidence.trajectory is None:
        return Section("flown", title, absent("awes simulate", "no model was flown on its own"))
    body = Paragraph(sentence(evidence)), *cycles(evidence), path(evidence), apart(evidence), over_time(evidence), scores(evidence)
    return Section("flown", title, body)


def sentence(evidence: Evidence) -> Words:
    """What flew, on what, how long."""
    f = evidence.free_flight
    pumping = bool(f.get("phases"))
    sees = "the wind" if pumping or not evidence.log.on_line else "winch and wind"
    state = Chip("flew on", "good") if f["outcome"] == "flew_on" else Chip("departed", "bad")
    text = [
        f" {evidence.label(flying(evidence)).capitalize()}: it set out from the measured state at {number(f['start_s'])} s "
        f"and flew {number(f['survived_s'])} s of {number(f['asked_s'])} s; {SURFACES[f['surfaces']]}. "
        f"Besides, it sees only {sees} of the flight."
    ]
    if pumping:
        text.append(f"{earned(f)} Phases, surfaces and winch are the plan's, so the two need not agree.")
    unseen = f.get("unseen_s", f["asked_s"])
    if unseen < min(f["survived_s"], float(evidence.log.time[-1]) - f["start_s"]) - evidence.log.dt:
        text.append(f"The first {number(unseen)} s of the comparison are test {evidence.parts.of}; what follows was seen by some stage.")
    if f["effects"]:
        text.append(f"Effects switched on: {listed(list(f['effects']))}.")
    if made_wind(evidence):
        asked = {"speed": "m/s", "direction": "°"}
        wind = ", ".join(f"{k} {number(f['wind'][k])} {unit}" for k, unit in asked.items() if f["wind"][k] is not None)
        text.append(f"It flew in another wind than the measured flight ({wind}), so the two need not agree.")
    return state, " ".join(text)


def flying(evidence: Evidence) -> str:
    """The model that flew; a network that stayed at zero is the physics."""
    return evidence.same_as(evidence.free_flight["model"])


def made_wind(evidence: Evidence) -> bool:
    return any(evidence.free_flight["wind"][k] is not None for k in ("speed", "direction"))


def split_of(evidence: Evidence) -> str:
    """The parts of the flight that the simulated time runs through."""
    t = evidence.free_path["time"]
    time = evidence.log.time
    touched = [
        p for p in PARTS if any(time[a] <= t[-1] and time[b - 1] >= t[0] for a, b in getattr(evidence.parts, p))
    ]  # fmt: skip
    beyond = " and beyond the log" if t[-1] > time[-1] + evidence.log.dt else ""
    return f"{listed(touched)} {evidence.parts.of}{beyond}" if touched else "outside the parts"


def path(evidence: Evidence) -> Figure:
    """The flown path as in Rositani (2025), figure 5."""
    arrays, data = evidence.free_path, []
    for which, name, colour in (("measured", "measured", "@ink"), ("simulated", evidence.label(flying(evidence)), tone(evidence))):
        n, e, d = (arrays[f"{which}_{c}"][:: stride(len(arrays[f"{which}_{c}"]), 4000)] for c in ("p_n", "p_e", "p_d"))
        data.append({
            "type": "scatter3d", "mode": "lines", "x": e, "y": n, "z": -d, "name": name, "line": {"color": colour, "width": 4},
        })  # fmt: skip
    data.append({
        "type": "scatter3d", "mode": "markers", "x": data[1]["x"][:1], "y": data[1]["y"][:1], "z": data[1]["z"][:1], "name": "start",
        "marker": {"size": 4, "color": "@ink"},
    })  # fmt: skip
    ends = [np.concatenate([t[k] for t in data]) for k in "xyz"]
    return Figure(
        "fig-3d-flown", "Measured path, and the path that the model flies by itself", data,
        {"scene": scene(*ends), "margin": {"l": 0, "r": 0, "t": 0, "b": 0}},
        split=split_of(evidence), note="Drag to turn; a click in the legend shows or hides a path.", height=480,
    )  # fmt: skip


def tone(evidence: Evidence) -> str:
    return COLOURS[flying(evidence)]


def apart(evidence: Evidence) -> Figure:
    """Distance between the two over time."""
    arrays = evidence.free_path
    reach = len(arrays["measured_p_n"])
    away = np.sqrt(sum((arrays[f"measured_{c}"] - arrays[f"simulated_{c}"][:reach]) ** 2 for c in ("p_n", "p_e", "p_d")))
    step = stride(reach)
    data = [line(arrays["time"][:reach][::step], away[::step], evidence.label(flying(evidence)), tone(evidence), showlegend=False)]
    return Figure(
        "fig-apart", "How far the two come apart", data, {"xaxis": axis("time [s]"), "yaxis": axis("distance [m]", rangemode="tozero")},
        split=split_of(evidence), note="Distance between the two at the same moment.", height=240,
        linked="flown",
    )  # fmt: skip


def over_time(evidence: Evidence) -> Body:
    """Some channels of both."""
    arrays, label, panels = evidence.free_path, evidence.label(flying(evidence)), []
    step = stride(len(arrays["time"]), PANEL_POINTS)
    for name in (n for n in CHANNELS if f"measured_{n}" in arrays):
        simulated = arrays[f"simulated_{name}"]
        measured = np.full(len(simulated), np.nan)  # beyond the log there is none
        measured[: len(arrays[f"measured_{name}"])] = arrays[f"measured_{name}"]
        unit, factor = scale_of(name, measured)
        if name in ANGLES:
            simulated = wrap(simulated)
        data = [
            line("$flown_time", measured[::step] * factor, "measured", COLOURS["measured"], width=2, meta="measured"),
            line("$flown_time", simulated[::step] * factor, label, tone(evidence), meta=label),
        ]
        layout = {"xaxis": axis("time [s]"), "yaxis": axis(f"[{unit}]" if unit else ""), "showlegend": False, "margin": {"t": 24}}
        panels.append(
            Figure(f"fig-flown-{name}", channel(name), data, layout, split=split_of(evidence), height=220, linked="flown", part=True)
        )
    entries = [("measured", COLOURS["measured"], "solid"), (label, tone(evidence), "solid")]
    return Shared("flown_time", arrays["time"][::step]), Keys(tuple(entries), "flown"), grid(panels)


def scores(evidence: Evidence) -> Body:
    """Error of the one long simulation against how long it has flown."""
    f = evidence.free_flight
    away = f["path_error_m"]
    rows = [
        (Cell(f"{h} s", float(h)), Cell(percent(block["mean"]), block["mean"]), Cell(number(away[h]), away[h]))
        for h, block in f["nrmse"].items()
    ]
    head = ("after", "mean NRMSE of the 12 states", "RMS distance from the measured path [m]")
    return Group("tab-flown", "", table(head, rows)) if rows else ""
