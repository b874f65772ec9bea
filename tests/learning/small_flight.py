"""A small kite and synthetic flights of it, made here: what the learning tests and the gradient benchmark fly."""

import numpy as np

from awescli.flightlog.log import FlightLog, WindRecord
from awescli.notation.quantities import MEASURED, OUTPUTS, SURFACES
from awescli.physics.declaration import KiteDeclaration, WindLaw
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Segments, Simulator

VALUES = {
    "m": 8.0, "g": 9.81, "S": 3.0, "b": 5.0, "c": 0.6, "Jx": 9.0, "Jy": 4.0, "Jz": 12.0, "Jxz": 0.1, "d_t": 0.002, "CtD": 1.0,
    "rtx": 0.0, "rty": 0.0, "rtz": 0.1, "k_v": 300.0, "c_v": 100.0, "dl": 0.0,
    "CD0": 0.06, "CDa2": 1.0, "CYb": -0.8, "CL0": 0.5, "CLa": 4.5, "Clb": -0.05, "Clp": -0.5, "Clr": 0.1, "Cldr": 0.02,
    "Cm0": 0.02, "Cma": -0.7, "Cmq": -12.0, "Cnb": 0.06, "Cnr": -0.12, "Cnp": -0.05, "Cndr": -0.06,
}  # fmt: skip
TERMS = {
    "CD": {"1": "CD0", "alpha^2": "CDa2"}, "CY": {"beta": "CYb"}, "CL": {"1": "CL0", "alpha": "CLa"},
    "Cl": {"beta": "Clb", "p_hat": "Clp", "r_hat": "Clr", "rudder": "Cldr"}, "Cm": {"1": "Cm0", "alpha": "Cma", "q_hat": "Cmq"},
    "Cn": {"beta": "Cnb", "p_hat": "Cnp", "r_hat": "Cnr", "rudder": "Cndr"},
}  # fmt: skip
RADIUS = 120.0


def declaration(effects=("gravity", "aerodynamics", "tether"), **values) -> KiteDeclaration:
    rows = {name: {"value": value} for name, value in {**VALUES, **values}.items()}
    return KiteDeclaration(
        name="small", parameters=rows, aerodynamics={"terms": TERMS}, effects=effects, wind=WindLaw(law="uniform")
    )  # fmt: skip


def small_kite(effects=("gravity", "aerodynamics", "tether"), **values) -> Kite:
    """A kite of 8 kg on 120 m of line, uniform wind."""
    return Kite(declaration(effects, **values), (10.0,))


def start() -> np.ndarray:
    """Downwind (wind from the south), 30 degrees up, flying sideways at 20 m/s."""
    up, psi, phi = np.radians(30.0), np.radians(90.0), np.radians(-35.0)
    return np.array([RADIUS * np.cos(up), 0.0, -RADIUS * np.sin(up), 20.0, 0.0, 1.0, phi, 0.05, psi, 0.0, 0.0, 0.0])


def small_segments(kite: Kite, count: int, steps: int, seed: int = 0) -> Segments:
    """Segments that start near `start()`, with a moving rudder and a wind of 8 m/s."""
    rng = np.random.default_rng(seed)
    starts = start() + rng.normal(size=(count, 12)) * np.array([1, 1, 1, 0.5, 0.2, 0.2, 0.03, 0.03, 0.03, 0.05, 0.05, 0.05])
    time = 0.02 * np.arange(steps + 1)
    setpoints = np.zeros((count, steps + 1, len(SURFACES)))
    setpoints[:, :, SURFACES.index("rudder")] = 0.05 * np.sin(2 * np.pi * (0.5 * time[None] + rng.random((count, 1))))
    inputs = np.zeros((count, steps + 1, len(kite.input_names)))
    length = np.linalg.norm(starts[:, :3], axis=1)
    for name, value in {"tether_length": length[:, None], "density": 1.2, "wind_speed_0": 8.0, "wind_direction_0": np.pi}.items():
        inputs[:, :, kite.input_names.index(name)] = value
    return Segments(np.arange(count), starts, setpoints, inputs, 0.02)


def small_flight(truth: Kite, flights: int = 8, steps: int = 250, seed: int = 0) -> tuple[FlightLog, list[tuple[int, int]]]:
    """(log, range of each flight): short flights of `truth` one after the other, with the declared sensor noise, as one log."""
    rng = np.random.default_rng(seed)
    segments = small_segments(truth, flights, steps, seed)
    outputs = Simulator(truth, ()).rollout(segments).outputs
    noise = truth.declaration.noise
    std = {
        **{f"p_{a}": s for a, s in zip("ned", noise.position, strict=True)}, **dict.fromkeys(("v_n", "v_e", "v_d"), noise.velocity),
        **dict.fromkeys(("phi", "theta", "psi"), noise.euler), **dict.fromkeys("pqr", noise.rates), "V_a": noise.airspeed,
        **dict.fromkeys(("a_x", "a_y", "a_z"), noise.acceleration), **dict.fromkeys(("alpha", "beta"), noise.flow_angles), "tension": 10.0,
    }  # fmt: skip
    n = flights * (steps + 1)
    measured = {}
    for i, name in enumerate(MEASURED):
        assert OUTPUTS[i] == name
        signal = outputs[:, :, i].reshape(n) + std[name] * rng.normal(size=n)
        measured[name] = signal
    at = truth.input_names.index
    inputs = {name: segments.setpoints[:, :, i].reshape(n).copy() for i, name in enumerate(SURFACES)}
    inputs["tether_length"] = segments.inputs[:, :, at("tether_length")].reshape(n).copy()
    inputs["reel_out_speed"] = np.zeros(n)
    one = np.ones((2, 1))
    wind = WindRecord(np.array([0.0, 0.02 * n]), np.array([10.0]), 8.0 * one, np.pi * one, 0.0 * one, np.array([1.2, 1.2]))
    log = FlightLog("small", 0.0, 0.02, 0.02 * np.arange(n), measured, inputs, np.ones(n, bool), wind)
    # a few samples at the seams are left out: smoothing looks across them
    return log, [(k * (steps + 1) + 10, (k + 1) * (steps + 1) - 10) for k in range(flights)]

