"""The wind that a flight itself shows: airspeed against velocity over ground, over all directions flown."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from awescli.flightlog.log import FlightLog, WindRecord
from awescli.flightlog.phases import FLYING_SPEED, phases

TURNED = np.pi
"""rad of course that must have been flown: the wind and the scale of the pitot are one on a straight leg."""

MOST = 5000
"""Samples that are used: a mean over minutes needs no more."""

LASTS = 5.0
"""s over which gusts are taken to be one error: what is left of the triangle averages out in so many independent pieces."""

STILL_AIR = 1.225
"""kg/m3 where nobody knows better: sea level, International Standard Atmosphere."""


@dataclass(frozen=True)
class Triangle:
    """Mean wind north and east [m/s] with standard deviation `std` [m/s], the scale of the airspeed, and the rms that is left [m/s]."""

    north: float
    east: float
    scale: float
    std: float
    rest: float


def wind_triangle(log: FlightLog) -> Triangle | None:
    """The constant wind w and scale s that make V_a = s |v - w| over the flown time (soft l1: gusts are no outliers, dropouts are); None
    where the log has no airspeed, does not fly, or does not turn."""
    if any(n not in log for n in ("V_a", "v_n", "v_e", "v_d")):
        return None
    use = np.flatnonzero(log.valid & ~np.isin(phases(log), ("ground", "hover")) & (log["V_a"] > FLYING_SPEED / 2) & log.is_new("V_a"))
    if use.size < 100 or np.ptp(np.unwrap(np.arctan2(log["v_e"], log["v_n"])[use])) < TURNED:
        return None
    use = use[:: max(1, use.size // MOST)]
    n, e, d, V_a = (log[name][use] for name in ("v_n", "v_e", "v_d", "V_a"))

    def left(x):
        return V_a - x[2] * np.sqrt((n - x[0]) ** 2 + (e - x[1]) ** 2 + d**2)

    fit = least_squares(left, [0.0, 0.0, 1.0], loss="soft_l1")
    rest = float(np.sqrt(np.mean(left(fit.x) ** 2)))
    pieces = max(use.size * np.median(np.diff(use)) * log.dt / LASTS, 4.0)
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac) * use.size * rest**2 / pieces
    north, east, scale = (float(x) for x in fit.x)
    return Triangle(north, east, scale, float(np.sqrt(max(covariance[0, 0], covariance[1, 1]))), rest)


def with_some_wind(log: FlightLog, density: float | None) -> FlightLog:
    """The log with a wind record: its own, or the mean wind of its triangle, or none at all with a note that says how to estimate it."""
    if log.wind is not None:
        return log if log.wind.density is not None or density is None else replace(log, wind=_dense(log.wind, density))
    seen = wind_triangle(log)
    if seen is None:
        north = east = 0.0
        note = (
            "The log has no wind, and no airspeed on a flight that turns to find it from: it is taken for zero. To estimate it, declare "
            "how uncertain that is in the kite file: `wind: {law: uniform, std: 5, direction_std: 3.1}`."
        )
    else:
        north, east = seen.north, seen.east
        note = (
            f"The log has no wind: airspeed against velocity over ground gives a mean of {north:.1f} m/s north, {east:.1f} m/s east "
            f"(+-{seen.std:.1f}), with an airspeed that reads {seen.scale:.3f} of the true one; {seen.rest:.1f} m/s rms are left (gusts)."
        )
    height = np.array([float(max(-np.median(log["p_d"][phases(log) != "ground"]), 1.0)) if (phases(log) != "ground").any() else 10.0])
    both = np.ones((2, 1))
    speed, direction = both * np.hypot(north, east), both * np.arctan2(-east, -north) * float(seen is not None)
    record = WindRecord(log.time[[0, -1]], height, speed, direction, 0.0 * both, np.full(2, STILL_AIR if density is None else density))
    return replace(log, wind=record, notes=(*log.notes, note), groups={**log.groups, "wind": "weather"})


def _dense(wind: WindRecord, density: float) -> WindRecord:
    return replace(wind, density=np.full(wind.time.size, density))
