"""What the verdict stands on: the table of criteria, and how likely each cause is."""

from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Cell, bar, chip, esc, paragraph, table
from awescli.reporting.terms import tip
from awescli.reporting.words import effect_words, listed, number, percent

MARKS = {True: ("yes", "good"), False: ("no", "bad"), None: ("not testable", "")}
CAUSES = {"none": "nothing is missing", "something_else": "something else, not in the library"}


def criteria(evidence: Evidence) -> str:
    """Every criterion: what was measured, what the threshold is and where it comes from, and whether it is met."""
    rows = [
        (c["says"], Cell(_shown(c["value"])), Cell(_shown(c["threshold"])), Cell(chip(*MARKS[c["pass"]])), c["source"])
        for c in evidence.effects.get("criteria") or []
    ]
    if not rows:
        return ""
    said = tip("deviance")
    note = f"The verdict follows from this table alone ({said}: -2 log likelihood, all that is not known integrated out)."
    head = ("criterion", "value", "threshold", "met", "source of the threshold")
    return f'<div id="tab-criteria"><h3>Criteria</h3>{paragraph(note, "soft")}{table(head, rows)}</div>'


def probabilities(evidence: Evidence) -> str:
    """How likely each cause is."""
    known = evidence.effects.get("probability") or {}
    rows = [(_cause(name), bar(p, percent(p))) for name, p in known.items()]
    if not rows:
        return ""
    note = "Prior odds even; evidence tempered, as the models that are compared are all approximate."
    head = ("cause", "probability")
    return f'<div id="tab-probability"><h3>How likely is each cause?</h3>{paragraph(note, "soft")}{table(head, rows, sortable=False)}</div>'


def _cause(name: str) -> str:
    """A cause in words: one effect, or several that act together."""
    parts = [effect_words(*part.partition(":")[::2]) for part in name.split("+")]
    return CAUSES.get(name) or listed(parts)


def _shown(value) -> str:
    return esc(value) if isinstance(value, str) else number(float(value))
