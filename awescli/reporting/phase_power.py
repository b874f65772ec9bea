"""Power and energy per phase and per cycle, measured and predicted by every model, with intervals: a table."""

from collections.abc import Sequence

from awescli.reporting.evidence import Document, Evidence
from awescli.reporting.marks import Body, Cell, Group, Paragraph, table
from awescli.reporting.power import KILO, powers
from awescli.reporting.words import number

TABLE = "tab-power"
HEAD = ("part of the flight", "predicted [s]", "flight or model", "mean power [kW]", "90 % interval [kW]", "energy [kJ]", "off by [%]")
OF_THE_FITTED_WIND = "they are of the wind that the fit has found, and a value, which is of the wind as it was recorded, may lie outside"
ABOUT = {"free": OF_THE_FITTED_WIND, "measured": OF_THE_FITTED_WIND, "filtered": "they lie about the values"}
"""Where intervals lie, by where predictions begin."""


def phase_table(evidence: Evidence) -> Body:
    """Each phase of unseen flight, then each cycle, as measured and as every model predicts it; empty for a flight without power."""
    found = {m: b for m, b in powers(evidence).items() if b.get("by_phase") or b.get("by_cycle")}
    if not found:
        return ""
    rows = [
        row
        for key, name in (("by_phase", _phase), ("by_cycle", _cycle))
        for same in zip(*(block[key] for block in found.values()), strict=True)
        for row in _beside(name(same[0]), [evidence.label(m) for m in found], same)
    ]
    note = (
        "Tension times reel-out speed; phases of what no stage was fitted to, and whole cycles. The 90 % intervals come from the "
        "covariance of parameters, the error of the wind record, and how the model errs on the loops it was fitted to; "
        f"{ABOUT[evidence.scores.get('initial_states', 'free')]}."
    )
    return Group(TABLE, "Power per phase and cycle", (Paragraph(note, "soft"), table(HEAD, rows)))


def _beside(part: str, labels: Sequence[str], same: Sequence[Document]) -> list[tuple]:
    """A phase or cycle as it was measured, then as every model predicts it."""
    first = same[0]
    seconds = Cell(f"{number(first['seconds'])} of {number(first['of_seconds'])}", first["seconds"])
    measured = (part, seconds, "measured", _kilo(first["measured_mean_W"]), "", _kilo(first["measured_J"]), "")
    return [measured, *((part, seconds, label, *_predicted(row)) for label, row in zip(labels, same, strict=True))]


def _predicted(row: Document) -> tuple:
    """Mean power, its interval, energy, and by how much that is off."""
    interval, measured = row.get("interval_W"), row["measured_J"]
    between = f"{number(interval[0] * KILO)} to {number(interval[1] * KILO)}" if interval else ""
    off = 100 * (row["predicted_J"] - measured) / abs(measured) if measured else None
    return _kilo(row["mean_W"]), between, _kilo(row["predicted_J"]), Cell(number(off), off) if off is not None else ""


def _phase(row: Document) -> str:
    return row["phase"]


def _cycle(row: Document) -> str:
    return f"cycle {row['cycle']}, {100 * row['unseen_share']:.0f} % unseen"


def _kilo(value: float) -> Cell:
    return Cell(number(value * KILO), value * KILO)
