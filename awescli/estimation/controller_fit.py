"""The door: fit a flight controller to a log, choose what is open by held-out flight, say how good it is and why."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from awescli.control.law import Law, deflections_of_states
from awescli.control.laws import LAWS
from awescli.estimation.controller_centres import thin
from awescli.estimation.controller_features import choose_features, estimate_delay, observed_limits, observed_rates
from awescli.estimation.controller_gaussian import fit_gaussian
from awescli.estimation.controller_hold import Hold, steering_hold
from awescli.estimation.controller_linear import fit_linear
from awescli.estimation.controller_network import fit_network
from awescli.estimation.controller_noise import NOISE, noise_through_law
from awescli.estimation.controller_problem import blocks, pose
from awescli.estimation.controller_samples import Samples, gather
from awescli.notation.errors import BadInput, did_you_mean

FITS = {"gaussian": fit_gaussian, "network": fit_network, "linear": fit_linear}
"""kind -> (problem, config, hold) -> (fields of the law, report). Only the Gaussian law can be held (linear in its numbers)."""


@dataclass(frozen=True)
class ControllerConfig:
    """Settings of a controller fit.

    kind: one of LAWS; features: a set of FEATURE_SETS, 'auto', or names; surfaces: None for all that move; folds: of whole loops;
    most_nonzeros, candidates, width_factors (times sqrt(number of features)), counts: its basis; condition_limit: of its regression;
    alphas: the convex step's tolerances in units of eps, the first that all but `outliers` of the samples meet; gamma_share: the error's
    Lipschitz bound, as a share of gamma; smooth_window_s: 0 fits to the states as measured; refit_with_validation: after
    all choices are made, use the validation part too; limits: surface -> (lower, upper) [rad]; limit_margin: share of the flown range
    granted beyond it; noise: sensor standard deviations, SI; plant_gain: see controller_bounds.small_gain; hold: strength of the
    slopes of controller_hold where nothing is flown, hold_strengths: those tried where it is; compare: fit all kinds.
    """

    kind: str = "gaussian"
    features: str | tuple[str, ...] = "auto"
    additions: tuple[str, ...] = ("inverse_speed", "range", "wing_along_line", "nose_along_line", "v_d", "reel_out_speed")
    surfaces: tuple[str, ...] | None = None
    folds: int = 4
    most_nonzeros: int = 79
    candidates: int = 200
    counts: tuple[int, ...] = (15, 30, 45, 60)
    width_factors: tuple[float, ...] = (0.9, 1.2, 1.6, 2.1)
    condition_limit: float = 1e6
    alphas: tuple[float, ...] = (1.0, 1.5, 2.0, 3.0)
    outliers: float = 0.05
    gamma_share: float = 0.5
    gain_quantile: float = 1.0
    convex_samples: int = 300
    convex_pairs: int = 200
    smooth_window_s: float = 0.34
    selection_samples: int = 5000
    refit_with_validation: bool = True
    limits: dict = field(default_factory=dict)
    limit_margin: float = 0.5
    noise: dict = field(default_factory=lambda: dict(NOISE))
    plant_gain: float | None = None
    network_width: int = 12
    network_iterations: int = 300
    seed: int = 0
    hold_strengths: tuple[float, ...] = (0.03, 0.06, 0.12, 0.25)
    hold: float = 0.03
    compare: bool = False

    def __post_init__(self):
        if self.kind not in FITS:
            raise BadInput(f"unknown kind of control law '{self.kind}'", do=did_you_mean(self.kind, FITS))
        if self.folds < 2:
            raise BadInput(f"{self.folds} folds", do="Set folds to 2 or more.")


@dataclass(frozen=True)
class ControllerFit:
    """The fitted law and what is to be said about it: plain numbers, ready for JSON."""

    law: Law
    report: dict


def fit_controller(
    log, train_ranges, validation_ranges, config: ControllerConfig | None = None, fly: Callable[[Law], float] | None = None
) -> ControllerFit:
    """Fit the controller of a FlightLog.

    train_ranges, validation_ranges: lists of (first, last) sample numbers, last excluded; every other valid sample is the test part, which
    no choice ever sees: it is scored once, here at the end. fly: law -> share (0..1) of the asked time that it keeps the declared model in
    the air from states of the log, handed down by who can simulate; with it, the strength of the hold is the smallest that flies.
    """
    config = config or ControllerConfig()
    samples = gather(log, train_ranges, validation_ranges, config.surfaces, config.smooth_window_s)
    features, feature_report = choose_features(samples, config.features, config.folds, config.additions)
    problem = pose(samples, features, config.folds, config.selection_samples)
    delay, rates = estimate_delay(samples, features, config.folds), observed_rates(samples)
    limits = observed_limits(samples, config.limits, config.limit_margin)
    common = {
        "surfaces": samples.surfaces,
        "features": features,
        "centre": problem.centre,
        "scale": problem.scale,
        "limits": limits,
        "constants": samples.constants,
        "pattern": samples.pattern,
        "rate_limit": _rate_limit(rates),
        "delay_s": delay["delay_s"],
    }
    kinds = (config.kind, *(k for k in FITS if k != config.kind)) if config.compare else (config.kind,)
    laws, reports = {}, {}
    for kind in kinds:
        strengths = (config.hold,) if fly is None else config.hold_strengths if kind == "gaussian" else (0.0,)
        laws[kind], report = _fit_until_it_flies(kind, problem, config, common, strengths, fly)
        reports[kind] = report | _scores(laws[kind], samples, config)
    report = {
        "kind": config.kind,
        **reports[config.kind],
        "features": feature_report,
        "surfaces": list(samples.surfaces),
        "constants": samples.constants,
        "loops": int(samples.loop.max()) + 1,
        "delay": delay,
        "rates": rates,
        "pattern": samples.pattern.to_dict(),
        "comparison": {kind: _line(r) for kind, r in reports.items()},
    }
    law = laws[config.kind]
    metrics = {key: report[key] for key in ("nrmse", "nrmse_smoothed", "noise_nrmse", "nonzeros", "condition")}
    return ControllerFit(replace(law, metrics=metrics), report)


def _fit_until_it_flies(kind: str, problem, config: ControllerConfig, common: dict, strengths, fly) -> tuple[Law, dict]:
    """The law with the weakest hold that flies all the time it is asked to. Where none does, the declared model may be at fault as well as
    the law, and is no judge: the law with the default hold is kept, and its survival says that it does not fly."""
    tried = []
    for strength in strengths:
        fields, report = FITS[kind](
            problem, config, steering_hold(problem, common["pattern"].radius, strength) if strength > 0 else Hold({}, 0.0)
        )
        law = LAWS[kind](**common, **fields)
        survival = None if fly is None else float(fly(law))
        tried.append((law, report | {"hold": strength, "survival": survival}))
        if survival is None or survival >= 1.0:
            break
    flies = fly is None or tried[-1][1]["survival"] >= 1.0
    law, report = tried[-1] if flies else min(tried, key=lambda t: abs(t[1]["hold"] - config.hold))
    flown = [{"hold": r["hold"], "survival": r["survival"], "nonzeros": r["nonzeros"], **r["chosen_by"]} for _, r in tried]
    return law, report | {"flown": flown}


def _rate_limit(rates: dict) -> float:
    """The fastest limited rate [rad/s], inf where no surface shows a limiter."""
    return max((r["fastest"] for r in rates.values() if r["limited"]), default=float("inf"))


def _line(report: dict) -> dict:
    """One row of the comparison."""
    return {key: report[key] for key in ("nrmse", "nrmse_smoothed", "noise_nrmse", "nonzeros", "condition", "survival")}


def _scores(law: Law, samples: Samples, config: ControllerConfig) -> dict:
    """NRMSE per part and surface with measured states (`nrmse`) and with smoothed ones (`nrmse_smoothed`), and the noise's own share.

    NRMSE = RMSE / (max - min) of the set-point over the part that is scored (seed, section 6).
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
        noise[part] = noise_through_law(law, _at(samples.smoothed, few), config.noise, span, config.seed)
    return {"nrmse": nrmse, "nrmse_smoothed": clean, "noise_nrmse": noise}


def _at(z: dict, rows: np.ndarray) -> dict:
    """z at some samples; what is constant over the flight stays a number."""
    return {name: signal[rows] if np.ndim(signal) else signal for name, signal in z.items()}


def _rmse(law: Law, z: dict, rows: np.ndarray, samples: Samples) -> dict[str, float]:
    """surface -> RMSE [rad] over `rows`, block by block."""
    square = np.zeros(len(samples.surfaces))
    for part in blocks(rows):
        predicted = deflections_of_states(law, _at(z, part))
        square += [((predicted[s] - samples.set_points[part, i]) ** 2).sum() for i, s in enumerate(samples.surfaces)]
    return dict(zip(samples.surfaces, (float(x) for x in np.sqrt(square / rows.size)), strict=True))
