"""Are answers as often right as they say? Pure functions, for every tracing campaign.

    stated(answer_of(effects_json), effects_json["probability"]) -> probability that the answer gives itself
    error(pairs), brier(pairs)   pairs: of (probability, was it right?)

The expected calibration error is the mean distance between how often answers of about the same probability are right and what they say
(Naeini, Cooper & Hauskrecht, AAAI 2015); the Brier score is the mean squared distance of each from what was the case (Brier 1950).
"""

from collections.abc import Iterable, Mapping, Sequence

from exact_scoring import Answer, matches

BINS = 10
NOBODY = ("none", "something_else")
Pair = tuple[float, bool]


def stated(answer: Answer, probability: Mapping[str, float]) -> float:
    """Probability that the causes which an answer names, or that it names none, are the case. probability: cause -> probability, as in
    effects.json; a cause is an effect's key, or several joined by a plus."""
    if answer.named:
        of_parameters = any(acts_on == "parameter" for entry in answer.named for _, acts_on in entry)
        named = sum(p for cause, p in probability.items() if cause not in NOBODY and matches(cause.split("+"), answer.named))
        return named + (probability.get("none", 0.0) if of_parameters else 0.0)
    causes = {"none": ("none",), "not_deterministic": NOBODY}.get(answer.verdict, ("something_else",))
    return sum(probability.get(cause, 0.0) for cause in causes)


def error(pairs: Sequence[Pair], bins: int = BINS) -> float:
    """Expected calibration error; 0 of no answers."""
    return sum(count * abs(said - right) for said, right, count in reliability(pairs, bins)) / max(len(pairs), 1)


def brier(pairs: Sequence[Pair]) -> float:
    """Brier score; 0 of no answers."""
    return sum((p - right) ** 2 for p, right in pairs) / max(len(pairs), 1)


def reliability(pairs: Iterable[Pair], bins: int = BINS) -> list[tuple[float, float, int]]:
    """(mean probability, share that was right, count) of every bin that holds any."""
    held: dict[int, list[Pair]] = {}
    for p, right in pairs:
        held.setdefault(min(int(p * bins), bins - 1), []).append((p, right))
    return [(sum(p for p, _ in of) / len(of), sum(right for _, right in of) / len(of), len(of)) for _, of in sorted(held.items())]


def lines(pairs: Sequence[Pair]) -> list[str]:
    """The calibration of a campaign as Markdown."""
    if not pairs:
        return []
    rows = [f"| {said:.2f} | {right:.2f} | {count} |" for said, right, count in reliability(pairs)]
    return [
        "## Are answers as often right as they say?", "",
        f"{len(pairs)} answers that state a probability: expected calibration error {error(pairs):.3f} ({BINS} bins), Brier score "
        f"{brier(pairs):.3f}. Right: exactly right, or among the rivals of a `cannot_tell`.", "",
        "| stated, mean | right | answers |", "|---|---|---|", *rows, "",
    ]  # fmt: skip
