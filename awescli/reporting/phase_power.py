"""Power and energy per phase and per cycle, measured and predicted by every model, with intervals: a table."""

from awescli.reporting.evidence import Document, Evidence
from awescli.reporting.marks import Body, Cell, Group, Paragraph, table
from awescli.reporting.power import KILO, powers
from awescli.reporting.words import number

TABLE = "tab-power"
OF_THE_FITTED_WIND = "they are of the wind that the fit has found, and a value, which is of the wind as it was recorded, may lie outside"
ABOUT = {"free": OF_THE_FITTED_WIND, "measured": OF_THE_FITTED_WIND, "filtered": "they lie about the values"}
"""Where intervals lie, by where predictions begin."""


def phase_table(evidence: Evidence) -> Body:
    """A row for each phase of unseen flight, then one for each cycle; empty for a flight without power."""
    found = {m: b for m, b in powers(evidence).items() if b.get("by_phase") or b.get("by_cycle")}
    if not found:
        return ""
    head = ("part of the flight", "predicted [s]", "measured [kW]", *(f"{evidence.label(m)} [kW]" for m in found), "measured [kJ]")
    head += tuple(f"{evidence.label(m)} [kJ]" for m in found)
    rows = []
    for key, name in (("by_phase", _phase), ("by_cycle", _cycle)):
        for same in zip(*(block[key] for block in found.values()), strict=True):
            seconds = f"{number(same[0]['seconds'])} of {number(same[0]['of_seconds'])}"
            rows.append(
                (
                    name(same[0]), Cell(seconds, same[0]["seconds"]), _kilo(same[0]["measured_mean_W"]), *map(_mean, same),
                    _kilo(same[0]["measured_J"]), *(_kilo(row["predicted_J"]) for row in same),
                )
            )  # fmt: skip
    note = (
        "Tension times reel-out speed; phases of what no stage was fitted to, and whole cycles. In brackets: 90 % intervals from the "
        "covariance of parameters, the error of the wind record, and how far single loops lie apart; "
        f"{ABOUT[evidence.scores.get('initial_states', 'free')]}."
    )
    return Group(TABLE, "Power per phase and cycle", (Paragraph(note, "soft"), table(head, rows)))


def _phase(row: Document) -> str:
    return row["phase"]


def _cycle(row: Document) -> str:
    return f"cycle {row['cycle']}, {100 * row['unseen_share']:.0f} % unseen"


def _kilo(value: float) -> Cell:
    return Cell(number(value * KILO), value * KILO)


def _mean(row: Document) -> Cell:
    """Mean power with its interval."""
    interval = row.get("interval_W")
    between = f" ({number(interval[0] * KILO)} to {number(interval[1] * KILO)})" if interval else ""
    return Cell(f"{number(row['mean_W'] * KILO)}{between}", row["mean_W"] * KILO)
