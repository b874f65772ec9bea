"""A long flight of pumping cycles as a clean log: ground, hover, transition, traction in loops or figures of eight, retraction, landing."""

import awescli  # noqa: F401  (thread settings before numpy)

# isort: split
import numpy as np
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from awescli.flightlog.log import FlightLog, WindRecord
from awescli.notation.angles import wrap
from awescli.notation.frames import rotate_back, rotation_body_to_ned

START = 1_700_000_000.0
WIND = 8.0
"""m/s from the south: the kite flies downwind, north of the winch."""

LOOP, EIGHT = 8.0, 16.0
"""s of one loop and of one figure of eight."""

SMOOTH = 1.5
"""s over which one phase goes over into the next."""

NOISE = {
    "p_n": 0.1, "p_e": 0.1, "p_d": 0.1, "v_n": 0.03, "v_e": 0.03, "v_d": 0.03, "phi": 0.002, "theta": 0.002, "psi": 0.002,
    "p": 0.003, "q": 0.003, "r": 0.003, "a_x": 0.05, "a_y": 0.05, "a_z": 0.05, "V_a": 0.1, "tension": 8.0,
}  # fmt: skip
"""Standard deviation of the sensors' white noise, SI."""

Cycle = tuple[tuple[str, float], ...]
PUMPING: Cycle = (("traction", 144.0), ("retraction", 40.0))
LAUNCH: Cycle = (("ground", 40.0), ("hover", 110.0), ("transition", 12.0))
LANDING: Cycle = (("transition", 12.0), ("hover", 110.0), ("ground", 40.0))


def schedule(seconds: float) -> list[tuple[str, float]]:
    """(phase, s) that fill about `seconds`: launch, pumping cycles that alternate between loops and figures of eight, landing."""
    phases, used = list(LAUNCH), sum(s for _, s in LAUNCH + LANDING)
    cycle = 0
    while used + sum(s for _, s in PUMPING) <= seconds:
        phases += [(("loops", "eights")[cycle % 2], PUMPING[0][1]), PUMPING[1]]
        used += sum(s for _, s in PUMPING)
        cycle += 1
    return phases + list(LANDING)


def flight(seconds: float, rate: float, seed: int = 0, noise: float = 1.0) -> tuple[FlightLog, np.ndarray]:
    """(clean log, (N,) phases): a kinematically consistent flight whose signals tell one story, with sensor noise."""
    phases = schedule(seconds)
    count = [max(1, int(round(s * rate))) for _, s in phases]
    n = sum(count)
    t = np.arange(n) / rate
    label = np.concatenate([[name] * c for (name, _), c in zip(phases, count, strict=True)])
    begin = np.concatenate([[0], np.cumsum(count)])
    # range rate, elevation, size of the pattern across the sky, as steps that are then smoothed
    reel, elevation, wide, eight = (np.zeros(n) for _ in range(4))
    up = True
    for (name, s), first, last in zip(phases, begin[:-1], begin[1:], strict=True):
        part = slice(first, last)
        if name == "hover":
            reel[part], up = (247.0 / s if up else -247.0 / s), False
        reel[part] += {"loops": 0.8, "eights": 0.8, "retraction": -0.8 * PUMPING[0][1] / PUMPING[1][1]}.get(name, 0.0)
        elevation[part] = {"ground": 20.0, "hover": 50.0, "retraction": 50.0}.get(name, 35.0)
        wide[part] = name in ("loops", "eights", "retraction")
        eight[part] = name in ("eights", "retraction")
    smooth = [gaussian_filter1d(x, SMOOTH * rate, mode="nearest") for x in (reel, np.deg2rad(elevation), wide, eight)]
    reel, elevation, wide, eight = smooth
    distance = 5.0 + np.cumsum(reel) / rate
    a, b = 2 * np.pi * t / LOOP, 2 * np.pi * t / EIGHT
    azimuth = wide * ((1 - eight) * 0.12 * np.sin(a) + eight * 0.3 * np.sin(b))
    elevation = elevation + wide * ((1 - eight) * 0.12 * np.cos(a) + eight * 0.08 * np.sin(2 * b))
    p = distance * np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation)])
    v = np.gradient(p, 1 / rate, axis=1)
    acceleration = np.gradient(v, 1 / rate, axis=1)
    flying = wide > 0.5
    # at rest and in hover the nose points downwind, whatever the small velocity does
    nose = [wide * v[0] + (1 - wide) * 10.0, wide * v[1]]
    heading = gaussian_filter1d(np.unwrap(np.arctan2(nose[1], nose[0])), 0.3 * rate, mode="nearest")
    phi, theta, psi = 0.3 * wide * np.sin(a) + 0.1, 0.2 * wide * np.cos(a), heading
    turn = [np.gradient(x, 1 / rate) for x in (phi, theta, psi)]
    body = rotate_back(rotation_body_to_ned(phi, theta, psi), tuple(acceleration))
    phase_pull = np.select([label == "ground", label == "hover", label == "transition", label == "retraction"], [8, 90, 300, 700], 2500.0)
    tension = gaussian_filter1d(phase_pull.astype(float), SMOOTH * rate, mode="nearest") + 500 * wide * (1 - eight) * np.cos(a)
    rng = np.random.default_rng(seed)
    clean = {
        "p_n": p[0], "p_e": p[1], "p_d": p[2], "v_n": v[0], "v_e": v[1], "v_d": v[2], "phi": phi, "theta": theta, "psi": psi,
        "p": turn[0] - turn[2] * np.sin(theta), "q": turn[1] * np.cos(phi) + turn[2] * np.sin(phi) * np.cos(theta),
        "r": -turn[1] * np.sin(phi) + turn[2] * np.cos(phi) * np.cos(theta), "a_x": body[0], "a_y": body[1], "a_z": body[2],
        "V_a": np.sqrt((v[0] - WIND) ** 2 + v[1] ** 2 + v[2] ** 2), "tension": np.maximum(tension, 5.0),
    }  # fmt: skip
    measured = {k: x + noise * NOISE[k] * rng.standard_normal(n) for k, x in clean.items()}
    for name in ("phi", "theta", "psi"):
        measured[name] = wrap(measured[name])
    steer = 0.15 * wide * np.sin(np.where(eight > 0.5, b, a)) + 0.02 * uniform_filter1d(rng.standard_normal(n), 5) * flying
    inputs = {
        "aileron": 0.3 * steer, "elevator": np.zeros(n) - 0.03, "rudder": steer, "flaps": np.zeros(n) + 0.08,
        "tether_length": distance + 2.0, "reel_out_speed": reel,
    }  # fmt: skip
    stations = np.arange(0.0, t[-1] + 60.0, 60.0)
    column = np.ones((stations.size, 1))
    wind = WindRecord(stations, np.array([10.0]), WIND * column, np.pi * column, 0 * column, 1.22 * column[:, 0])
    label = np.where((label == "loops") | (label == "eights"), "traction", label)
    return FlightLog("long", START, 1 / rate, t, measured, inputs, np.ones(n, bool), wind), label
