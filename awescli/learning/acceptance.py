"""Is a trained correction kept? Judged on validation, in words that name the evidence."""

from collections.abc import Mapping, Sequence

import numpy as np

OUTCOMES = {
    "trained": "the correction lowers the error on flight it was not trained on",
    "budget_reached": "the time budget ended the training; the best weights so far are kept",
    "nothing_to_learn": "physics explains validation nearly to the noise; no correction is better for certain, the network stays null",
    "too_short": "physics leaves something, but this flight is too short to prove a correction of it; the network stays null",
    "no_gain": "no weights lowered the error on validation; the network stays null",
    "diverged": "rollouts diverged with every correction that was tried; the network stays null",
}
TESTS = {"prediction": "the squared error", "chi2": "the squared error with the wind's own error fitted too"}
LEFT = 1.2
"""Chi-square per degree of freedom of physics on validation, starts and wind fitted, beyond which there is something to learn."""
CERTAIN = 3.0
"""Standard errors by which the gain on validation must exceed nothing. Two let through what clean flights gain by chance: the network is
the best of many rounds, chosen on the same segments."""


def gate(predicted: Sequence[np.ndarray], smoothed: Sequence[np.ndarray], material: float) -> tuple[bool, dict]:
    """Is a correction better than physics on validation? Each argument: (physics, hybrid), (K,) costs per segment.

    predicted: errors of predictions from estimated starts; smoothed: chi-square with starts AND a wind error fitted to whole segments. A
    network could learn the mean error of the wind record, which is no effect of the kite and will be another one tomorrow: there must
    still be a gain when the wind may explain it too. Either mean gain must exceed CERTAIN standard errors, and `material` of the cost.
    Neighbouring segments overlap by half, so standard errors are taken with half as many.
    """
    numbers, passed = {}, True
    for name, (physics, hybrid) in (("prediction", predicted), ("chi2", smoothed)):
        gain, independent = physics - hybrid, max(len(physics) / 2, 1)
        error = float(gain.std(ddof=1) / np.sqrt(independent)) if len(gain) > 1 else float(physics.mean())
        need = max(material * float(physics.mean()), CERTAIN * error)
        passed = passed and bool(gain.mean() > need)
        numbers[name] = {"physics": float(physics.mean()), "hybrid": float(hybrid.mean()), "standard_error": error, "needed_gain": need}
    return passed, numbers


def verdict(
    accepted: bool, evidence: Mapping, segments: int, training: float | None, *, diverging: bool, out_of_time: bool
) -> tuple[str, str]:
    """(name in OUTCOMES, sentence). evidence: `gate`'s numbers; segments: that it was judged on; training: squared error that the network
    reached on the segments it was fitted to, over that of physics."""
    if accepted:
        outcome = "budget_reached" if out_of_time else "trained"
    elif diverging:
        outcome = "diverged"
    else:
        outcome = "too_short" if evidence["chi2"]["physics"] > LEFT else "nothing_to_learn"
    sentence = OUTCOMES[outcome]
    if outcome == "too_short":
        # the test that falls shortest of what it asks
        name, p = min(evidence.items(), key=lambda test: (test[1]["physics"] - test[1]["hybrid"]) / max(test[1]["needed_gain"], 1e-300))
        gain = p["physics"] - p["hybrid"]
        sentence += (
            f": on {segments} validation segments {TESTS[name]} {'falls' if gain > 0 else 'rises'} by {abs(gain) / p['physics']:.0%}, "
            f"{gain / max(p['standard_error'], 1e-12):.1f} standard errors where {CERTAIN:g} are asked"
        )
        if training is not None:
            sentence += f", while on training segments it falls by {1 - training:.0%}"
    return outcome, sentence


def ungated(outcome: str, sentence: str, accepted: bool, proved: bool) -> tuple[str, str]:
    """`verdict` where the lowest validation error was enough (no gate), and what the gate would have said."""
    if accepted:
        return outcome, f"{OUTCOMES[outcome]} (no gate; it would have said {'yes' if proved else 'no'})"
    return (outcome, sentence) if outcome == "diverged" else ("no_gain", OUTCOMES["no_gain"])
