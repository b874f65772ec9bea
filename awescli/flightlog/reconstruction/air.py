"""What the air data say of velocity, attitude and wind: airspeed and vanes against |v - w| and R^T (v - w), linear about a wind.

The wind is the recorded one, if there is one, and an unknown constant on top, which grows and veers with height; gusts are Gauss-Markov.
Turning in all directions is what tells a scale of the pitot from a wind (Klein & Morelli, Aircraft System Identification, ch. 10).
"""

from collections.abc import Mapping

import numpy as np
from scipy.signal import lfilter

from awescli.flightlog.quality import white_noise
from awescli.flightlog.reconstruction.gauss_markov import Law, Series
from awescli.flightlog.reconstruction.identities import SMOOTH, WIDE, Identity
from awescli.flightlog.reconstruction.levels import Known
from awescli.flightlog.reconstruction.motion_of import Motion
from awescli.flightlog.wind_at import wind_ned
from awescli.notation.angles import wrap

PRIORS = {
    "wind_n": 2.0, "wind_e": 2.0, "wind_d": 0.5, "more_wind_above": 0.7, "veer_above": 0.7,
    "scale": 0.3, "offset": 0.5, "late": 0.5, "arm": 0.3, "alpha": 0.3, "beta": 0.3, "alpha_scale": 0.1, "beta_scale": 0.1,
    "heading": 0.035, "pitch": 0.009,
}  # fmt: skip
"""What is known of each shape, about zero: wind [m/s], its growth per 100 m [m/s], scales, offset of the pitot [m/s], its lag [s], place of
the probe ahead of the reference point [m], vanes [rad] and the upwash on them, heading and pitch that vanes are compared with [rad].
Stations miss 1-3 m/s, shear exponents 0.05, upwash 10 %, a small inertial system's heading 2 deg and pitch 0.5 deg."""
UNRECORDED = 10.0
"""m/s that the constant wind is known to where nobody recorded it."""
GUSTS, GUST_MEMORY = 0.4, 4.0
SLOWEST = 8.0
"""m/s below which air data say little."""
SPAN = 0.4
"""s over which the airspeed that velocity and wind give is smoothed for its rate of change."""


def airspeed_of_motion(motion: Motion, wind: np.ndarray | None = None, lag: float = 0.0, smooth: bool = False) -> Identity:
    """Airspeed less |v - w| behind a lag [s] of first order. wind: (n, 3) NED [m/s] to be linear about, default the record; smooth: without
    the noise of the velocity, of which a lag would take away a part. Alone, without the vanes: these would vote on the wind with errors of
    the attitude."""
    air, higher = _air(motion, wind)
    speed = np.maximum(np.linalg.norm(air, axis=1), 1e-3)
    G = lagged(-air / speed[:, None], motion, lag)
    if smooth:
        speed = motion.smoothed(speed, SPAN)
    speed = lagged(speed, motion, lag)
    seen = motion.seen("V_a")[:, 0] & (speed > SLOWEST)
    error = motion.log["V_a"][motion.rows] - speed
    mean = float(speed[seen].mean()) if seen.any() else SLOWEST
    # its noise is in the error, too, and would pull a factor on it to minus one (errors in variables)
    slow = motion.smoothed(speed, SMOOTH)
    shapes = _wind_shapes(G[:, None, :], motion, wind, higher) | {
        "scale": slow[:, None], "offset": np.ones((len(motion), 1)), "late": -motion.smoothed(speed, SPAN, derivative=1)[:, None],
        # whoever holds the airspeed flies slower over ground when a gust comes from ahead: it then passes for a factor on what varies
        "answered": (slow - mean)[:, None],
    }  # fmt: skip
    answered = float(np.clip(np.var(error[seen]) / max(np.var(speed[seen]), 0.01), 1e-4, 1.0)) if seen.any() else 1.0
    laws = (Law("gusts and airspeed drift", (0,), GUSTS, GUST_MEMORY),)
    asks = (("at flown speed", {"scale": 1.0, "offset": 1.0 / mean}),)
    H = np.ones((len(motion), 1, 1))
    return _identity("airspeed", motion, error[:, None], shapes, H, seen[:, None], laws, {"answered": answered}, asks)


def lagged(signal: np.ndarray, motion: Motion, lag: float) -> np.ndarray:
    """What a sensor with a lag [s] of first order makes of a signal (n, ...), exactly where it is constant between the middles of samples;
    every stretch begins at its first value. A negative lag: the same filter, from the end of each stretch backwards in time."""
    if lag == 0:
        return signal
    a, way, parts = np.exp(-motion.dt / abs(lag)), 1 if lag > 0 else -1, []
    for part in _stretches(signal, motion):
        flown = part[::way]
        held = np.concatenate([flown[:1], (flown[1:] + flown[:-1]) / 2])
        parts.append(lfilter([1 - a], [1, -a], held, axis=0, zi=a * held[:1])[0][::way])
    return np.concatenate(parts)


def _stretches(signal: np.ndarray, motion: Motion) -> list[np.ndarray]:
    return np.split(signal, np.flatnonzero(motion.restart)[1:])


def vanes_of_motion(motion: Motion, wind: np.ndarray | None = None) -> Identity:
    """Angles of attack and sideslip, those that are measured, less what R^T (v - w) has. wind: as for the airspeed."""
    air, higher = _air(motion, wind)
    names = tuple(name for name in ("alpha", "beta") if name in motion.log)
    R, speed = motion.rotation, np.maximum(np.linalg.norm(air, axis=1), 1e-3)
    body = np.einsum("nji,nj->ni", R, air)
    flat = np.maximum(np.hypot(body[:, 0], body[:, 2]), 1e-3)
    expected = {"alpha": np.arctan2(body[:, 2], body[:, 0]), "beta": np.arcsin(np.clip(body[:, 1] / speed, -1, 1))}
    by_body = {
        "alpha": np.stack([-body[:, 2], 0 * flat, body[:, 0]], 1) / flat[:, None] ** 2,
        "beta": (np.eye(3)[1] - body[:, 1:2] * body / speed[:, None] ** 2) / flat[:, None],
    }
    G = -np.stack([np.einsum("nij,nj->ni", R, by_body[name]) for name in names], axis=1)
    psi, n = motion.log["psi"][motion.rows], len(motion)
    axes = {"heading": np.array([0, 0, 1.0]), "pitch": np.stack([-np.sin(psi), np.cos(psi), 0 * psi], axis=1)}
    shapes = _wind_shapes(G, motion, wind, higher) | {c: -np.einsum("nmi,ni->nm", G, np.cross(axis, air)) for c, axis in axes.items()}
    for i, name in enumerate(names):
        # the upwash on a vane counts at the mean angle alone: attitude noise and gusts are in the expected angle and not in the vane, and a
        # factor on it would be drawn towards zero by them (errors in variables; Fuller, Measurement Error Models, 1987, ch. 1)
        constant = np.repeat(np.eye(len(names))[i][None], n, axis=0)
        shapes |= {name: constant, f"{name}_scale": float(np.mean(expected[name])) * constant}
    q, r = (motion.log[x][motion.rows] if x in motion.log else np.zeros(n) for x in "qr")
    moves = np.stack([0 * r, r, -q], axis=1)  # omega x (1, 0, 0)
    shapes["arm"] = np.stack([(moves * by_body[name]).sum(1) for name in names], axis=1)
    error = np.stack([wrap(motion.log[name][motion.rows] - expected[name]) for name in names], axis=1)
    laws = (Law("gusts", (0, 1, 2), GUSTS, GUST_MEMORY), Law("vane drift", tuple(range(3, 3 + len(names))), 0.01, GUST_MEMORY))
    H = np.concatenate([G, np.repeat(np.eye(len(names))[None], n, axis=0)], axis=2)
    return _identity("vanes", motion, error, shapes, H, motion.seen(*names) & (speed > SLOWEST)[:, None], laws, {}, ())


def _air(motion: Motion, wind: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """(v - w (n, 3) NED [m/s], height above the mean (n,) [100 m])."""
    height = -motion.log["p_d"][motion.rows] if "p_d" in motion.log else np.zeros(len(motion))
    return motion.three("v_n", "v_e", "v_d") - (recorded(motion) if wind is None else wind), (height - height.mean()) / 100


def _wind_shapes(G: np.ndarray, motion: Motion, wind: np.ndarray | None, higher: np.ndarray) -> dict[str, np.ndarray]:
    """What a wind that is constant, grows, or veers with height changes; G (n, m, 3): derivatives with respect to the wind."""
    wind = recorded(motion) if wind is None else wind
    flat = wind * np.array([1.0, 1.0, 0.0])
    along = flat / np.maximum(np.linalg.norm(flat, axis=1), 1.0)[:, None]
    across = np.stack([-along[:, 1], along[:, 0], 0 * higher], axis=1)
    shapes = {f"wind_{axis}": G[:, :, i] for i, axis in enumerate("ned")}
    more = {"more_wind_above": along, "veer_above": across}
    return shapes | {name: np.einsum("nmi,ni->nm", G, way * higher[:, None]) for name, way in more.items()}


def _identity(
    name: str, motion: Motion, error: np.ndarray, shapes: Mapping[str, np.ndarray], H: np.ndarray, seen: np.ndarray, laws: tuple[Law, ...],
    priors: dict[str, float], asks: tuple[tuple[str, dict[str, float]], ...],
) -> Identity:  # fmt: skip
    """channels: V_a, or the vanes there are."""
    channels = ("V_a",) if name == "airspeed" else tuple(c for c in ("alpha", "beta") if c in motion.log)
    least = 0.02 if name == "airspeed" else 0.0005
    white = tuple(max(white_noise(motion.log[c][motion.rows][motion.seen(c)[:, 0]]) or 0.0, least) for c in channels)
    known = (*(Known(w, 1.0) for w in white), *(Known(w.level, WIDE) for w in laws), *(Known(w.memory, WIDE) for w in laws))
    wide = {} if motion.log.wind is not None else {"wind_n": UNRECORDED, "wind_e": UNRECORDED}
    prior = PRIORS | wide | priors
    columns = tuple(shapes)
    X = np.stack([shapes[c] for c in columns], axis=2)
    series = Series(error, X, H, seen, motion.restart, motion.time, columns, np.array([prior[c] for c in columns]))
    return Identity(name, channels, series, white, laws, known, {laws[-1].name: channels}, asks=asks)


def recorded(motion: Motion) -> np.ndarray:
    """(n, 3) NED [m/s] wind of the record at the kite, zero without a record."""
    log = motion.log
    if log.wind is None:
        return np.zeros((len(motion), 3))
    height = -log["p_d"][motion.rows] if "p_d" in log else np.zeros(len(motion))
    return np.stack(wind_ned(log.wind, log.time[motion.rows], height), axis=1)


def with_offset(wind: np.ndarray, values: Mapping[str, float]) -> np.ndarray:
    """The wind moved by what an estimate says of its constant part."""
    return wind + np.array([values[f"wind_{axis}"] for axis in "ned"])
