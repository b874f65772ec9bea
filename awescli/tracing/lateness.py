"""How late a surface answers, by the moment that it makes (equation error; Klein & Morelli, Aircraft System Identification, 2006, ch. 5).

The angular acceleration about the surface's axis is a sum of coefficients times what the log shows, the set-point of some time ago among
it: the time at which it says most. No trajectory is simulated, so every delay can be tried, and a fit of it need not end at another
optimum. Under feedback and in gusts the coefficients come out small; the time hardly moves.
"""

import numpy as np
from scipy.signal import butter, sosfiltfilt

from awescli.flightlog.log import FlightLog
from awescli.flightlog.reconstruction.motion_of import motion_of
from awescli.physics.effects.rate_feedback import TURNS

NEEDED = ("p", "q", "r", "phi", "theta", "psi", "v_n", "v_e", "v_d")
"""Signals without which nothing is said."""
BAND = (0.15, 5.0)
"""[Hz] between what a trim does and what only shakes."""
LONGEST = 0.5
"""[s]"""
SAYS = 0.05
"""Share of the angular acceleration that the set-point must explain beyond all else, for its time to mean anything."""


def lateness(log: FlightLog, surface: str) -> float:
    """[s] delay at which the set-point of a surface explains most of the angular acceleration about its axis, to a sample; 0 where the log
    does not show it."""
    motion, rate = motion_of(log), TURNS.get(surface, "")
    if motion is None or not rate or surface not in log.inputs or any(n not in log for n in NEEDED) or log.dt > 1 / (4 * BAND[1]):
        return 0.0
    rows, band = motion.rows[motion.good], butter(4, BAND, btype="band", fs=1 / log.dt, output="sos")
    V = np.maximum(log["V_a"] if "V_a" in log else np.linalg.norm([log[n] for n in ("v_n", "v_e", "v_d")], axis=0), 1.0)
    u, v, w = log.body_velocity
    alpha = log["alpha"] if "alpha" in log else np.arctan2(w, u)
    beta = log["beta"] if "beta" in log else np.arcsin(np.clip(v / V, -1, 1))
    p, q, r = (log[n] for n in ("p", "q", "r"))
    gyroscopic = {"p": q * r, "q": p * r, "r": p * q}[rate]
    beside = [V**2 * x for x in (np.ones(len(V)), alpha, beta, alpha**2)] + [V * x for x in (p, q, r)] + [gyroscopic]
    beside += [V**2 * log[s] for s in TURNS if s in log.inputs and s != surface] + ([log["tension"]] if "tension" in log else [])
    explained = sosfiltfilt(band, np.stack(beside), axis=1)[:, rows]
    others, _ = np.linalg.qr((explained / np.maximum(np.abs(explained).mean(1, keepdims=True), 1e-12)).T)
    turned = _beyond(others, sosfiltfilt(band, np.gradient(log[rate], log.dt))[rows])

    def says(late: float) -> float:
        x = _beyond(others, sosfiltfilt(band, V**2 * np.interp(log.time - late, log.time, log[surface]))[rows])
        return float((x @ turned) ** 2 / max((x @ x) * (turned @ turned), 1e-300))

    tried = {late: says(late) for late in np.arange(0.0, LONGEST + log.dt / 2, log.dt)}
    best = max(tried, key=lambda late: tried[late])
    return float(best) if tried[best] > SAYS else 0.0


def _beyond(others: np.ndarray, x: np.ndarray) -> np.ndarray:
    """What of x (n,) the orthonormal columns `others` (n, m) do not explain."""
    return x - others @ (others.T @ x)
