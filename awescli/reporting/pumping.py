"""Pumping cycles that a model flew: what each phase and cycle earned, and the power curve of every model."""

from collections.abc import Sequence

from awescli.reporting.evidence import Document, Evidence
from awescli.reporting.marks import Body, Cell, Group, table
from awescli.reporting.plots import Figure, axis, line
from awescli.reporting.words import COLOURS, number

KILO = 1e-3
FIGURE = "fig-power-curve"


def cycles(evidence: Evidence) -> Body:
    """The table of phases and the power curve; nothing for a flight without phases."""
    flown = evidence.flown or {}
    return (cycle_table(flown["phases"], flown["cycles"]) if flown.get("phases") else "", power_curve(evidence))


def earned(flown: Document) -> str:
    """What the cycles earned, in a sentence."""
    whole = flown["cycles"]
    if not whole:
        return "No pumping cycle came to its end."
    what = f"{len(whole)} pumping cycle{'s' if len(whole) > 1 else ''}, mean power {number(flown['mean_cycle_W'] * KILO)} kW"
    if interval := flown.get("mean_cycle_interval_W"):
        what += f" (90 % of {flown['draws_flown']} kites that might be this one and fly: {' to '.join(number(w * KILO) for w in interval)})"
    measured = flown.get("measured_cycle_W")
    return f"{what}; measured cycles: {', '.join(number(w * KILO) for w in measured)} kW." if measured else f"{what}."


def cycle_table(phases: Sequence[Document], whole: Sequence[Document]) -> Group:
    """A row for each phase, then one for each whole cycle."""
    rows = [
        (
            f"cycle {row['cycle']}, {row.get('phase', 'whole')}", _cell(row["to_s"] - row["from_s"]), _cell(row["mean_W"] * KILO),
            _cell(row["energy_J"] * KILO), _cell(row["mean_tension_N"] * KILO),
            Cell(f"{number(row['from_m'])} to {number(row['to_m'])}", row["to_m"]), row.get("ended_by", "").replace("_", " "),
        )
        for row in (*phases, *whole)
    ]  # fmt: skip
    head = ("part", "lasts [s]", "mean power [kW]", "energy [kJ]", "mean tension [kN]", "line [m]", "ended by")
    return Group("tab-cycles", "Phases and cycles", table(head, rows))


def _cell(value: float) -> Cell:
    return Cell(number(value), value)


def _kilo(value: float | None) -> float | None:
    return None if value is None else value * KILO


def power_curve(evidence: Evidence) -> Figure | str:
    """Mean cycle power against wind speed, with a band over what each model's parameters might be."""
    curve = (evidence.flown or {}).get("power_curve")
    if not curve:
        return ""
    data = []
    for model, rows in curve.items():
        label, colour = evidence.label(model), COLOURS[model]
        banded = [row for row in rows if row["low_W"] is not None]
        winds = [row["wind_m_s"] for row in banded]
        shaded = {"type": "scatter", "mode": "lines", "x": winds, "hoverinfo": "skip", "showlegend": False, "line": {"width": 0}}
        data += [
            {**shaded, "y": [row["low_W"] * KILO for row in banded], "name": f"{label}, 5 %"},
            {**shaded, "y": [row["high_W"] * KILO for row in banded], "name": f"{label}, 95 %", "fill": "tonexty",
             "fillcolor": f"{colour}/0.18"},
            line([row["wind_m_s"] for row in rows], [_kilo(row["mean_W"]) for row in rows], label, colour, width=2),
        ]  # fmt: skip
    draws = max(row["draws"] for rows in curve.values() for row in rows)
    band = f" Band: 5 to 95 % of those of {draws} kites that fly, drawn from what is known of the parameters; few cycles scatter too."
    height = evidence.free_flight["wind"].get("height", 10.0)
    layout = {"xaxis": axis(f"wind speed at {number(height)} m [m/s]"), "yaxis": axis("mean cycle power [kW]", zeroline=True)}
    return Figure(
        FIGURE, "Power curve: mean cycle power in closed loop", data, layout, split="simulated", height=360,
        note=f"Phases, surfaces and winch as the plan says, the first cycle left out. A gap: the kite is lost.{band if draws else ''}",
    )  # fmt: skip
