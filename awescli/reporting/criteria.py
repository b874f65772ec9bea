"""What the verdict stands on: the table of criteria, and how likely each cause is."""

from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Body, Cell, Chip, Group, Paragraph, Tip, bar, table
from awescli.reporting.words import effect_words, listed, number, percent

MARKS = {True: ("yes", "good"), False: ("no", "bad"), None: ("not testable", "")}
CAUSES = {"none": "nothing is missing", "something_else": "something else, not in the library"}


def criteria(evidence: Evidence) -> Body:
    """Every criterion: what was measured, what the threshold is and where it comes from, and whether it is met."""
    rows = [
        (c["says"], Cell(_shown(c["value"])), Cell(_shown(c["threshold"])), Cell(Chip(*MARKS[c["pass"]])), c["source"])
        for c in evidence.traced.get("criteria") or []
    ]
    if not rows:
        return ""
    note = (
        "The verdict follows from this table alone (", Tip("deviance"),
        ": -2 log likelihood, all that is not known integrated out).",
    )  # fmt: skip
    head = ("criterion", "value", "threshold", "met", "source of the threshold")
    return Group("tab-criteria", "Criteria", (Paragraph(note, "soft"), table(head, rows)))


def probabilities(evidence: Evidence) -> Body:
    """How likely each cause is."""
    known = evidence.traced.get("probability") or {}
    rows = [(_cause(name), bar(p, percent(p))) for name, p in known.items()]
    if not rows:
        return ""
    note = "Prior odds even; evidence tempered, as the models that are compared are all approximate."
    head = ("cause", "probability")
    return Group("tab-probability", "How likely is each cause?", (Paragraph(note, "soft"), table(head, rows, sortable=False)))


def _cause(name: str) -> str:
    """A cause in words: one effect, or several that act together."""
    parts = [effect_words(*part.partition(":")[::2]) for part in name.split("+")]
    return CAUSES.get(name) or listed(parts)


def _shown(value: float | str) -> str:
    return value if isinstance(value, str) else number(float(value))
