"""Flights with a closed form, for the tests of the readers: a circle flown around a point downwind, in Kitemill's columns."""

from pathlib import Path

import numpy as np
import polars as pl

from awescli.flightlog.kitemill_csv import to_kitemill_csv
from awescli.flightlog.log import FlightLog, WindRecord
from awescli.notation.angles import wrap
from awescli.notation.frames import rotate_back, rotation_body_to_ned

SHARED = Path(__file__).parents[2].parent / "shared"
START = 1_700_000_000_000


def circle(seconds=60.0, rate=50.0, period=8.0, turn=1, noise=0.0, reel=0.8, seed=0) -> FlightLog:
    """A circle of 30 m radius on a line that is reeled out; heading along the velocity, rates from the exact attitude."""
    n = int(seconds * rate)
    time = np.arange(n) / rate
    phase = turn * 2 * np.pi * time / period
    range_ = 250.0 + reel * time

    def at(t):
        ph, r = turn * 2 * np.pi * t / period, 250.0 + reel * t
        az, el = 0.12 * np.sin(ph), np.deg2rad(35) + 0.12 * np.cos(ph)
        return np.array([r * np.cos(el) * np.cos(az), r * np.cos(el) * np.sin(az), -r * np.sin(el)])

    h = 1e-3
    p, v, a = at(time), (at(time + h) - at(time - h)) / (2 * h), (at(time + h) - 2 * at(time) + at(time - h)) / h**2
    phi, theta = 0.4 + 0.1 * np.sin(phase), 0.3 * np.cos(phase)
    psi = np.arctan2(v[1], v[0])
    dphi, dtheta, dpsi = (np.gradient(np.unwrap(x), 1 / rate) for x in (phi, theta, psi))
    a_body = rotate_back(rotation_body_to_ned(phi, theta, psi), tuple(a))
    rng = np.random.default_rng(seed)
    clean = {
        "p_n": p[0], "p_e": p[1], "p_d": p[2], "v_n": v[0], "v_e": v[1], "v_d": v[2], "phi": phi, "theta": theta, "psi": wrap(psi),
        "p": dphi - dpsi * np.sin(theta), "q": dtheta * np.cos(phi) + dpsi * np.sin(phi) * np.cos(theta),
        "r": -dtheta * np.sin(phi) + dpsi * np.cos(phi) * np.cos(theta), "a_x": a_body[0], "a_y": a_body[1], "a_z": a_body[2],
        "V_a": np.sqrt((v[0] - 8.0) ** 2 + v[1] ** 2 + v[2] ** 2) + 0.0, "tension": 2000 + 500 * np.cos(phase),
    }  # fmt: skip
    measured = {k: x + noise * rng.standard_normal(n) for k, x in clean.items()}
    measured["psi"] = wrap(measured["psi"])
    inputs = {
        "aileron": np.zeros(n) + 0.01, "rudder": 0.2 + 0.1 * np.sin(phase), "flaps": np.zeros(n) + 0.08, "elevator": np.zeros(n) - 0.03,
        "throttle": 0.5 + 0.2 * np.cos(phase),
        "tether_length": range_ + 0.0, "reel_out_speed": np.full(n, reel),
    }  # fmt: skip
    wind = WindRecord(
        np.array([0.0, seconds]), np.array([10.0]), np.full((2, 1), 8.0), np.full((2, 1), np.pi + 0.1), np.zeros((2, 1)), np.full(2, 1.2)
    )
    return FlightLog("circle", START / 1000, 1 / rate, time, measured, inputs, np.ones(n, bool), wind)


def write_folder(folder: Path, log: FlightLog, change=None) -> Path:
    """`log` as a Kitemill folder; `change` maps the table (a polars frame) to the one that is written."""
    kite, wind = to_kitemill_csv(log)
    folder.mkdir(parents=True, exist_ok=True)
    if change is not None:
        frame = change(pl.read_csv(kite.encode(), infer_schema_length=None))
        kite = frame.write_csv()
    (folder / "kite.csv").write_text(kite)
    (folder / "wind.csv").write_text(wind)
    return folder
