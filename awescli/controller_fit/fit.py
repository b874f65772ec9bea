"""The door: fit a flight controller to a log, choose what is open by held-out flight, say how good it is and why."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.control.law import Law, deflections_of_states
from awescli.control.laws import LAWS
from awescli.controller_fit.centres import thin
from awescli.controller_fit.config import ControllerConfig, too_few_loops
from awescli.controller_fit.convex import fit_convex
from awescli.controller_fit.features import Choice, estimate_delay, feature_report, observed_limits, observed_rates, rank_features
from awescli.controller_fit.gaussian import fit_gaussian
from awescli.controller_fit.hold import steering_hold
from awescli.controller_fit.linear import fit_linear
from awescli.controller_fit.network import fit_network
from awescli.controller_fit.noise import noise_through_law
from awescli.controller_fit.problem import blocks, pose
from awescli.controller_fit.samples import Samples, answered, gather, in_blocks, loops_flown, samples_at
from awescli.controller_fit.steering import Steering, find_steering
from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import Range

FITS = {"gaussian": fit_gaussian, "network": fit_network, "linear": fit_linear}
"""kind -> (problem, config, holds) -> one (fields of the law, report) after the other."""
CONVEX = "convex"
"""A gaussian law by linear programmes alone, where it stands beside the kinds in a comparison."""


@dataclass(frozen=True)
class ControllerFit:
    """The fitted law, what is to be said about it (plain numbers, ready for JSON), and the laws of all kinds that were compared."""

    law: Law
    report: dict
    laws: dict[str, Law]


def fit_controller(
    log: FlightLog,
    train_ranges: Sequence[Range],
    validation_ranges: Sequence[Range],
    config: ControllerConfig | None = None,
    fly: Callable[[Law], float] | None = None,
) -> ControllerFit:
    """Fit the controller of a FlightLog.

    train_ranges, validation_ranges: lists of (first, last) sample numbers, last excluded; every other valid sample is the test part, which
    no choice ever sees: it is scored once, here at the end. fly: law -> share (0..1) of the asked time that it keeps the declared model in
    the air from states of the train and validation parts, handed down by who can simulate; with it, choices are made among laws that fly.
    """
    config = config or ControllerConfig()
    gathered = samples = gather(log, train_ranges, validation_ranges, config.surfaces, config.smooth_window_s)
    limits = observed_limits(samples, config.limits, config.limit_margin)
    rates = observed_rates(samples)
    limited = {surface: r["fastest"] for surface, r in rates.items() if r["limited"]}
    asked = config
    samples, config = _in_folds(answered(samples, 0, limited), asked)
    samples, steering, choices, sets = _seen(samples, config)
    delay = estimate_delay(samples, choices[0].features, config.folds)
    if delay["delay_s"] > 0:
        samples, config = _in_folds(answered(samples, round(delay["delay_s"] / samples.dt), {}), asked)
        samples, steering, choices, sets = _seen(samples, config)
    common = {
        "surfaces": samples.surfaces,
        "limits": limits,
        "constants": samples.constants,
        "pattern": samples.pattern,
        "rate_limits": limited,
        "delay_s": delay["delay_s"],
    }
    attempts = [a for choice in choices for a in _attempts(config.kind, choice, samples, steering, config, common, fly)]
    best = _best(attempts)
    own = CONVEX if (config.kind, config.method) == ("gaussian", CONVEX) else config.kind
    others = [k for k in (*FITS, CONVEX) if k != own] if config.compare else []
    # the other kinds see what the chosen law sees, and are held as firmly: what differs is the class
    alike = replace(config, hold=best.hold, hold_strengths=(best.hold,))
    how = {k: ("gaussian", replace(alike, method=CONVEX)) if k == CONVEX else (k, replace(alike, method="best")) for k in others}
    found = {own: best} | {k: _best(_attempts(kind, best.choice, samples, steering, c, common, fly)) for k, (kind, c) in how.items()}
    reports = {kind: a.report | {"survival": a.survival} | _scores(a.law, samples, config) for kind, a in found.items()}
    report = {
        "kind": config.kind,
        "method": config.method,
        **reports[own],
        "gain": dict(zip(samples.surfaces, best.report.get("gain", []), strict=False)),
        "features": feature_report(samples, best.choice, config.folds) | sets,
        "surfaces": list(samples.surfaces),
        "constants": samples.constants,
        "folds": config.folds,
        "folds_of": "loops" if (samples.loop == gathered.loop).all() else "blocks",
        "loops": int(samples.loop.max()) + 1,
        "delay": delay,
        "rates": rates,
        "pattern": samples.pattern.to_dict(),
        "steering": steering.report,
        "attempts": [a.row() for a in attempts],
        "comparison": {kind: _line(r) for kind, r in reports.items()},
    }
    metrics = {key: report[key] for key in ("nrmse", "nrmse_smoothed", "noise_nrmse", "nonzeros", "condition")}
    return ControllerFit(replace(best.law, metrics=metrics), report, {kind: a.law for kind, a in found.items()})


def _in_folds(samples: Samples, config: ControllerConfig) -> tuple[Samples, ControllerConfig]:
    """(The samples with loops enough for the folds, or blocks of time in their place; settings with no more folds than that). Raises
    BadInput where there are too few."""
    loops = loops_flown(samples)
    if few := too_few_loops(loops, config.folds, config.few_loops):
        raise few
    if loops < config.folds and config.few_loops == "blocks":
        return in_blocks(samples, config.folds), config
    return samples, replace(config, folds=min(loops, config.folds))


def _seen(samples: Samples, config: ControllerConfig) -> tuple[Samples, Steering, list[Choice], dict]:
    """(samples with the circle that is steered for, how it is steered for, choices of features, what was compared)."""
    steering = find_steering(samples)
    samples = replace(samples, pattern=steering.pattern)
    return samples, steering, *rank_features(samples, config.features, config.folds, config.additions)


@dataclass(frozen=True)
class Attempt:
    """One fitted law: features and strength of the hold it was fitted with, and how long it flew (None: nobody asked)."""

    law: Law
    report: dict
    choice: Choice
    hold: float
    survival: float | None

    @property
    def flies(self) -> bool:
        return self.survival is None or self.survival >= 1.0

    @property
    def score(self) -> float:
        score = self.report["chosen_by"]["score"]
        return float("inf") if score is None else score

    def row(self) -> dict:
        return {"features": list(self.choice.features), "hold": self.hold, "survival": self.survival, "nonzeros": self.report["nonzeros"],
                **self.report["chosen_by"]}  # fmt: skip


def _attempts(
    kind: str, choice: Choice, samples: Samples, steering: Steering, config: ControllerConfig, common: dict,
    fly: Callable[[Law], float] | None,
) -> list[Attempt]:  # fmt: skip
    """Attempts with a stronger and stronger hold, until one flies and a stronger hold fits unseen flight no better."""
    problem, attempts = pose(samples, choice.features, config.folds, config.selection_samples), []
    seen = {"features": choice.features, "centre": problem.centre, "scale": problem.scale}
    strengths = (config.hold,) if fly is None else config.hold_strengths
    holds = [steering_hold(samples, problem, steering, strength) for strength in strengths]
    # where nothing is asked, there is nothing to ask more strongly
    holds = holds if holds[0].strength else holds[:1]
    fit = fit_convex if (kind, config.method) == ("gaussian", CONVEX) else FITS[kind]
    for hold, (fields, report) in zip(holds, fit(problem, config, holds), strict=True):
        law = LAWS[kind](**common, **seen, **fields)
        attempt = Attempt(law, report | {"hold": hold.strength}, choice, hold.strength, None if fly is None else float(fly(law)))
        worse = any(a.flies and a.score < attempt.score for a in attempts)
        attempts.append(attempt)
        if worse:
            break
    return attempts


def _best(attempts: list[Attempt]) -> Attempt:
    """Of those that fly, the one with the lowest score on held-out flight: a law that fits a little better and does not fly loses.
    Where none flies, the declared model may be at fault as well as the law: the one that flies longest, and its survival says so."""
    flying = [a for a in attempts if a.flies]
    return min(flying, key=lambda a: a.score) if flying else min(attempts, key=lambda a: (-(a.survival or 0.0), a.score))


def _line(report: dict) -> dict:
    """One row of the comparison."""
    names = ("nrmse", "nrmse_smoothed", "noise_nrmse", "nonzeros", "condition", "hold", "survival")
    return {key: report[key] for key in names}


def _scores(law: Law, samples: Samples, config: ControllerConfig) -> dict:
    """NRMSE per part and surface with measured states (`nrmse`) and with smoothed ones (`nrmse_smoothed`), and the noise's own share.

    NRMSE = RMSE / (max - min) of the set-point over the part that is scored (docs/equations.md (30)).
    """
    parts = {"train": samples.train, "validation": samples.validation, "test": samples.test}
    nrmse, clean, noise = {}, {}, {}
    for part, mask in parts.items():
        rows = np.flatnonzero(mask)
        if not rows.size:
            continue
        U = samples.set_points[rows]
        span = dict(zip(samples.surfaces, (float(s) or 1.0 for s in np.ptp(U, axis=0)), strict=True))
        nrmse[part], clean[part] = (
            {s: e / span[s] for s, e in _rmse(law, z, rows, samples).items()} for z in (samples.measured, samples.smoothed)
        )
        few = thin(rows, 4000)
        noise[part] = noise_through_law(law, samples_at(samples.smoothed, few), config.noise, span, config.seed)
    return {"nrmse": nrmse, "nrmse_smoothed": clean, "noise_nrmse": noise}


def _rmse(law: Law, z: dict, rows: np.ndarray, samples: Samples) -> dict[str, float]:
    """surface -> RMSE [rad] over `rows`, block by block."""
    square = np.zeros(len(samples.surfaces))
    for part in blocks(rows):
        predicted = deflections_of_states(law, samples_at(z, part))
        square += [((predicted[s] - samples.set_points[part, i]) ** 2).sum() for i, s in enumerate(samples.surfaces)]
    return dict(zip(samples.surfaces, (float(x) for x in np.sqrt(square / rows.size)), strict=True))
