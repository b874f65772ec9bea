"""The thesis' published numbers beside those of a run: Rositani (2025), sections 6.1 to 6.3 and figures 2 to 4.

The flights differ (the thesis' is a measured one of KM1 that is not public), and so do the closed loops: the columns say how far each
recipe came on its own flight, not which is better.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Body, Cell, Folded, Group, Paragraph, table
from awescli.reporting.words import channel, number

INITIAL, IDENTIFIED, ADAM, HYBRID = "initial", "identified", "hybrid, Adam alone", "hybrid"


@dataclass(frozen=True)
class Published:
    """NRMSE of a channel before and after a step, and the models that these are."""

    before: float | None
    after: float
    models: tuple[str, str]


NUMBERS: Mapping[str, Published] = {
    "rudder": Published(None, 0.0181, ("", "law at the measured states")),
    "phi": Published(0.453, 0.377, (INITIAL, IDENTIFIED)),
    "theta": Published(0.447, 0.377, (INITIAL, IDENTIFIED)),
    "psi": Published(0.313, 0.287, (INITIAL, IDENTIFIED)),
    "p_n": Published(0.127, 0.080, (ADAM, HYBRID)),
    "p_e": Published(0.078, 0.061, (ADAM, HYBRID)),
    "p_d": Published(0.188, 0.150, (ADAM, HYBRID)),
    "u": Published(0.143, 0.055, (IDENTIFIED, HYBRID)),
    "v": Published(0.237, 0.088, (IDENTIFIED, HYBRID)),
    "w": Published(0.121, 0.057, (IDENTIFIED, HYBRID)),
}
"""Channel -> what the thesis reports of it (18 s between re-initialisations, closed loop)."""


def beside_thesis(scores: Mapping, controller: Mapping | None, hybrid: Mapping | None) -> list[dict]:
    """Rows of the table: channel, step, the thesis' NRMSE before and after it, and this run's on its test loops; None where a model is not
    there. scores: evaluate's metrics; controller, hybrid: metrics of fit-controller and train-hybrid."""
    trained = ((hybrid or {}).get("comparison") or {}).get("test") or {}
    of = {name: scores[name]["nrmse"]["test"] for name in (INITIAL, IDENTIFIED, HYBRID) if name in scores} | {ADAM: trained.get("adam", {})}
    law = ((controller or {}).get("nrmse") or {}).get("test") or {}
    rows = []
    for name, p in NUMBERS.items():
        before, after = (law.get(name) if name == "rudder" and model else of.get(model, {}).get(name) for model in p.models)
        step = " -> ".join(m for m in p.models if m)
        rows.append({"channel": name, "step": step, "thesis_before": p.before, "thesis_after": p.after, "before": before, "after": after})
    return rows


def published(evidence: Evidence) -> Body:
    """The table on the page; nothing where evaluate was not asked for it."""
    rows = evidence.scores.get("beside_thesis") or []
    if not rows:
        return ""
    note = Paragraph(
        "NRMSE (share of the range) as Rositani (2025) reports it of a measured flight of KM1, and as this run has it on the test loops of "
        "this one. The two are different flights, in different wind, with other noise: read each column from step to step, not one against "
        "the other.", "soft",
    )  # fmt: skip
    head = ("channel", "step", "thesis: before", "thesis: after", "here: before", "here: after")
    keys = ("thesis_before", "thesis_after", "before", "after")
    cells = [(channel(r["channel"]), r["step"], *(Cell("–" if r[k] is None else number(r[k]), r[k]) for k in keys)) for r in rows]
    return Folded("Beside the thesis' published numbers", Group("tab-thesis", "", (note, table(head, cells))))
