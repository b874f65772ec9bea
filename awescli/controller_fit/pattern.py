"""The circle that a flight follows, and the loops it is made of, from the log."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from awescli.control.pattern import Pattern, arc, place


def fit_pattern(z: Mapping[str, Any], keep: np.ndarray, most: int = 4000) -> Pattern:
    """Least-squares circle on the sphere around the winch: the arc from the centre direction is a constant radius [m].

    z: mapping of arrays (N,); keep: (N,) bool, the samples to use. The sense of turning is the sign of the mean phase rate.
    """
    rows = np.flatnonzero(keep)
    rows = rows[:: max(1, rows.size // most)]
    thin = {name: z[name][rows] for name in ("p_n", "p_e", "p_d")}
    P = np.stack([thin["p_n"], thin["p_e"], thin["p_d"]], axis=1)
    c = (P / np.linalg.norm(P, axis=1)[:, None]).mean(axis=0)
    elevation, azimuth = float(np.arctan2(-c[2], np.hypot(c[0], c[1]))), float(np.arctan2(c[1], c[0]))
    radius = arc(thin, Pattern(elevation, azimuth, 0.0)).mean()
    # the radius in units of itself, so that all unknowns are of order one; soft_l1: an entry or exit manoeuvre must not move the circle
    fit = least_squares(
        lambda x: arc(thin, Pattern(x[0], x[1], 0.0)) / radius - x[2], [elevation, azimuth, 1.0], loss="soft_l1", f_scale=0.05, max_nfev=60
    )
    pattern = Pattern(float(fit.x[0]), float(fit.x[1]), float(fit.x[2] * radius))
    growth = np.diff(phase(z, pattern))[keep[1:] & keep[:-1]].mean()
    return Pattern(pattern.elevation, pattern.azimuth, pattern.radius, 1.0 if growth >= 0 else -1.0)


def phase(z: Mapping[str, np.ndarray], pattern: Pattern) -> np.ndarray:
    """Unwrapped phase on the circle (N,) [rad]."""
    _, right, up, _ = place(z, pattern)
    return np.unwrap(np.arctan2(right, up))


def loop_numbers(z: Mapping[str, Any], pattern: Pattern) -> np.ndarray:
    """Which loop each sample belongs to, (N,) int, counted from the first sample of the flight."""
    angle = pattern.turn * phase(z, pattern)
    # a kite that wobbles backwards over the loop's border has not begun an earlier loop
    return np.floor((np.maximum.accumulate(angle) - angle[0]) / (2 * np.pi)).astype(int)
