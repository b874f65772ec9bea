"""Which features a controller looks at: compared as sets, then each one on trial: what does the fit lose without it?"""

import numpy as np

from awescli.control.features import FEATURE_SETS, check_features
from awescli.control.gaussian_law import design
from awescli.estimation.controller_centres import farthest_points, thin
from awescli.estimation.controller_problem import Score, pose, score_linear
from awescli.estimation.controller_samples import Samples, available
from awescli.notation.errors import BadInput, did_you_mean

POSITION = ("radius_error", "course_error", "p_n", "p_e", "p_d")
"""Never left out by `auto`. Along an undisturbed flight these are nearly functions of the others, so a fit may not miss them; but a
law that is blind to where the circle is fits every log and holds no circle."""

TRIAL_ROWS, TRIAL_CENTRES, TRIAL_WIDTH, TRIAL_RIDGE = 1500, 60, 1.4, 1e-5
"""The quick stand-in for a fit that features are judged by: a fixed Gaussian basis, 0.1 s a trial."""


def trial_regressors(problem):
    """(smoothed, measured, ahead) regressors of the stand-in."""
    rows = problem.X[problem.rows]
    centres = rows[farthest_points(rows, TRIAL_CENTRES)]
    width = TRIAL_WIDTH * np.sqrt(rows.shape[1])
    return tuple(design(x, centres, width) for x in (rows, problem.M[problem.rows], problem.M[problem.ahead]))


def trial_score(samples: Samples, features: tuple[str, ...], folds: int) -> Score:
    """Score of the stand-in on `features`."""
    problem = pose(samples, features, folds, TRIAL_ROWS)
    return score_linear(problem, *trial_regressors(problem), [TRIAL_RIDGE])[TRIAL_RIDGE]


def choose_features(samples: Samples, wanted, folds: int, additions: tuple[str, ...]) -> tuple[tuple[str, ...], dict]:
    """(features, report). wanted: the name of a set, 'auto', or a sequence of feature names."""
    if isinstance(wanted, str) and wanted != "auto":
        if wanted not in FEATURE_SETS:
            raise BadInput(f"unknown feature set '{wanted}'", do=did_you_mean(wanted, [*FEATURE_SETS, "auto"]))
        wanted = FEATURE_SETS[wanted]
    if wanted != "auto":
        check_features(wanted)
        kept, notes = available(samples, wanted)
        return kept, {"chosen": list(kept), "how": "fixed by the user", "notes": notes, "reasons": _reasons(samples, kept, folds)}
    sets, notes = {}, []
    for name, names in FEATURE_SETS.items():
        kept, said = available(samples, names)
        sets[name] = (kept, trial_score(samples, kept, folds))
        notes += said
    start = min(sets, key=lambda name: sets[name][1].value)
    kept, score = sets[start]
    steps = []
    kept, score = _add(samples, kept, score, folds, available(samples, additions)[0], steps)
    kept, score = _drop(samples, kept, score, folds, steps)
    report = {
        "chosen": list(kept),
        "how": f"set '{start}' had the lowest score; then features were tried for addition and omission",
        "sets": {name: {"score": s.value, "cv_nrmse": s.cv, "ahead_nrmse": s.ahead} for name, (_, s) in sets.items()},
        "steps": steps,
        "notes": notes,
        "reasons": _reasons(samples, kept, folds),
    }
    return kept, report


def _add(samples, kept, score, folds, candidates, steps, least_gain: float = 0.97):
    """Add the most helpful candidate while it lowers the score by 3 %."""
    while rest := [c for c in candidates if c not in kept]:
        scores = {c: trial_score(samples, (*kept, c), folds) for c in rest}
        best = min(scores, key=lambda c: scores[c].value)
        if scores[best].value > least_gain * score.value:
            break
        steps.append({"added": best, "score_before": score.value, "score_after": scores[best].value})
        kept, score = (*kept, best), scores[best]
    return kept, score


def _drop(samples, kept, score, folds, steps):
    """Leave out the least useful feature while the score does not rise: a feature that does not help carries only noise."""
    while len(kept) > 2 and (free := [f for f in kept if f not in POSITION]):
        scores = {f: trial_score(samples, tuple(k for k in kept if k != f), folds) for f in free}
        best = min(scores, key=lambda f: scores[f].value)
        if scores[best].value > score.value:
            break
        steps.append({"dropped": best, "score_before": score.value, "score_after": scores[best].value})
        kept, score = tuple(k for k in kept if k != best), scores[best]
    return kept, score


def _reasons(samples, kept, folds) -> dict[str, dict]:
    """For each kept feature what its omission costs: the reason it is there."""
    if len(kept) < 2:
        return {name: {"score_without": None, "cost_of_omission": None} for name in kept}
    score = trial_score(samples, kept, folds).value
    without = {f: trial_score(samples, tuple(k for k in kept if k != f), folds).value for f in kept}
    return {f: {"score_without": w, "cost_of_omission": w / score - 1.0} for f, w in without.items()}


def estimate_delay(samples: Samples, features, folds: int, most_steps: int = 6) -> dict:
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
