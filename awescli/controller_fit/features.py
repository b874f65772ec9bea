"""Which features a controller looks at: compared as sets, then each one on trial: what does the fit lose without it?"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from awescli.control.features import FEATURE_SETS, check_features
from awescli.control.gaussian_law import design
from awescli.controller_fit.centres import farthest_points, thin
from awescli.controller_fit.problem import Problem, Score, pose, score_linear
from awescli.controller_fit.samples import Samples, available, thinned
from awescli.notation.errors import BadInput, did_you_mean

TRIAL_ROWS, TRIAL_CENTRES, TRIAL_WIDTH, TRIAL_RIDGE = 1500, 60, 1.4, 1e-5
"""The quick stand-in for a fit that features are judged by: a fixed Gaussian basis, 0.1 s a trial."""


WORTH, MOST_CHOICES = 1.5, 2
"""Sets whose stand-in scores within this share of the best are worth a whole fit; at most so many."""

ADDED = 0.8
"""A feature is added to a set where that lowers the score to this share: what a law sees beyond its set is one more thing that may leave
the flown range. None is left out of a set: between known loops a set that is cut down scores as well, and beyond them it is worse."""


def trial_regressors(problem: Problem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(smoothed, measured, ahead) regressors of the stand-in."""
    rows = problem.X[problem.rows]
    centres = rows[farthest_points(rows, TRIAL_CENTRES)]
    width = TRIAL_WIDTH * np.sqrt(rows.shape[1])
    smoothed, measured, ahead = (design(x, centres, width) for x in (rows, problem.M[problem.rows], problem.M[problem.ahead]))
    return smoothed, measured, ahead


def trial_score(samples: Samples, features: tuple[str, ...], folds: int) -> Score:
    """Score of the stand-in on `features`."""
    problem = pose(samples, features, folds, TRIAL_ROWS)
    return score_linear(problem, *trial_regressors(problem), [TRIAL_RIDGE])[TRIAL_RIDGE]


@dataclass(frozen=True)
class Choice:
    """features: names; score: of the stand-in; how: what was done, in a sentence; steps: additions."""

    features: tuple[str, ...]
    score: Score
    how: str
    steps: list


def rank_features(samples: Samples, wanted: str | Sequence[str], folds: int, additions: tuple[str, ...]) -> tuple[list[Choice], dict]:
    """(choices worth a whole fit, best first, report). wanted: the name of a set, 'auto', or a sequence of feature names.

    A choice within WORTH of the best may be the one that flies, or that the whole fit prefers: the stand-in is quick, not final.
    """
    if isinstance(wanted, str) and wanted != "auto":
        if wanted not in FEATURE_SETS:
            raise BadInput(f"unknown feature set '{wanted}'", do=did_you_mean(wanted, [*FEATURE_SETS, "auto"]))
        wanted = FEATURE_SETS[wanted]
    if wanted != "auto":
        check_features(wanted)
        kept, notes = available(samples, wanted)
        return [Choice(kept, trial_score(thinned(samples, TRIAL_ROWS), kept, folds), "fixed by the user", [])], {"sets": {}, "notes": notes}
    samples = thinned(samples, TRIAL_ROWS)
    sets, notes = {}, []
    for name, names in FEATURE_SETS.items():
        kept, said = available(samples, names)
        sets[name] = (kept, trial_score(samples, kept, folds))
        notes += said
    extra, best, choices = available(samples, additions)[0], min(score.value for _, score in sets.values()), []
    for name in sorted(sets, key=lambda name: sets[name][1].value)[:MOST_CHOICES]:
        kept, score = sets[name]
        if score.value > WORTH * best:
            break
        steps: list = []
        kept, score = _add(samples, kept, score, folds, extra, steps)
        choices.append(Choice(kept, score, f"set '{name}', then features tried for addition", steps))
    return sorted(choices, key=lambda c: c.score.value), {
        "sets": {name: {"features": list(kept)} | s.row() for name, (kept, s) in sets.items()}, "notes": notes,
    }  # fmt: skip


def feature_report(samples: Samples, choice: Choice, folds: int) -> dict:
    """Which features were kept, and why each."""
    samples = thinned(samples, TRIAL_ROWS)
    return {"chosen": list(choice.features), "how": choice.how, "steps": choice.steps, "reasons": _reasons(samples, choice.features, folds)}


def _add(
    samples: Samples, kept: tuple[str, ...], score: Score, folds: int, candidates: Sequence[str], steps: list[dict]
) -> tuple[tuple[str, ...], Score]:
    """Add the most helpful candidate while it lowers the score to ADDED."""
    while rest := [c for c in candidates if c not in kept]:
        scores = {c: trial_score(samples, (*kept, c), folds) for c in rest}
        best = min(scores, key=lambda c: scores[c].value)
        if scores[best].value > ADDED * score.value:
            break
        steps.append({"added": best, "score_before": score.value, "score_after": scores[best].value})
        kept, score = (*kept, best), scores[best]
    return kept, score


def _reasons(samples: Samples, kept: tuple[str, ...], folds: int) -> dict[str, dict]:
    """For each kept feature what its omission costs: the reason it is there."""
    if len(kept) < 2:
        return {name: {"score_without": None, "cost_of_omission": None} for name in kept}
    score = trial_score(samples, kept, folds).value
    without = {f: trial_score(samples, tuple(k for k in kept if k != f), folds).value for f in kept}
    return {f: {"score_without": w, "cost_of_omission": w / score - 1.0} for f, w in without.items()}


def estimate_delay(samples: Samples, features: Sequence[str], folds: int, most_steps: int = 6) -> dict:
    """Shift between state and set-point by held-out error: u(t) = K(z(t - delay)), delay = 0..most_steps samples.

    A delay is believed only where it lowers the score by a tenth: along a smooth flight a shifted state predicts almost as well.
    """
    problem = pose(samples, tuple(features), folds, TRIAL_ROWS)
    regressors, scores = trial_regressors(problem), []
    for shift in range(most_steps + 1):
        U = problem.U[np.minimum(np.arange(problem.U.shape[0]) + shift, problem.U.shape[0] - 1)]
        scores.append(score_linear(problem, *regressors, [TRIAL_RIDGE], U)[TRIAL_RIDGE].value)
    best = int(np.argmin(scores))
    delay = best * samples.dt if scores[best] < 0.9 * scores[0] else 0.0
    return {"delay_s": delay, "scores": scores, "step_s": samples.dt}


def observed_rates(samples: Samples) -> dict[str, dict]:
    """Fastest set-point change per surface, and whether it is a limit: a limiter makes many samples move at exactly that rate."""
    rows = np.flatnonzero(samples.train[1:] & samples.train[:-1])
    rates = np.abs(np.diff(samples.set_points, axis=0))[rows] / samples.dt
    top = rates.max(axis=0)
    share = (rates > 0.999 * top).mean(axis=0)
    return {
        s: {"fastest": float(t), "share_at_fastest": float(h), "limited": bool(h > 0.01)}
        for s, t, h in zip(samples.surfaces, top, share, strict=True)
    }


def observed_limits(samples: Samples, given: dict, margin: float) -> dict[str, tuple[float, float]]:
    """Saturation [rad] per surface: as given, else where set-points pile up (1 % at the extreme), else the flown range and a margin."""
    rows = thin(np.flatnonzero(samples.train | samples.validation), 50_000)
    result = {}
    for i, surface in enumerate(samples.surfaces):
        u = samples.set_points[rows, i]
        low, high, span = float(u.min()), float(u.max()), float(np.ptp(u))
        piled = [float((np.abs(u - edge) < 1e-6 * span).mean()) > 0.01 for edge in (low, high)]
        own = (low if piled[0] else low - margin * span, high if piled[1] else high + margin * span)
        result[surface] = tuple(float(x) for x in given.get(surface, own))
    return result
