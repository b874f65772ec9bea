"""A flight on a circle, flown by a law that is known in closed form."""

from dataclasses import replace

import numpy as np

from awescli.control.features import evaluate
from awescli.control.law import state_mapping
from awescli.controller_fit.noise import NOISE
from awescli.controller_fit.pattern import fit_pattern
from awescli.flightlog.log import FlightLog


def circling(n=6000, noise=0.0, seed=0, surfaces=("rudder",)):
    """A kite on a wobbling circle of 50 m around 35 deg elevation, at 50 Hz, flown by a law known in closed form."""
    r = np.random.default_rng(seed)
    t = np.arange(n) * 0.02

    def wobble(size, k):
        return size * sum(np.sin(2 * np.pi * f * t + r.uniform(0, 7)) for f in np.linspace(0.03, 0.21, k))

    angle, length = 2 * np.pi * t / 9 + wobble(0.05, 4), 250 + t
    rho = (50 + wobble(1.0, 5)) / length
    c, east, up = np.array([np.cos(0.6), 0, -np.sin(0.6)]), np.array([0, 1.0, 0]), np.array([-np.sin(0.6), 0, -np.cos(0.6)])
    P = length[:, None] * (np.cos(rho)[:, None] * c + np.sin(rho)[:, None] * (np.sin(angle)[:, None] * east + np.cos(angle)[:, None] * up))
    V = np.gradient(P, 0.02, axis=0)
    m = dict(zip(("p_n", "p_e", "p_d", "v_n", "v_e", "v_d"), [*P.T, *V.T], strict=True))
    m |= {"phi": 0.5 + wobble(0.1, 3), "theta": wobble(0.2, 3), "psi": wobble(0.5, 4)}
    m |= {k: wobble(0.05, 6) for k in "pqr"}
    still = np.zeros(n)
    log = FlightLog(
        "circling", 0.0, 0.02, t, m, {"tether_length": length, "reel_out_speed": np.ones(n), "aileron": still + 0.02}, np.ones(n, bool)
    )
    z = state_mapping(log)
    # the law knows the circle that its flight shows (its mean over the training part), so that it lies in the class that is fitted
    radius, course, speed, turn = evaluate(("radius_error", "course_error", "speed", "r"), z, fit_pattern(z, np.arange(n) < 3000))
    truth = {
        "rudder": 0.02 * radius + 0.4 * course + 0.3 * turn + 0.1 * np.tanh(4 * course) * 40 / speed,
        "elevator": 0.05 - 0.01 * radius + 0.2 * turn,
    }
    shaken = {k: s + noise * NOISE.get(k, 0) * r.normal(size=n) for k, s in m.items()}
    return replace(log, measured=shaken, inputs=dict(log.inputs) | {s: truth[s] for s in surfaces})


PARTS = ([(0, 3000)], [(3000, 4200)])
FIXED = ("radius_error", "course_error", "speed", "r")
