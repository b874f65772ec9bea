"""What to do next: what would tell rivals apart, what bounds say, what the flight did not show."""

from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Section, bullets, esc, link, paragraph
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
    return Section("next", "What to do next", bullets(items) or paragraph("Nothing: the model predicts this flight to its noise."))


def _rivals(evidence: Evidence) -> list[str]:
    effects = evidence.effects or {}
    items = [f"<b>To tell rivals apart.</b> {esc(s)}" for s in effects.get("separate", [])]
    if effects.get("verdict") == "found":
        items.append("<b>Use the model.</b> <code>trace-residual/kite.yaml</code> holds the kite with the effect and its new values.")
    if effects.get("verdict") == "unexplained":
        items.append(
            "<b>Name what is left.</b> The empirical terms say in which channel it acts and with what it grows; the physics is open."
        )
    if effects.get("verdict") == "not_deterministic":
        items.append("<b>Fly in calmer air,</b> or log the wind at the kite's height: what is left differs from loop to loop.")
    return items


def _parameters(evidence: Evidence) -> list[str]:
    """Advice of params.json, one line per kind: thirty equal sentences help nobody."""
    by_advice: dict[str, list[str]] = {}
    for name, p in ((evidence.params or {}).get("parameters") or {}).items():
        # what ran to its bound without the effect says nothing more once the effect is there
        if p.get("advice") and not (p.get("at_bound") and evidence.tracing_added):
            kind = "known only together with others" if p["advice"].startswith("known only together") else p["advice"]
            by_advice.setdefault(kind, []).append(name)
    return [f"<b>{esc(listed(names))}:</b> {esc(kind)} ({link('tab-parameters', 'table')})." for kind, names in by_advice.items()]


def _controller(evidence: Evidence) -> list[str]:
    proof = (evidence.controller or {}).get("closed_loop") or {}
    if proof.get("outcome") != "departs":
        return []
    shown = link("fig-survival", "how long it flies")
    return [f"<b>The controller</b> does not hold the declared model ({shown}): try <code>awes simulate</code> with the newest model."]


def _data(evidence: Evidence) -> list[str]:
    return [f"<b>Data, {esc(c.name)}:</b> {esc(c.sentence)} ({link('tab-quality', 'table')})" for c in evidence.quality.checks if not c.ok]


def _untestable(evidence: Evidence) -> list[str]:
    names = [effect_words(*_split(k)) for k in (evidence.effects or {}).get("not_testable", [])]
    return [f"<b>Not tested,</b> because this flight could not show them apart from the parameters: {esc(listed(names))}."] if names else []


def _split(key: str) -> tuple[str, str]:
    name, _, target = key.partition(":")
    return name, target


def _missing(evidence: Evidence) -> list[str]:
    steps = (
        (evidence.controller, "awes fit-controller", "the control law"), (evidence.params, "awes identify", "the parameters"),
        (evidence.effects, "awes trace-residual", "what the model lacks"),
    )  # fmt: skip
    return [f"<b>Not run yet:</b> <code>{command}</code> finds {what}." for found, command, what in steps if found is None]
