"""What to do next: what would tell rivals apart, what bounds say, what the flight did not show."""

from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Code, Link, Paragraph, Section, Strong, Words, bullets
from awescli.reporting.words import effect_words, listed


def next_steps(evidence: Evidence) -> Section:
    items = [
        *_rivals(evidence),
        *_parameters(evidence),
        *_controller(evidence),
        *_data(evidence),
        *_untestable(evidence),
        *_missing(evidence),
    ]
    return Section("next", "What to do next", bullets(items) or Paragraph("Nothing: the model predicts this flight to its noise."))


def _rivals(evidence: Evidence) -> list[Words]:
    effects = evidence.effects or {}
    items: list[Words] = [(Strong("To tell rivals apart."), f" {s}") for s in effects.get("separate", [])]
    if effects.get("verdict") == "found":
        kept = Code("trace-residual/kite.yaml")
        items.append((Strong("Use the model."), " ", kept, " holds the kite with the effect and its new values."))
    if effects.get("outside_bounds"):
        text = f" {listed(list(effects['outside_bounds']))}: the flight asks for values outside them."
        items.append((Strong("Correct bounds in the kite file."), text))
    if effects.get("verdict") == "unexplained":
        text = " The empirical terms say in which channel it acts and with what it grows; the physics is open."
        items.append((Strong("Name what is left."), text))
    if effects.get("verdict") == "not_deterministic":
        text = " or log the wind at the kite's height: what is left differs from loop to loop."
        items.append((Strong("Fly in calmer air,"), text))
    return items


def _parameters(evidence: Evidence) -> list[Words]:
    """Advice of params.json, one line per kind: thirty equal sentences help nobody."""
    by_advice: dict[str, list[str]] = {}
    for name, p in ((evidence.params or {}).get("parameters") or {}).items():
        # what ran to its bound without the effect says nothing more once the effect is there
        if p.get("advice") and not (p.get("at_bound") and evidence.tracing_added):
            kind = "known only together with others" if p["advice"].startswith("known only together") else p["advice"]
            by_advice.setdefault(kind, []).append(name)
    shown = Link("tab-parameters", "table")
    return [(Strong(f"{listed(names)}:"), f" {kind} (", shown, ").") for kind, names in by_advice.items()]


def _controller(evidence: Evidence) -> list[Words]:
    proof = (evidence.controller or {}).get("closed_loop") or {}
    if proof.get("outcome") != "departs":
        return []
    shown = Link("fig-survival", "how long it flies")
    text = " does not hold the declared model (", shown, "): try ", Code("awes simulate"), " with the newest model."
    return [(Strong("The controller"), text)]


def _data(evidence: Evidence) -> list[Words]:
    shown = Link("tab-quality", "table")
    return [(Strong(f"Data, {c.name}:"), f" {c.sentence} (", shown, ")") for c in evidence.quality.checks if not c.ok]


def _untestable(evidence: Evidence) -> list[Words]:
    names = [effect_words(*_split(k)) for k in (evidence.effects or {}).get("not_testable", [])]
    text = f" because this flight could not show them apart from the parameters: {listed(names)}."
    return [(Strong("Not tested,"), text)] if names else []


def _split(key: str) -> tuple[str, str]:
    name, _, target = key.partition(":")
    return name, target


def _missing(evidence: Evidence) -> list[Words]:
    steps = (
        (evidence.controller, "awes fit-controller", "the control law"), (evidence.params, "awes identify", "the parameters"),
        (evidence.effects, "awes trace-residual", "what the model lacks"),
    )  # fmt: skip
    return [(Strong("Not run yet:"), " ", Code(command), f" finds {what}.") for found, command, what in steps if found is None]
