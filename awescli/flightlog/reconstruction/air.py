"""What the air data say of velocity, attitude and wind: airspeed and vanes against |v - w| and R^T (v - w), linear about a wind.

The wind is the recorded one, if there is one, and an unknown constant on top, which grows and veers with height; gusts are Gauss-Markov.
Turning in all directions is what tells a scale of the pitot from a wind (Klein & Morelli, Aircraft System Identification, ch. 10).
"""

from collections.abc import Mapping

import numpy as np

from awescli.flightlog.quality import white_noise
from awescli.flightlog.reconstruction.gauss_markov import Law, Series
from awescli.flightlog.reconstruction.identities import WIDE, Identity
from awescli.flightlog.reconstruction.levels import Known
from awescli.flightlog.reconstruction.motion_of import Motion
from awescli.flightlog.smoothing import local_quadratic
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


def air_of_motion(motion: Motion, wind: np.ndarray | None = None) -> Identity:
    """Airspeed, and vanes where there are any, less what velocity, attitude and wind make of them. wind: (n, 3) NED [m/s] to be linear
    about, default the record."""
    log, n = motion.log, len(motion)
    v, height = motion.three("v_n", "v_e", "v_d"), -log["p_d"][motion.rows] if "p_d" in log else np.zeros(n)
    if wind is None:
        wind = recorded(motion)
    air = v - wind
    speed = np.maximum(np.linalg.norm(air, axis=1), 1e-3)
    vanes = [name for name in ("alpha", "beta") if name in log and "phi" in log]
    channels = ("V_a", *vanes)
    gradients, expected = {"V_a": air / speed[:, None]}, {"V_a": speed}
    if vanes:
        R = motion.rotation
        body = np.einsum("nji,nj->ni", R, air)
        flat = np.maximum(np.hypot(body[:, 0], body[:, 2]), 1e-3)
        expected |= {"alpha": np.arctan2(body[:, 2], body[:, 0]), "beta": np.arcsin(np.clip(body[:, 1] / speed, -1, 1))}
        by_body = {
            "alpha": np.stack([-body[:, 2], 0 * flat, body[:, 0]], 1) / flat[:, None] ** 2,
            "beta": (np.eye(3)[1] - body[:, 1:2] * body / speed[:, None] ** 2) / flat[:, None],
        }
        gradients |= {name: np.einsum("nij,nj->ni", R, g) for name, g in by_body.items()}
    measured = {name: log[name][motion.rows] for name in channels}
    errors = {name: measured[name] - expected[name] if name == "V_a" else wrap(measured[name] - expected[name]) for name in channels}
    # of the wind: minus the gradient with respect to the air's velocity
    G = -np.stack([gradients[name] for name in channels], axis=1)
    along = wind - np.array([0, 0, 1.0]) * wind
    along = along / np.maximum(np.linalg.norm(along, axis=1), 1.0)[:, None]
    across = np.stack([-along[:, 1], along[:, 0], 0 * height], axis=1)
    higher = ((height - height.mean()) / 100)[:, None]
    shapes: dict[str, np.ndarray] = {f"wind_{axis}": G[:, :, i] for i, axis in enumerate("ned")}
    shapes |= {"more_wind_above": np.einsum("nmi,ni->nm", G, along * higher), "veer_above": np.einsum("nmi,ni->nm", G, across * higher)}
    only = {name: np.eye(len(channels))[i] for i, name in enumerate(channels)}
    smooth = np.concatenate([local_quadratic(part, motion.dt, SPAN) for part in np.split(speed, np.flatnonzero(motion.restart)[1:])])
    change = np.concatenate(
        [local_quadratic(p, motion.dt, SPAN, derivative=1) for p in np.split(smooth, np.flatnonzero(motion.restart)[1:])]
    )
    shapes |= {"scale": speed[:, None] * only["V_a"], "offset": 0 * speed[:, None] + only["V_a"], "late": -change[:, None] * only["V_a"]}
    for name in vanes:
        # the upwash on a vane counts at the mean angle alone: attitude noise and gusts are in the expected angle and not in the vane, and a
        # factor on it would be drawn towards zero by them (errors in variables; Fuller, Measurement Error Models, 1987, ch. 1)
        constant = 0 * speed[:, None] + only[name]
        shapes |= {name: constant, f"{name}_scale": float(np.mean(expected[name])) * constant}
    if vanes:
        p, q, r = motion.three("p", "q", "r").T if all(x in log for x in "pqr") else np.zeros((3, n))
        moves = np.stack([0 * r, r, -q], axis=1)  # omega x (1, 0, 0)
        psi = log["psi"][motion.rows]
        axes = {"heading": np.array([0, 0, 1.0]), "pitch": np.stack([-np.sin(psi), np.cos(psi), 0 * psi], axis=1)}
        shapes |= {name: -np.einsum("nmi,ni->nm", G, np.cross(axis, air)) for name, axis in axes.items()}
        shapes["arm"] = np.stack([(moves * (body / speed[:, None] if c == "V_a" else by_body[c])).sum(1) for c in channels], axis=1)
    columns = tuple(shapes)
    priors = dict(PRIORS)
    if log.wind is None:
        priors |= {"wind_n": UNRECORDED, "wind_e": UNRECORDED}
    white = tuple(max(white_noise(measured[c][motion.seen(c)[:, 0]]) or 0.0, 0.02 if c == "V_a" else 0.0005) for c in channels)
    if vanes:
        own = tuple(range(3, 3 + len(vanes)))
        laws = (Law("gusts", (0, 1, 2), GUSTS, GUST_MEMORY), Law("vane drift", own, 0.01, GUST_MEMORY))
        drift = np.zeros((n, len(channels), len(vanes)))
        for i in range(len(vanes)):
            drift[:, i + 1, i] = 1.0
        H, drifts = np.concatenate([G, drift], axis=2), {"vane drift": tuple(vanes)}
    else:
        laws, H = (Law("gusts and airspeed drift", (0,), GUSTS, GUST_MEMORY),), np.ones((n, 1, 1))
        drifts = {"gusts and airspeed drift": ("V_a",)}
    seen = motion.seen(*channels) & (speed > SLOWEST)[:, None]
    y, X = np.stack([errors[c] for c in channels], axis=1), np.stack([shapes[c] for c in columns], axis=2)
    series = Series(y, X, H, seen, motion.restart, motion.time, columns, np.array([priors[c] for c in columns]))
    known = (*(Known(w, 1.0) for w in white), *(Known(w.level, WIDE) for w in laws), *(Known(w.memory, WIDE) for w in laws))
    flown = measured["V_a"][seen[:, 0]]
    asks = (("at flown speed", {"scale": 1.0, "offset": 1.0 / max(float(flown.mean()) if flown.size else SLOWEST, SLOWEST)}),)
    return Identity("air data", channels, series, white, laws, known, drifts, asks=asks)


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
