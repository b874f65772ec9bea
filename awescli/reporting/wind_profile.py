"""The kite as a wind sensor: speed and direction against height that the fitted model and the pitot say, beside the station."""

from collections.abc import Sequence

from awescli.reporting.evidence import Document, Evidence
from awescli.reporting.marks import Body
from awescli.reporting.plots import Figure, axis, dots, grid, line
from awescli.reporting.words import COLOURS

HALF = 1.645
"""Standard deviations to either side that hold 90 %."""


def wind_profile(evidence: Evidence) -> Body:
    """Two panels; nothing where no fitted model shows a wind."""
    found = evidence.scores.get("wind_profile")
    if not found:
        return ""
    note = (
        f"What {evidence.label(found['model'])} needs to fly the measured flight: the record with its errors, smoothed gusts, effects on "
        "the wind. Bars: 90 %."
    )
    quantities = (("speed", "speed_m_s", "wind speed [m/s]"), ("direction", "direction_deg", "comes from [°]"))
    return grid([_panel(evidence, found, *quantity, note if i == 0 else "") for i, quantity in enumerate(quantities)])


def _panel(evidence: Evidence, found: Document, name: str, key: str, title: str, note: str) -> Figure:
    rows, colour = found["rows"], COLOURS[found["model"]]
    heights = [row["height_m"] for row in rows]
    data = [line([row[f"station_{key}"] for row in rows], heights, "station, as declared", COLOURS["measured"], width=2)]
    if all(f"pitot_{key}" in row for row in rows):
        data.append(_with_bars(rows, f"pitot_{key}", f"pitot_{name}_std", "pitot and motion alone", "@steel"))
    data.append(_with_bars(rows, key, f"{name}_std", evidence.label(found["model"]), colour))
    layout = {"xaxis": axis(title), "yaxis": axis("height [m]")}
    return Figure(
        f"fig-wind-{name}", f"The wind's {name} against height", data, layout, split="whole flight", note=note, height=340, part=True
    )


def _with_bars(rows: Sequence[Document], key: str, std: str, label: str, colour: str) -> dict:
    bars = dict(array=[HALF * row[std] for row in rows], thickness=1.4, width=0, color=colour)
    return dots([row[key] for row in rows], [row["height_m"] for row in rows], label, colour, size=7, error_x=bars)
