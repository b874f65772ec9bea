"""Do the signals tell one story? Each check is one physical identity between signals, averaged over a second against noise."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from awescli.flightlog.clocks import clock_offset, moving_average
from awescli.flightlog.log import FlightLog
from awescli.flightlog.phases import range_rate
from awescli.flightlog.units import GRAVITY
from awescli.flightlog.wind_at import wind_ned
from awescli.notation.frames import rotate_back, rotation_body_to_ned

AVERAGE = 1.0
"""s: contradictions that last shorter are noise."""

STEEP = np.deg2rad(75.0)
"""Pitch beyond which Euler rates are not compared: their noise grows without bound at 90 deg."""

NOT_THIS = 0.5
"""Share of its own RMS by which a rate, a velocity may miss what it is the derivative of: beyond, it is not that derivative. A position
0.3 s late in loops of 9 s misses by 0.2."""

NO_ACCELERATION = 6.0
"""m/s2: an accelerometer that is tilted by 0.1 rad misses 50 m/s2 by 5; gravity that was left in or taken out misses by 9.8."""

NOT_ON_THIS_LINE = 0.2
"""Share of the range by which a tether length may miss it: an unset drum, not another quantity."""

REELED = {"": 1.0, "with the other sign": -1.0, "in kt": 1852 / 3600, "in km/h": 1 / 3.6, "in ft/s": 0.3048, "in cm/s": 0.01}
"""Readings of a reel-out speed -> factor to m/s."""

FAR_BETTER, FAR_OFF = 0.3, 0.6
"""Share of its misfit that another reading must leave, and share of the signal that the log's own must miss, for a channel to be refused.
A latency of 0.3 s in loops of 9 s makes a rate miss by 0.2 of its size, whatever the reading."""

MAPPING = "Look at the columns' names, units, signs and clock; map them in a flight.yaml (`format: csv`)."

Signal = np.ndarray


@dataclass(frozen=True)
class Check:
    """One named number against its two limits, and what it means.

    ok: within `threshold` (|value| at most that, or at least that for what there must be enough of); stops: beyond `stop`, where nothing
    that is fitted to the log would mean anything (`stop` None: it only warns); do: what to do then.
    """

    name: str
    value: float
    unit: str
    threshold: float
    ok: bool
    sentence: str
    stop: float | None = None
    stops: bool = False
    do: str = ""


def most(name: str, value: float, unit: str, warn: float, stop: float | None, sentence: str, do: str = "") -> Check:
    """A check that is ok where |value| <= warn and stops where |value| > stop."""
    size = abs(value)
    return Check(name, float(value), unit, float(warn), bool(size <= warn), sentence, stop, stop is not None and bool(size > stop), do)


def least(name: str, value: float, unit: str, warn: float, stop: float | None, sentence: str, do: str = "") -> Check:
    """A check that is ok where value >= warn and stops where value < stop."""
    return Check(name, float(value), unit, float(warn), bool(value >= warn), sentence, stop, stop is not None and bool(value < stop), do)


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
    speed = _size([log[v] for v in ("v_n", "v_e", "v_d")], where)
    checks = [most("position against velocity", value, "m/s", 0.7, NOT_THIS * speed, "RMS of d(position)/dt minus velocity.", MAPPING)]
    # a late position shows as an error along the acceleration: d(p)/dt - v = -lag * dv/dt
    smooth = [moving_average(e, _width(log))[where] for e in errors]
    accelerations = [moving_average(np.gradient(log[v], log.dt), _width(log))[where] for v in ("v_n", "v_e", "v_d")]
    if (power := sum(float(a @ a) for a in accelerations)) > where.sum():
        lag = -sum(float(e @ a) for e, a in zip(smooth, accelerations, strict=True)) / power
        checks.append(most("position lag", lag, "s", 0.05, 1.0, "By so much the position comes later than the velocity.", MAPPING))
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
    stop = max(3.0, NOT_THIS * np.rad2deg(_size([log[n] for n in "pqr"], where)))
    return [most("attitude against rates", value, "deg/s", 3.0, stop, "RMS of what the Euler angles do minus p, q, r.", MAPPING)]


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
    return [most("acceleration against velocity", value, "m/s2", 1.5, NO_ACCELERATION, sentence, MAPPING)]


def _pitot(log: FlightLog, where: Signal) -> list[Check]:
    if log.wind is None:
        return []
    wind = wind_ned(log.wind, log.time, -log["p_d"])
    expected = np.sqrt(sum((log[n] - w) ** 2 for n, w in zip(("v_n", "v_e", "v_d"), wind, strict=True)))
    error, half = moving_average(log["V_a"] - expected, _width(log))[where], NOT_THIS * float(expected[where].mean())
    said = (
        "Mean of the pitot airspeed minus |velocity - recorded wind|.",
        "Its standard deviation: gusts, wind at other heights, pitot errors.",
    )
    return [
        most("airspeed bias", float(error.mean()), "m/s", 2.0, half, said[0], MAPPING),
        most("airspeed scatter", float(error.std()), "m/s", 2.5, half, said[1], MAPPING),
    ]


def _tether_range(log: FlightLog, where: Signal) -> list[Check]:
    error, far = moving_average(log["tether_length"] - _range(log), _width(log))[where], NOT_ON_THIS_LINE * float(_range(log)[where].mean())
    said = "Mean of tether length minus range: offset of the drum, sag.", "Its standard deviation: sag, stretch, drum errors, late clocks."
    return [
        most("tether length bias", float(error.mean()), "m", 10.0, max(far, 10.0), said[0], MAPPING),
        most("tether length scatter", float(error.std()), "m", 1.5, max(0.5 * far, 1.5), said[1], MAPPING),
    ]


def _reeling(log: FlightLog, where: Signal) -> list[Check]:
    """How the line grows against the reel-out speed, which is refused where another sign or unit makes it that far better."""
    grown, speed = np.gradient(log["tether_length"], log.dt), log["reel_out_speed"]
    misfit = {said: _rms(log, [grown - factor * speed], where) for said, factor in REELED.items()}
    best, size = min(misfit, key=lambda said: misfit[said]), _size([speed], where)
    sentence, stop = "RMS of d(tether length)/dt minus reel-out speed.", max(3.0, size)
    if misfit[best] < FAR_BETTER * misfit[""]:
        sentence += f" Read {best} it is {misfit[best]:.2g} m/s."
        stop = FAR_OFF * size
    return [most("reel-out speed against length", misfit[""], "m/s", 0.3, max(stop, 0.3), sentence, MAPPING)]


def _winch_clock(log: FlightLog, where: Signal) -> list[Check]:
    first, last = np.flatnonzero(where)[[0, -1]]
    seen = clock_offset(range_rate(log)[first:last], log["reel_out_speed"][first:last], log.dt)
    if seen is None or seen.correlation < 0.7:
        return []
    sentence = f"By so much the winch records late against the range (correlation {seen.correlation:.2f}, unmoved {seen.unshifted:.2f})."
    value = seen.late if seen.clear else 0.0
    do = "Write `clocks: {winch: auto}` in a flight.yaml."
    # it never stops: in regular loops a correlation may lock on to a neighbouring one
    return [most("winch clock", value, "s", 0.3, None, sentence if seen.clear else f"No clear offset shows. {sentence}", do)]


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


def _rms(log: FlightLog, errors: Iterable[Signal], where: Signal) -> float:
    """Root mean square length of an error vector averaged over AVERAGE, where asked."""
    return float(np.sqrt(sum((moving_average(e, _width(log))[where] ** 2).mean() for e in errors)))


def _size(signals: Iterable[Signal], where: Signal) -> float:
    """Root mean square length of a vector where asked."""
    return float(np.sqrt(sum((x[where] ** 2).mean() for x in signals)))
