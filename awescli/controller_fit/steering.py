"""What a controller steers for: the circle that it commands, and how hard it pulls the kite towards it.

Along an undisturbed flight every feature is nearly a function of the phase, so laws of the same misfit differ in all that holds the kite
on its circle; the smoothest explanation is even the plant turned round (the rudder that makes this rate of turn). Two things are found by
a law of few terms and by no rich one:

    u = k_0 + k_course course_error + k_radius radius_error + k_curvature curvature

the circle in it (a kite flies beside the circle that it is commanded to, by some degrees) and the two slopes. The circle is found by
separable least squares (Golub & Pereyra 1973: for each circle the slopes are linear) and believed where it predicts unseen flight better.
Slopes that would not steer are replaced by those of a kite that returns to its circle over one radius, by the turn-rate law
(Fagiano et al., IEEE TCST 22(4), 2014; Erhard & Strauch, Control Eng. Practice 21, 2013): turn_rate = (g u + c) V + gravity.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from awescli.control.features import evaluate
from awescli.control.pattern import Pattern, arc
from awescli.controller_fit.centres import thin
from awescli.controller_fit.samples import Samples, samples_at

ROWS = 1500
TERMS = ("course_error", "radius_error", "curvature")
LEAST_GAIN = 0.9
"""The commanded circle must lower the few terms' error on unseen flight to this share."""
LOOK_AHEAD = (0.2, 5.0)
"""Radii: k_course / k_radius, the distance at which a kite off its circle is pointed at it, lies within."""
LEAST_SHARE = 0.3
"""A surface steers where it makes at least this share of the standard deviation of the rate of turn."""


@dataclass(frozen=True)
class Steering:
    """pattern: the circle steered for; course [rad/rad], radius [rad/m]: slopes per surface (S,), NaN where a surface does not steer;
    report: how they were found, plain numbers."""

    pattern: Pattern
    course: np.ndarray
    radius: np.ndarray
    report: dict


def find_steering(samples: Samples) -> Steering:
    """The circle and the slopes of the surfaces that steer, from the train part (and the validation part, to believe the circle)."""
    known, ahead = (thin(np.flatnonzero(m), ROWS) for m in (samples.train, samples.validation))
    flown = samples.pattern
    pattern = _commanded(samples, known)
    unseen = ahead if ahead.size else known
    before, after = (_misfit(samples, p, known, unseen) for p in (flown, pattern))
    moved = float(np.hypot(pattern.elevation - flown.elevation, (pattern.azimuth - flown.azimuth) * np.cos(flown.elevation)))
    opening = flown.radius / float(np.linalg.norm([samples.smoothed[n][known] for n in ("p_n", "p_e", "p_d")], axis=0).mean())
    believed = samples.looping and after < LEAST_GAIN * before and moved < opening
    pattern = pattern if believed else flown
    fitted, gains, shares = _slopes(samples, pattern, known), *_turn_rate_law(samples, pattern, known)
    course, radius, source = [], [], {}
    for s, surface in enumerate(samples.surfaces):
        ahead_m = fitted[0, s] / fitted[1, s] if fitted[1, s] else np.inf
        own = pattern.turn / (gains[s] * pattern.radius) if shares[s] > LEAST_SHARE and samples.looping else np.nan
        sound = fitted[0, s] * own > 0 and LOOK_AHEAD[0] < ahead_m / pattern.radius < LOOK_AHEAD[1]
        course.append(fitted[0, s] if sound else own)
        radius.append(fitted[1, s] if sound else own / pattern.radius)
        source[surface] = "does not steer" if np.isnan(own) else "identified" if sound else "turn-rate law"
    report = {
        "circle": "commanded" if believed else "flown",
        "flown_circle": flown.to_dict(),
        "moved_deg": float(np.degrees(moved)) if believed else 0.0,
        "misfit": {"flown": before, "commanded": after},
        "slopes": source,
        "course_rad_per_rad": _numbers(samples.surfaces, course),
        "radius_rad_per_m": _numbers(samples.surfaces, radius),
        "turn_per_metre_and_rad": _numbers(samples.surfaces, gains),
        "share_of_turning": _numbers(samples.surfaces, shares),
    }
    return Steering(pattern, np.array(course), np.array(radius), report)


def _numbers(surfaces: Sequence[str], values: Sequence[float] | np.ndarray) -> dict[str, float | None]:
    return {s: float(v) if np.isfinite(v) else None for s, v in zip(surfaces, values, strict=True)}


def _terms(samples: Samples, pattern: Pattern, rows: np.ndarray) -> np.ndarray:
    """(n, 4) regressors: TERMS and one."""
    columns = evaluate(TERMS, samples_at(samples.smoothed, rows), pattern)
    return np.stack([*columns, np.ones(rows.size)], axis=1)


def _slopes(samples: Samples, pattern: Pattern, rows: np.ndarray) -> np.ndarray:
    """(4, S) coefficients of TERMS and one."""
    A = _terms(samples, pattern, rows)
    length = np.linalg.norm(A, axis=0)
    return np.linalg.lstsq(A / length, samples.set_points[rows], rcond=1e-10)[0] / length[:, None]


def _misfit(samples: Samples, pattern: Pattern, known: np.ndarray, unseen: np.ndarray) -> float:
    """NRMSE of the few terms, fitted on `known`, on `unseen`; mean over surfaces."""
    error = _terms(samples, pattern, unseen) @ _slopes(samples, pattern, known) - samples.set_points[unseen]
    span = np.maximum(np.ptp(samples.set_points[known], axis=0), 1e-12)
    return float(np.mean(np.sqrt((error**2).mean(axis=0)) / span))


def _commanded(samples: Samples, rows: np.ndarray) -> Pattern:
    """The circle that explains the set-points best: direction free, radius the mean arc about it.

    The radius itself is not distinguished from k_0, and needs not be: it only shifts the radius error by a constant."""
    flown, U = samples.pattern, samples.set_points[rows]
    unit = np.maximum(U.std(axis=0), 1e-12)

    def at(x):
        return replace(flown, elevation=flown.elevation + float(x[0]), azimuth=flown.azimuth + float(x[1]))

    def residual(x):
        return ((_terms(samples, at(x), rows) @ _slopes(samples, at(x), rows) - U) / unit).ravel()

    fit = least_squares(residual, [0.0, 0.0], x_scale=0.01, max_nfev=60)
    pattern = at(fit.x)
    return replace(pattern, radius=float(arc(samples_at(samples.smoothed, rows), pattern).mean()))


def _turn_rate_law(samples: Samples, pattern: Pattern, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(g (S,) [1/m/rad], share (S,) of the turning that each surface makes): turn_rate = sum_s g_s u_s V + c V + d + e sin_course."""
    z = samples_at(samples.smoothed, rows)
    turn, speed, course = evaluate(("turn_rate", "speed", "sin_course"), z, pattern)
    A = np.column_stack([samples.set_points[rows] * speed[:, None], speed, np.ones(rows.size), course])
    length = np.linalg.norm(A, axis=0)
    g = (np.linalg.lstsq(A / length, turn, rcond=1e-10)[0] / length)[: len(samples.surfaces)]
    share = np.abs(g) * A[:, : g.size].std(axis=0) / max(float(turn.std()), 1e-12)
    return np.where(g == 0, np.inf, g), share
