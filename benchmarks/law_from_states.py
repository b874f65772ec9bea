"""Are set-points a function of the states, and can a flight tell it? python benchmarks/law_from_states.py FLIGHT --kite KITE.yaml

Asked where a fitted law does not fly: a kernel ridge regression of every moving surface on 16 numbers that a law may look at (and again
with their past of one second), whose width and ridge validation chooses. Blocks of time are held out, longer and longer ones: what a
smooth law of the states does not tell across a quarter of a second, something else has moved; what it tells across that and not across
three seconds is a law that the flight shows too little of. Beside it: how long the declared kite flies under the recorded set-points
themselves.
Writes results/law_from_states.md.
"""

import argparse
from pathlib import Path

import numpy as np

import awescli  # noqa: F401, I001  (before numpy: one BLAS thread)
from awescli.artifacts import write_text
from awescli.controller_fit.samples import Samples, available, feature_matrix, gather, standardisation
from awescli.flightlog.loops import find_loops
from awescli.flightlog.read import read_flight
from awescli.flightlog.split import split
from awescli.notation.quantities import MEASURED
from awescli.physics.declaration import read_kite
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import observe
from awescli.simulation.survival import samples_flown

HERE = Path(__file__).parent
STATE = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "sin_phi", "cos_phi", "sin_theta", "sin_psi", "cos_psi", "p", "q", "r",
         "tether_length", "reel_out_speed")  # fmt: skip
HELD_OUT = (0.1, 0.25, 0.5, 1.0, 2.0, 3.0, 6.0)
"""[s] length of the blocks."""
WIDTHS, RIDGES = (0.5, 1.0, 2.0, 4.0, 8.0), (1e-4, 1e-3, 1e-2, 1e-1, 1.0)
PAST = (0.0, 0.2, 0.5, 1.0)
"""[s]"""
DRAWS = 5
"""Deals of the blocks to train, validation and test (60, 15, 25 %); the median of their errors is said."""
STARTS = 8


def errors(X: np.ndarray, u: np.ndarray, train: np.ndarray, validation: np.ndarray, test: np.ndarray) -> float:
    """NRMSE of u (N,) on `test` of the regression on X (N, F), width and ridge chosen on `validation`."""
    best = (np.inf, np.inf)
    for width in WIDTHS:
        d = width * np.sqrt(X.shape[1])

        def kernel(rows: np.ndarray, d: float = d) -> np.ndarray:
            a, b = X[rows], X[train]
            return np.exp(-0.5 * ((a**2).sum(1)[:, None] + (b**2).sum(1)[None] - 2.0 * a @ b.T) / d**2)

        mean = u[train].mean()
        eigenvalues, V = np.linalg.eigh(kernel(train))
        y, asked = V.T @ (u[train] - mean), {part: kernel(rows) @ V for part, rows in (("v", validation), ("t", test))}
        for ridge in RIDGES:
            a = y / (np.maximum(eigenvalues, 0.0) + ridge)
            v, t = (np.sqrt(np.mean((asked[k] @ a + mean - u[rows]) ** 2)) for k, rows in (("v", validation), ("t", test)))
            best = min(best, (v, t / np.ptp(u)))
    return best[1]


def told(samples: Samples, X: np.ndarray, length: float) -> list[float]:
    """NRMSE of every surface on held-out blocks of `length` seconds."""
    rows = np.flatnonzero(samples.train | samples.validation | samples.test)
    block = (rows * samples.dt / length + 1e-9).astype(int)
    found = []
    for draw in range(DRAWS):
        order = np.random.default_rng(draw).permutation(np.unique(block))
        edges = (np.array([0.6, 0.75]) * order.size).astype(int)
        parts = [rows[np.isin(block, b)] for b in np.split(order, edges)]
        found.append([errors(X, u, *parts) for u in samples.set_points.T])
    return np.median(found, axis=0).tolist()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("flight", type=Path)
    parser.add_argument("--kite", type=Path, default=HERE.parent / "examples" / "ampyx_ap2" / "kite.yaml")
    arguments = parser.parse_args()
    log, kite = read_flight(arguments.flight), read_kite(arguments.kite)
    parts = split(find_loops(log), order="interleaved", log=log)
    samples = gather(log, parts.train, parts.validation)
    names, _ = available(samples, STATE)
    X = feature_matrix(samples.smoothed, names, samples.pattern, *standardisation(samples.smoothed, names, samples.pattern, samples.train))
    now = np.arange(len(X))
    past = np.concatenate([X[np.maximum(now - round(s / samples.dt), 0)] for s in PAST], axis=1)
    columns = [*samples.surfaces, *(f"{s}, with their past of 1 s" for s in samples.surfaces)]
    lines = ["# Are the set-points a function of the states?", "",
             f"`python benchmarks/{Path(__file__).name} {arguments.flight.name.upper()}`", "",
             f"{len(names)} states, {len(X) * samples.dt:.0f} s; NRMSE of a kernel regression on held-out blocks, median of {DRAWS} deals.",
             "", "| held out [s] | " + " | ".join(columns) + " |", "| --- |" + " --- |" * len(columns)]  # fmt: skip
    for length in HELD_OUT:
        row = [f"{e:.3f}" for regressors in (X, past) for e in told(samples, regressors, length)]
        lines.append(f"| {length:g} | " + " | ".join(row) + " |")
        print(lines[-1], flush=True)
    simulator = Simulator(Kite(kite, log.recorded_wind.height))
    first = np.linspace(0, len(log) // 2, STARTS).astype(int)
    steps = len(log) - int(first.max()) - 2
    trajectories = simulator.rollout(observe(log, simulator.kite, first, steps, MEASURED).segments)
    seconds = (samples_flown(trajectories) - 1) * log.dt
    lines += ["", "The declared kite under the recorded set-points, from measured states, flies "
              + ", ".join(f"{s:.1f}" for s in seconds) + f" s ({steps * log.dt:.0f} s were asked)."]  # fmt: skip
    print(lines[-1])
    write_text(HERE / "results" / "law_from_states.md", "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
