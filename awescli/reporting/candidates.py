"""The candidates of a trace: how much of the residual each explains, and why each was taken or not, in a sentence with its number."""

from typing import Any

from awescli.reporting.evidence import Evidence
from awescli.reporting.marks import Body, Cell, Chip, Folded, Group, Paragraph, bar, table
from awescli.reporting.words import effect_words, number, percent

NO_GAP = 0.02
"""Excess of the chi-square per degree of freedom over 1 below which there is no gap to explain shares of."""
NOT_FITTED, GIVEN_UP, SET_ASIDE = "not fitted", "given up", "set aside"


def ranking(evidence: Evidence) -> Body:
    """Every candidate: how much of the residual it explains, what it gains on unseen loops, why it was taken or not."""
    effects = evidence.traced
    accepted = evidence.added
    # a share of next to nothing says nothing
    gap = (effects.get("chi2") or {}).get("train_before", 2.0) - 1 > NO_GAP
    rivals = [r for e in effects["effects"] for r in e["rivals"]]
    rows = []
    for place, c in enumerate(effects["ranking"], 1):
        known = [a for a in effects["ranking"] if a["name"] == c["name"]]
        taken, rival = among(c, accepted, known), among(c, rivals, known)
        state = Chip("accepted", "good") if taken else Chip("rival", "bad") if rival else ""
        said = effect_words(c["name"], c.get("acts_on", ""))
        fitted = c.get("outcome") not in (NOT_FITTED, GIVEN_UP, SET_ASIDE, "failed")
        gain, share = (c["test_gain"], c["explained_share"]) if fitted else (None, None)
        rows.append((
            Cell(str(place), place), Cell((said, " ", state) if state else said, c["name"]),
            bar(share, percent(share)) if gap and share is not None else Cell("–"), Cell(percent(gain) if fitted else "–", gain),
            Cell(number(c["score"]), c["score"]), Cell(number(c["p_value"], 2), c["p_value"]),
            "yes" if c["plausible_size"] else "no", Cell(because(evidence, c, taken, rival), None, "reason"),
        ))  # fmt: skip
    if not rows:
        return ""
    head = ("", "candidate", "share of the gap it explains", "χ² gain on validation", "score", "p value", "plausible size", "why")
    note = (
        "Every effect of the library, tried on the residual of the declared model, fitted without it. Score: by how much it lowers χ² on "
        "train, to first order; the best were fitted in full and compared on validation loops. The gap is by how much χ² per degree of "
        "freedom lies above 1 on train: what noise does not explain."
    )
    more = Group("detectable", "", detectable(evidence))
    return Group("tab-ranking", "Candidates", (Paragraph(note, "soft"), table(head, rows), more))


def because(evidence: Evidence, c: dict[str, Any], taken: bool, rival: bool) -> str:
    """Why a candidate was taken or not, in one sentence with its number."""
    gain = c.get("deviance_gain")
    led = f"leads the declared model by a deviance of {number(gain)}" if gain is not None else "lowers the error most"
    if taken:
        return f"Taken: it {led}."
    if rival:
        return f"Rival: it {led}, and this flight cannot separate it from the effect that was found."
    if not c.get("significant", True):
        return f"Its score of {number(c['score'])} is within chance for so many candidates (p = {number(c['p_value'], 2)})."
    if c.get("outcome") == "failed":
        return f"Its score of {number(c['score'])} is significant, but its fit failed from every start."
    if c.get("outcome") == NOT_FITTED:
        best = number(_best(evidence, "score"))
        return f"Its score of {number(c['score'])} is significant, but far below the best ({best}): not fitted."
    if c.get("outcome") == GIVEN_UP:
        best = f"less than half of the best gain ({number(_best(evidence, 'deviance_gain'))})"
        return f"Its score of {number(c['score'])} is significant, but its fit came to {best}, and was given up."
    if c.get("outcome") == SET_ASIDE and gain and gain > 0:
        return f"It gains a deviance of {number(gain)}, and so may a controller that answers gusts better than the log shows them."
    if not c["plausible_size"]:
        return f"It {led}, but only at the end of its plausible range."
    return _less(evidence, c, gain)


def _less(evidence: Evidence, c: dict[str, Any], gain: float | None) -> str:
    """A candidate that was fitted, and gained too little."""
    if gain is None:
        return f"It explains {percent(c['explained_share'])} of the gap."
    best = _best(evidence, "deviance_gain")
    if evidence.tracing_added and best > gain:
        return f"It gains a deviance of {number(gain)}, {number(best - gain)} less than the best."
    needed = next((row["threshold"] for row in evidence.traced.get("criteria") or [] if row.get("name") == "effect_likelier"), None)
    asked = f"; {number(needed)} over an unnamed model error is required" if isinstance(needed, (int, float)) else ""
    return f"It gains a deviance of {number(gain)}{asked}."


def _best(evidence: Evidence, what: str) -> float:
    """The largest of all candidates, of gains that of those that still contend."""
    contend = (c for c in evidence.traced["ranking"] if what != "deviance_gain" or c.get("outcome") != SET_ASIDE)
    return max((c.get(what) or 0.0 for c in contend), default=0.0)


def detectable(evidence: Evidence) -> Body:
    """The smallest size of each effect that this flight would have shown."""
    seen, units = (evidence.traced.get(key) or {} for key in ("detectable", "detectable_units"))
    shown = {k: units.get(k, {}).get("unit", "-") for k in seen}
    small = [(effect_words(*k.partition(":")[::2]), Cell(f"{number(v)} {'' if shown[k] == '-' else shown[k]}", v)) for k, v in seen.items()]
    title = "What this flight would have shown: smallest size of each effect that stands out"
    return Folded(title, table(("effect", "smallest size"), small)) if small else ""


def among(candidate: dict, named: list, same_name: list) -> bool:
    """Whether a candidate is one of `named`. Its target decides only where several candidates bear the name (actuator_lag on two surfaces):
    elsewhere the two say different things, the surface here, the place in the model there."""
    hits = [e for e in named if e["name"] == candidate["name"]]
    return any(len(same_name) == 1 or e.get("acts_on", "") == candidate.get("acts_on", "") for e in hits)
