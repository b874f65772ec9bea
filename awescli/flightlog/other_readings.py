"""Would another reading of the log fit better? Signs, axes, units and clocks as hypotheses, judged by identities between its own signals.

No model is needed: rates are what the attitude does, velocity what the position does, the nose points where the air comes from, airspeed
and velocity over ground show the wind (the wind triangle), a kite on a line flies downwind of its winch.
"""

from collections.abc import Iterator, Mapping
from itertools import permutations, product

import numpy as np

from awescli.flightlog.clocks import moving_average
from awescli.flightlog.consistency import FAR_BETTER, FAR_OFF, STEEP, Check, most
from awescli.flightlog.log import FlightLog
from awescli.flightlog.wind_at import wind_ned
from awescli.flightlog.wind_triangle import Triangle, wind_triangle
from awescli.notation.frames import rotate_back, rotation_body_to_ned

AVERAGE = 0.4
"""[s] over which rates are compared: the noise of angles is no rotation."""

MOST = 5000
"""Samples that are compared: 56 readings of a log of hours need no more."""

TURNING = 0.1
"""rad/s RMS: below, there is nothing to compare."""

BETTER, WRONG = 0.5, 0.15
"""Share of the misfit that another reading must leave, and share of the signal that the log's own must miss, to be doubted; to be refused,
FAR_BETTER and FAR_OFF."""

NOSE = (25.0, 50.0)
"""deg between nose and airflow: wings stall at 15; the wind's error turns the flow by some degrees more."""
FAST = 12.0
"""m/s of airspeed from which a wing flies by its nose."""

SCALE, NO_PITOT = 0.08, 0.35
"""Departure of the airspeed's scale from 1: of a pitot in a wing's flow some per cent; a knot is 0.94, a km/h 2.6."""

CLOCK, NO_CLOCK = 0.4, 8.0
"""Percent by which positions may be slower or faster than velocities: GPS agrees to 0.1; beyond, a rate was mistaken."""

WIND_OFF, ANOTHER_WIND = 3.0, 0.9
"""m/s between recorded wind and wind triangle that warn, and share of the stronger of the two that stops: 0.9 is 53 deg at equal speed."""
CALM = 4.0
"""m/s: in less wind its direction says nothing."""

UPWIND = (50.0, 95.0)
"""deg between where the kite flies and downwind."""

SPEED_UNITS = {"kt": 3600 / 1852, "km/h": 3.6, "mph": 3600 / 1609.344, "ft/s": 1 / 0.3048}
MAPPING = "Say so in a flight.yaml (`format: csv`: `sign`, `unit`, other columns)."


def reading_checks(log: FlightLog, airborne: np.ndarray) -> list[Check]:
    """All of them that the log has the signals for. airborne: (N,) bool, the flown samples."""
    where = airborne & log.valid
    if where.sum() < 100:
        return []
    wind = _recorded(log, where) if log.wind is not None else None
    triangle = wind_triangle(log) if log.wind is not None else None
    return [
        *_axes_of_rates(log, where),
        *_nose(log, where),
        *_clock(log, where),
        *_airspeed(triangle),
        *_wind(wind, triangle),
        *_downwind(log, where, wind),
    ]


# --- rates and attitude ---------------------------------------------------------------------------------------------------


def _axes_of_rates(log: FlightLog, where: np.ndarray) -> Iterator[Check]:
    """p, q, r in other orders and signs, and Euler angles with other signs, against each other."""
    if any(n not in log for n in ("phi", "theta", "psi", "p", "q", "r")):
        return
    width = max(1, int(round(AVERAGE / log.dt)))
    where = np.flatnonzero(where & (np.abs(log["theta"]) < STEEP))
    where = where[:: max(1, where.size // MOST)]
    rates = {n: moving_average(log[n], width)[where] for n in "pqr"}
    size = float(np.sqrt(sum((x**2).mean() for x in rates.values())))
    if where.size < 100 or size < TURNING:
        return
    turn = {n: moving_average(np.gradient(np.unwrap(log[n]), log.dt), width)[where] for n in ("phi", "theta", "psi")}
    angle = {n: log[n][where] for n in ("phi", "theta")}
    misfit = {}
    for said, signs in _attitudes():
        seen = _body_rates(turn, angle, signs)
        for words, order, flipped in _orders() if not said else [("", "pqr", (1, 1, 1))]:
            error = sum(((s - f * rates[n]) ** 2).mean() for s, n, f in zip(seen, order, flipped, strict=True))
            misfit[said or words] = float(np.sqrt(error)) / size
    yield _judged("axes of the rates", misfit, "Misfit of p, q, r with what the Euler angles do, as a share of the rates")


def _body_rates(turn: Mapping[str, np.ndarray], angle: Mapping[str, np.ndarray], signs: tuple[int, int, int]) -> tuple[np.ndarray, ...]:
    """Body rates from Euler rates (Beard & McLain, eq. 3.3), the angles with other signs."""
    phi, theta = signs[0] * angle["phi"], signs[1] * angle["theta"]
    d_phi, d_theta, d_psi = (s * turn[n] for s, n in zip(signs, ("phi", "theta", "psi"), strict=True))
    return (
        d_phi - d_psi * np.sin(theta),
        d_theta * np.cos(phi) + d_psi * np.sin(phi) * np.cos(theta),
        -d_theta * np.sin(phi) + d_psi * np.cos(phi) * np.cos(theta),
    )


def _attitudes() -> Iterator[tuple[str, tuple[int, int, int]]]:
    """As read, and with the sign of one or two angles turned round."""
    words = ("roll angle", "pitch angle", "heading")
    for roll, pitch, yaw in product((1, -1), repeat=3):
        signs = (roll, pitch, yaw)
        turned = [w for w, s in zip(words, signs, strict=True) if s < 0]
        if len(turned) < 3:
            yield (f"with the {' and '.join(turned)} of the other sign" if turned else ""), signs


def _nose(log: FlightLog, where: np.ndarray) -> Iterator[Check]:
    """The nose points where the air comes from, but for some degrees of alpha and beta, whatever turns the wing makes."""
    if log.wind is None or any(n not in log for n in ("phi", "theta", "psi", "v_n", "v_e", "v_d", "p_d")):
        return
    wind = wind_ned(log.recorded_wind, log.time, -log["p_d"])
    air = np.array([log[n] - w for n, w in zip(("v_n", "v_e", "v_d"), wind, strict=True)])[:, where]
    fast = np.sqrt((air**2).sum(0)) > FAST
    if fast.sum() < 100:
        return
    air, angle = air[:, fast], {n: log[n][where][fast] for n in ("phi", "theta", "psi")}
    off = {said: _off_nose(angle, signs, air) for said, signs in _attitudes()}
    # the wind is that of the record, the velocity the log's
    v, blows = np.array([log[n][where][fast] for n in ("v_n", "v_e", "v_d")]), np.array(wind)[:, where][:, fast]
    off["with north and east exchanged in position and velocity"] = _off_nose(angle, (1, 1, 1), v[[1, 0, 2]] - blows)
    best = min(off, key=lambda said: off[said])
    sentence = "Mean angle between the nose and where the air comes from, by velocity and recorded wind."
    if best and off[""] > NOSE[0] and off[best] < BETTER * off[""]:
        sentence += f" It is {off[best]:.0f} deg {best}."
    yield most("nose against airflow", off[""], "deg", *NOSE, sentence, MAPPING)


def _off_nose(angle: Mapping[str, np.ndarray], signs: tuple[int, int, int], air: np.ndarray) -> float:
    """[deg] mean angle between the nose and the velocity through the air (3, N) NED."""
    R = rotation_body_to_ned(*(s * angle[n] for s, n in zip(signs, ("phi", "theta", "psi"), strict=True)))
    along = rotate_back(R, tuple(air))[0] / np.maximum(np.sqrt((air**2).sum(0)), 1e-6)
    return float(np.degrees(np.arccos(np.clip(along, -1, 1))).mean())


def _orders() -> Iterator[tuple[str, tuple[str, ...], tuple[int, ...]]]:
    """p, q, r in every order and sign."""
    for order in permutations("pqr"):
        for flipped in product((1, -1), repeat=3):
            names = [("-" if f < 0 else "") + n for n, f in zip(order, flipped, strict=True)]
            as_read = order == tuple("pqr") and min(flipped) > 0
            yield ("" if as_read else f"p, q, r read as {', '.join(names)}"), order, flipped


def _judged(name: str, misfit: Mapping[str, float], says: str) -> Check:
    """A check from the misfit of every reading ("" is that of the log), as a share of the signal."""
    own, best = misfit[""], min(misfit, key=lambda words: misfit[words])
    if best and own > WRONG and misfit[best] < BETTER * own:
        sentence = f"{says}; {best} it is {misfit[best]:.2g}."
        stop = FAR_OFF if misfit[best] < FAR_BETTER * own else None
        return most(name, own, "", min(WRONG, own / 2), stop, sentence, MAPPING)
    return Check(name, own, "", WRONG, True, f"{says}: no other order or sign fits far better.")


# --- clock ----------------------------------------------------------------------------------------------------------------


def _clock(log: FlightLog, where: np.ndarray) -> Iterator[Check]:
    """Way against velocity over a second, the position's lag taken out: a clock that runs long makes every way too slow."""
    names = ("p_n", "p_e", "p_d"), ("v_n", "v_e", "v_d")
    if any(n not in log for group in names for n in group):
        return
    width = max(1, int(round(1.0 / log.dt)))
    # a second around anything invalid would mix filled values into the averages
    where = where & (moving_average((~where).astype(float), 2 * width + 1) == 0)
    if where.sum() < 5 * width:
        return
    moved = [moving_average(np.gradient(log[p], log.dt), width) for p in names[0]]
    lag = 0.0
    for _ in range(3):
        velocity = [moving_average(np.interp(log.time - lag, log.time, log[v]), width) for v in names[1]]
        change = [np.gradient(v, log.dt) for v in velocity]
        A = np.column_stack([np.concatenate([x[where] for x in of]) for of in (velocity, change)])
        b = np.concatenate([x[where] for x in moved])
        if np.abs(A[:, 1]).max() == 0:
            slope, late = float(A[:, 0] @ b / (A[:, 0] @ A[:, 0])), 0.0
        else:
            slope, late = np.linalg.lstsq(A, b, rcond=None)[0]
        lag -= float(late / slope) if slope else 0.0
    rest = b - A @ np.linalg.lstsq(A, b, rcond=None)[0]
    pieces = max(where.sum() * log.dt / 5.0, 3.0)
    std = float(np.sqrt((rest**2).mean() / ((A[:, 0] ** 2).mean() * pieces)))
    percent = 100 * (float(slope) - 1)
    sentence = f"Positions change by so much faster (+) or slower (-) than the velocity says (+-{200 * std:.2g}), a lag taken out."
    if abs(percent) > CLOCK:
        sentence += f" A clock that runs {abs(percent):.1f} % {'long' if percent < 0 else 'short'} does that, or a scale of one of them."
    yield most("clock rate", percent, "%", max(CLOCK, 300 * std), NO_CLOCK, sentence, "Check the unit and the rate of the time column.")


# --- air ------------------------------------------------------------------------------------------------------------------


def _airspeed(triangle: Triangle | None) -> Iterator[Check]:
    if triangle is None:
        return
    sentence = "Airspeed over what velocity and the wind that fits best make of it."
    unit = next((u for u, factor in SPEED_UNITS.items() if abs(triangle.scale / factor - 1) < 0.1), None)
    if unit:
        sentence += f" It looks like {unit}."
    elif abs(triangle.scale * SPEED_UNITS["kt"] - 1) < 0.1:
        sentence += " It looks like m/s that were taken for kt."
    off = triangle.scale - 1
    yield most("airspeed scale", off, "", SCALE, NO_PITOT, f"{sentence} (minus 1)", MAPPING)


def _recorded(log: FlightLog, where: np.ndarray) -> tuple[float, float]:
    """The recorded wind at the kite, mean north and east."""
    n, e, _ = wind_ned(log.recorded_wind, log.time, -log["p_d"]) if "p_d" in log else (np.zeros(len(log)),) * 3
    return float(n[where].mean()), float(e[where].mean())


def _other_winds(n: float, e: float) -> dict[str, tuple[float, float]]:
    """The recorded wind with its direction and speed read otherwise."""
    speed, comes = np.hypot(n, e), np.arctan2(-e, -n)
    directions = {
        "a direction to which it blows": comes + np.pi, "a direction counted counter-clockwise": -comes,
        "a direction counted from east, counter-clockwise": np.pi / 2 - comes,
        "a direction in rad that was taken for deg": np.rad2deg(np.mod(comes, 2 * np.pi)),
        "a direction in deg that was taken for rad": np.deg2rad(np.mod(comes, 2 * np.pi)),
    }  # fmt: skip
    found = {said: (-speed * np.cos(d), -speed * np.sin(d)) for said, d in directions.items()}
    found |= {f"a speed in {u}": (n / factor, e / factor) for u, factor in SPEED_UNITS.items()}
    return found


def _wind(wind: tuple[float, float] | None, triangle: Triangle | None) -> Iterator[Check]:
    """The recorded wind against the wind that airspeed and velocity show."""
    if wind is None or triangle is None:
        return
    seen = (triangle.north, triangle.east)
    off = float(np.hypot(wind[0] - seen[0], wind[1] - seen[1]))
    strong = max(float(np.hypot(*wind)), float(np.hypot(*seen)))
    sentence = f"Recorded wind at the kite minus the wind that airspeed and velocity show ({np.hypot(*seen):.1f} m/s)."
    misfit = {said: float(np.hypot(x[0] - seen[0], x[1] - seen[1])) for said, x in _other_winds(*wind).items()}
    best = min(misfit, key=lambda said: misfit[said])
    if off > WIND_OFF and misfit[best] < FAR_BETTER * off:
        sentence += f" Read as {best} it is {misfit[best]:.1f} m/s."
    stop = max(ANOTHER_WIND * strong, 4 * triangle.std, 5.0)
    yield most("wind against airspeed", off, "m/s", max(WIND_OFF, 4 * triangle.std), stop, sentence, MAPPING)


def _downwind(log: FlightLog, where: np.ndarray, wind: tuple[float, float] | None) -> Iterator[Check]:
    """A kite on a line hangs downwind of its winch."""
    if wind is None or not log.on_line or "p_n" not in log or np.hypot(*wind) < CALM:
        return
    at = float(log["p_n"][where].mean()), float(log["p_e"][where].mean())
    if np.hypot(*at) < 30.0:
        return
    off = _angle(wind, at)
    sentence = "Angle between downwind and where the kite flies."
    misfit = {said: _angle(x, at) for said, x in _other_winds(*wind).items() if "speed" not in said}
    misfit["north and east exchanged in position and velocity"] = _angle(wind, (at[1], at[0]))
    best = min(misfit, key=lambda said: misfit[said])
    if off > UPWIND[0] and misfit[best] < FAR_BETTER * off:
        sentence += f" With {best} it is {misfit[best]:.0f} deg."
    yield most("downwind", off, "deg", *UPWIND, sentence, MAPPING)


def _angle(a: tuple[float, float], b: tuple[float, float]) -> float:
    """[deg] between two horizontal vectors."""
    return float(np.degrees(np.abs(np.angle(complex(*a) / complex(*b))))) if np.hypot(*a) * np.hypot(*b) > 0 else 0.0
