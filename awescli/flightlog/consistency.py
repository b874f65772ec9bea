"""Do the signals tell one story? Each check is one physical identity between signals, averaged over a second against noise."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from awescli.flightlog.clocks import clock_offset, moving_average
from awescli.flightlog.log import FlightLog
from awescli.flightlog.phases import range_rate
from awescli.flightlog.wind_at import wind_ned
from awescli.notation.frames import rotate_back, rotation_body_to_ned

AVERAGE = 1.0
"""s: contradictions that last shorter are noise."""

STEEP = np.deg2rad(75.0)
"""Pitch beyond which Euler rates are not compared: their noise grows without bound at 90 deg."""

GRAVITY = 9.80665

Signal = np.ndarray


@dataclass(frozen=True)
class Check:
    """One named number against its threshold: ok where |value| <= threshold; sentence: what it means."""

    name: str
    value: float
    unit: str
    threshold: float
    ok: bool
    sentence: str


def consistency_checks(log: FlightLog, airborne: np.ndarray) -> list[Check]:
    """All checks that the log has the signals for. airborne: (N,) bool, the samples to look at."""
    where = airborne & log.valid
    # a second around anything invalid would mix filled values into the averages
    where &= moving_average((~log.valid).astype(float), 2 * _width(log) + 1) == 0
    if where.sum() < 2 * _width(log) + 1:
        return []
    return [check for needs, test in CHECKS if all(n in log for n in needs) for check in test(log, where)]


def _position_velocity(log: FlightLog, where: Signal) -> list[Check]:
    errors = [np.gradient(log[p], log.dt) - log[v] for p, v in (("p_n", "v_n"), ("p_e", "v_e"), ("p_d", "v_d"))]
    value = _rms(log, errors, where)
    checks = [_check("position against velocity", value, "m/s", 0.7, "RMS of d(position)/dt minus velocity.")]
    # a late position shows as an error along the acceleration: d(p)/dt - v = -lag * dv/dt
    smooth = [moving_average(e, _width(log))[where] for e in errors]
    accelerations = [moving_average(np.gradient(log[v], log.dt), _width(log))[where] for v in ("v_n", "v_e", "v_d")]
    if (power := sum(float(a @ a) for a in accelerations)) > where.sum():
        lag = -sum(float(e @ a) for e, a in zip(smooth, accelerations, strict=True)) / power
        checks.append(_check("position lag", lag, "s", 0.05, "By so much the position comes later than the velocity."))
    return checks


def _attitude_rates(log: FlightLog, where: Signal) -> list[Check]:
    phi, theta = log["phi"], log["theta"]
    turn = [np.gradient(np.unwrap(log[n]), log.dt) for n in ("phi", "theta", "psi")]
    seen = (
        turn[0] - turn[2] * np.sin(theta),
        turn[1] * np.cos(phi) + turn[2] * np.sin(phi) * np.cos(theta),
        -turn[1] * np.sin(phi) + turn[2] * np.cos(phi) * np.cos(theta),
    )
    where = where & (np.abs(theta) < STEEP)
    if not where.any():
        return []
    value = np.rad2deg(_rms(log, [s - log[n] for s, n in zip(seen, "pqr", strict=True)], where))
    return [_check("attitude against rates", value, "deg/s", 3.0, "RMS of what the Euler angles do minus p, q, r.")]


def _acceleration_velocity(log: FlightLog, where: Signal) -> list[Check]:
    R = rotation_body_to_ned(log["phi"], log["theta"], log["psi"])
    seen = rotate_back(R, tuple(np.gradient(log[n], log.dt) for n in ("v_n", "v_e", "v_d")))
    errors = [log[n] - s for n, s in zip(("a_x", "a_y", "a_z"), seen, strict=True)]
    value = _rms(log, errors, where)
    gravity = rotate_back(R, (0.0 * log.time, 0.0 * log.time, np.full(len(log), GRAVITY)))
    sentence = "RMS of acceleration minus dv/dt in body axes."
    for sign, what in ((1, "minus"), (-1, "plus")):
        if _rms(log, [e + sign * g for e, g in zip(errors, gravity, strict=True)], where) < 0.5 * value and value > 2.0:
            sentence += f" The log holds the acceleration {what} gravity; the kinematic one is expected."
    return [_check("acceleration against velocity", value, "m/s2", 1.5, sentence)]


def _pitot(log: FlightLog, where: Signal) -> list[Check]:
    if log.wind is None:
        return []
    wind = wind_ned(log.wind, log.time, -log["p_d"])
    expected = np.sqrt(sum((log[n] - w) ** 2 for n, w in zip(("v_n", "v_e", "v_d"), wind, strict=True)))
    error = moving_average(log["V_a"] - expected, _width(log))[where]
    return [
        _check("airspeed bias", float(error.mean()), "m/s", 2.0, "Mean of the pitot airspeed minus |velocity - recorded wind|."),
        _check("airspeed scatter", float(error.std()), "m/s", 2.5, "Its standard deviation: gusts, wind at other heights, pitot errors."),
    ]


def _tether_range(log: FlightLog, where: Signal) -> list[Check]:
    error = moving_average(log["tether_length"] - _range(log), _width(log))[where]
    return [
        _check("tether length bias", float(error.mean()), "m", 10.0, "Mean of tether length minus range: offset of the drum, sag."),
        _check("tether length scatter", float(error.std()), "m", 1.5, "Its standard deviation: sag, stretch, drum errors, late clocks."),
    ]


def _reeling(log: FlightLog, where: Signal) -> list[Check]:
    error = np.gradient(log["tether_length"], log.dt) - log["reel_out_speed"]
    return [
        _check("reel-out speed against length", _rms(log, [error], where), "m/s", 0.3, "RMS of d(tether length)/dt minus reel-out speed.")
    ]


def _winch_clock(log: FlightLog, where: Signal) -> list[Check]:
    first, last = np.flatnonzero(where)[[0, -1]]
    seen = clock_offset(range_rate(log)[first:last], log["reel_out_speed"][first:last], log.dt)
    if seen is None or seen.correlation < 0.7:
        return []
    sentence = f"By so much the winch records late against the range (correlation {seen.correlation:.2f}, unmoved {seen.unshifted:.2f})."
    value = seen.late if seen.clear else 0.0
    return [_check("winch clock", value, "s", 0.3, sentence if seen.clear else f"No clear offset shows. {sentence}")]


CHECKS: tuple[tuple[tuple[str, ...], Callable[[FlightLog, Signal], list[Check]]], ...] = (
    (("p_n", "p_e", "p_d", "v_n", "v_e", "v_d"), _position_velocity),
    (("phi", "theta", "psi", "p", "q", "r"), _attitude_rates),
    (("a_x", "a_y", "a_z", "v_n", "v_e", "v_d", "phi", "theta", "psi"), _acceleration_velocity),
    (("V_a", "v_n", "v_e", "v_d", "p_d"), _pitot),
    (("tether_length", "p_n", "p_e", "p_d"), _tether_range),
    (("tether_length", "reel_out_speed"), _reeling),
    (("reel_out_speed", "p_n", "p_e", "p_d"), _winch_clock),
)
"""Signals a check needs, and the check."""


def _width(log: FlightLog) -> int:
    return max(1, int(round(AVERAGE / log.dt)))


def _range(log: FlightLog) -> Signal:
    return np.sqrt(log["p_n"] ** 2 + log["p_e"] ** 2 + log["p_d"] ** 2)


def _rms(log: FlightLog, errors, where: Signal) -> float:
    """Root mean square length of an error vector averaged over AVERAGE, where asked."""
    return float(np.sqrt(sum((moving_average(e, _width(log))[where] ** 2).mean() for e in errors)))


def _check(name: str, value: float, unit: str, threshold: float, sentence: str) -> Check:
    return Check(name, value, unit, threshold, bool(abs(value) <= threshold), sentence)
