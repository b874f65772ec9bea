"""A 90-minute log: does subsampling the choices of a controller fit cost accuracy, and what does the fit need?

    python benchmarks/controller_size.py [--minutes 90] [--seed 301] [--everything SAMPLES] [--out benchmarks/results/controller_size.md]

The flight is simulated: the development kite on its circle for 90 minutes at 50 Hz (270,000 samples, some 600 loops) by this project's
path-following law, in a wind whose speed and direction drift from minute to minute, on a line that reels out 2 cm a second with a swing;
simulated in pieces of ten minutes, each from the last state of the one before. Each fit runs in a process of its own: wall and processor
time, largest resident memory. Always fitted to all train and validation samples in blocks; subsampled are the choices (features, widths,
number of centres, ridge, the convex step). `everything` makes the choices of the basis (width, centres and their order, ridge) on every
sample of the train part, and their scores on every sample of the validation part; --everything limits that. Only the linear program of
the convex step, whose time grows faster than its size, stays at twice the default there (600 samples), and the stand-in that ranks sets
of features at its own.
"""

import awescli  # noqa: F401, I001  (before numpy: one BLAS thread)
import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from awescli.artifacts import read_arrays, write_arrays, write_text
from awescli.controller_fit.config import ControllerConfig
from awescli.controller_fit.fit import fit_controller
from awescli.flightlog.log import FlightLog
from awescli.flightlog.loops import find_loops
from awescli.flightlog.split import split
from awescli.physics.declaration import read_kite
from awescli.physics.kite import Kite
from awescli.simulation.campaign_flights import HEIGHTS, CampaignFlight, dev_like
from awescli.simulation.made_wind import as_measured, wind_record
from awescli.simulation.synthetic import EPOCH, ReelOut, as_recorded, simulate_flight
from awescli.notation.quantities import STATES

ROOT = Path(__file__).parent.parent
PIECE = 600.0
"""[s] simulated at once."""


def long_flight(minutes: float, seed: int, effects: Mapping[str, Mapping[str, float]] | None = None) -> CampaignFlight:
    """The flight, as recorded, and what its user would declare; wind and circle are those of campaign flight `seed`, the line hardly reels
    out. effects: that nobody declares, without states (a piece begins without a past)."""
    truth = read_kite(ROOT / "data" / "kites" / "development.yaml")
    short = dev_like(truth, seed, effects, duration=30.0, noise=False)
    kite, law, duration = Kite(short.flown, HEIGHTS), short.law, 60.0 * minutes
    wind = short.log.wind
    profile, direction = wind.speed.mean(axis=0), float(wind.direction.mean())
    wind = wind_record(np.array(HEIGHTS), profile, direction, duration, drift=0.03, turn=0.03, seed=seed)
    line, start, pieces = ReelOut(float(short.log["tether_length"][0]), 0.02, 0.35, 9.0), None, []
    for first in np.arange(0.0, duration, PIECE):
        flown = simulate_flight(
            kite, law.setpoints, replace(wind, time=wind.time - first), _From(line, first), pattern=law.pattern,
            duration=min(PIECE, duration - first), start=start, seed=seed,
        )  # fmt: skip
        if flown.departed:
            raise SystemExit(f"the kite departs {first + flown.time[-1]:.0f} s into the flight: choose another --seed")
        start = np.array([flown.outputs[name][-1] for name in STATES])
        recorded = as_recorded(flown, short.flown, wind, seed=seed + 1 + int(first / PIECE))
        pieces.append({name: signal[:-1] for name, signal in (dict(recorded.measured) | dict(recorded.inputs)).items()})
        inputs = tuple(recorded.inputs)
    signals = {name: np.concatenate([p[name] for p in pieces]) for name in pieces[0]}
    n = len(signals["p_n"])
    measured = {name: signal for name, signal in signals.items() if name not in inputs}
    time, inputs = 0.02 * np.arange(n), {name: signals[name] for name in inputs}
    return replace(short, log=FlightLog("long", EPOCH, 0.02, time, measured, inputs, np.ones(n, bool), as_measured(wind, seed + 1)))


class _From:
    """A winch seen from a later time on."""

    def __init__(self, line: ReelOut, first: float):
        self.line, self.first = line, first

    def at(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.line.at(time + self.first)


def fitted(folder: Path, samples: int | None) -> dict:
    """One fit of the stored flight, and what it needed."""
    arrays = read_arrays(folder / "log.npz")
    names = [str(n) for n in arrays["inputs"]]
    signals = {k[2:]: v for k, v in arrays.items() if k.startswith("s_")}
    n = len(signals["p_n"])
    log = FlightLog("long", 0.0, 0.02, 0.02 * np.arange(n), {k: v for k, v in signals.items() if k not in names},
                    {k: signals[k] for k in names}, np.ones(n, bool))  # fmt: skip
    parts = split(find_loops(log), log=log)
    train = sum(last - first for first, last in parts.train)
    config = ControllerConfig()
    if samples is not None:
        config = ControllerConfig(selection_samples=min(samples, 2 * train), convex_samples=600, convex_pairs=400)
    begin, used = time.perf_counter(), time.process_time()
    report = fit_controller(log, parts.train, parts.validation, config).report
    return {
        "choices on": min(config.selection_samples, train), "fitted to": report["samples"], "loops": report["loops"],
        "wall [s]": time.perf_counter() - begin,
        "processor [s]": time.process_time() - used, "memory [GB]": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        "terms": report["nonzeros"], "features": len(report["features"]["chosen"]),
        **{f"{part} NRMSE": report["nrmse"][part]["rudder"] for part in ("validation", "test")},
        "test, smoothed": report["nrmse_smoothed"]["test"]["rudder"], "test, noise alone": report["noise_nrmse"]["test"]["rudder"],
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=90.0)
    parser.add_argument("--seed", type=int, default=301)
    parser.add_argument("--everything", type=int, default=10**9)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "results" / "controller_size.md")
    parser.add_argument("--fit", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.fit:
        folder, samples = arguments.fit
        print(json.dumps(fitted(Path(folder), int(samples) or None)))
        return
    with tempfile.TemporaryDirectory() as folder:
        log = long_flight(arguments.minutes, arguments.seed).log
        print(f"flown: {len(log)} samples", flush=True)
        signals = {f"s_{name}": signal for name, signal in (dict(log.measured) | dict(log.inputs)).items()}
        write_arrays(Path(folder) / "log.npz", signals | {"inputs": np.array(list(log.inputs))})
        del log, signals
        rows = []
        for samples in (0, arguments.everything):
            ask = [sys.executable, __file__, "--fit", folder, str(samples)]
            rows.append(json.loads(subprocess.run(ask, check=True, capture_output=True, text=True).stdout.splitlines()[-1]))
            print(rows[-1], flush=True)
    ratio = rows[0]["test NRMSE"] / rows[1]["test NRMSE"]
    cell = lambda v: str(v) if isinstance(v, int) else f"{v:.4f}" if v < 0.1 else f"{v:.1f}"  # noqa: E731
    busy = f"load average {os.getloadavg()[1]:.0f} (wall time is that of a busy machine where this is above the number of cores)"
    lines = ["# A 90-minute log", "", f"`python benchmarks/{Path(__file__).name}`, {os.cpu_count()} cores, {busy}.", ""]
    lines += ["| | subsampled | everything |", "| --- | --- | --- |"]
    lines += [f"| {key} | {cell(rows[0][key])} | {cell(rows[1][key])} |" for key in rows[0]]
    write_text(arguments.out, "\n".join([*lines, "", f"Test NRMSE, subsampled over everything: {ratio:.3f}.", ""]))


if __name__ == "__main__":
    main()
