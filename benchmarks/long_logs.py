"""Long flight logs with known faults: python benchmarks/long_logs.py [--hours 2 --rate 50 | --campaign N]

Writes a log of pumping cycles (ground, hover, transition, traction in loops or figures of eight, retraction, ...) in Kitemill's columns,
first clean, then with faults put in at known places, reads it back and compares sample by sample: what is called valid must be true,
what was not touched must be kept, every kind of fault must be named. Without --campaign it also measures how long and in how much memory
the log loads; results go to benchmarks/results/long_logs.md.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import awescli  # noqa: F401  (thread settings before numpy)

# isort: split
import numpy as np
import polars as pl
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from awescli.artifacts import write_text
from awescli.flightlog.kitemill_csv import to_kitemill_csv
from awescli.flightlog.log import FlightLog, WindRecord
from awescli.notation.angles import wrap
from awescli.notation.frames import rotate_back, rotation_body_to_ned

HERE = Path(__file__).parent
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


# --- faults -----------------------------------------------------------------------------------------------------------------


@dataclass
class Faulty:
    """A table in the making. untrue: row -> must not be called valid at its old value; named: words that the reader must say."""

    frame: dict[str, np.ndarray]
    rate: float
    rng: np.random.Generator
    drop: np.ndarray = field(init=False)
    named: dict[str, str] = field(default_factory=dict)
    used: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self):
        self.drop = np.zeros(len(self.frame["epoch_ms"]), bool)

    def place(self, seconds: float) -> slice:
        """A stretch of the flown middle that no other fault touches, with a margin around it."""
        n, length, margin = self.drop.size, max(1, int(round(seconds * self.rate))), int(3 * self.rate)
        for _ in range(1000):
            first = int(self.rng.integers(int(0.25 * n), int(0.75 * n) - length))
            if all(first + length + margin < a or first > b + margin for a, b in self.used):
                self.used.append((first, first + length))
                return slice(first, first + length)
        raise ValueError("the log is too short for so many faults")


def gaps(f: Faulty) -> None:
    for seconds in (0.5, 2.0, 12.0):
        f.drop[f.place(seconds)] = True
    f.named["gaps"] = "gaps are longer than"


def short_gaps(f: Faulty) -> None:
    for _ in range(3):
        f.drop[f.place(min(0.1, 1 / f.rate))] = True


def repeated(f: Faulty) -> None:
    part = f.place(0.5)
    f.frame["epoch_ms"][part] = f.frame["epoch_ms"][part.start]
    f.named["repeated"] = "repeated time stamp"


def backward(f: Faulty) -> None:
    part = f.place(0.8)
    f.frame["epoch_ms"][part] -= 5000.0
    f.named["backward"] = "run backward"


def stray(f: Faulty) -> None:
    for value in (0.0, 4e12):
        f.frame["epoch_ms"][f.place(1 / f.rate).start] = value
    f.named["stray"] = "stray time stamp"


def unreadable_stamp(f: Faulty) -> None:
    f.frame["epoch_ms"][f.place(1 / f.rate).start] = np.nan
    f.named["unreadable"] = "without a readable time stamp"


def dropout(f: Faulty) -> None:
    for column, seconds in (("phi", 1.0), ("V_a", 6.0), ("r_eb_eN", 0.4), ("rudder_sp", 1.5), ("tether_length", 2.0)):
        f.frame[column][f.place(seconds)] = np.nan
    f.named["missing_cells"] = "missing values"


def zeros(f: Faulty) -> None:
    for column in ("r_eb_eN", "V_a"):
        f.frame[column][f.place(0.6)] = 0.0
    f.named["dropout"] = "jumps to"


def stuck(f: Faulty) -> None:
    for column in ("q", "psi", "LoadFiltered", "tether_length"):
        part = f.place(4.0)
        f.frame[column][part] = f.frame[column][part.start]
    f.named["stuck"] = "stands still"


def saturated(f: Faulty) -> None:
    limit = np.nanpercentile(f.frame["LoadFiltered"], 97)
    f.frame["LoadFiltered"] = np.minimum(f.frame["LoadFiltered"], limit)
    f.named["saturated"] = "is cut off at"


def spikes(f: Faulty) -> None:
    for column, size in (("V_a", 300.0), ("r_eb_eD", 2000.0), ("theta", 150.0), ("LoadFiltered", 9000.0), ("rudder_sp", 900.0)):
        for sign in (1, -1):
            f.frame[column][f.place(1 / f.rate).start] += sign * size
    f.named["spikes"] = "spikes"


def compass(f: Faulty) -> None:
    """Heading from 0 to 360 deg."""
    f.frame["psi"] = np.mod(f.frame["psi"], 360.0)


def without_optional(f: Faulty) -> None:
    for column in ("a_eb_bX", "elevator_sp"):
        del f.frame[column]


def other_order(f: Faulty) -> None:
    names = list(f.rng.permutation(list(f.frame)))
    f.frame = {"camber_sp": np.zeros(f.drop.size), **{str(n): f.frame[str(n)] for n in names}, "battery": np.ones(f.drop.size)}


FAULTS: tuple[Callable[[Faulty], None], ...] = (
    gaps, short_gaps, repeated, backward, stray, unreadable_stamp, dropout, zeros, stuck, saturated, spikes, compass, without_optional,
    other_order,
)  # fmt: skip


def spoil(log: FlightLog, faults, seed: int) -> tuple[pl.DataFrame, str, Faulty]:
    """(table of kite.csv, text of wind.csv, what was done) of a clean log with faults put in."""
    text, wind = to_kitemill_csv(log)
    clean = pl.read_csv(text.encode(), infer_schema_length=None)
    columns = {name: clean[name].to_numpy().astype(float, copy=True) for name in clean.columns}
    faulty = Faulty(columns, 1 / log.dt, np.random.default_rng(seed))
    for fault in faults:
        fault(faulty)
    frame = pl.DataFrame({k: pl.Series(x).fill_nan(None) for k, x in faulty.frame.items()})
    return frame.filter(~faulty.drop), wind, faulty


def hard_to_use(log: FlightLog, label: np.ndarray) -> FlightLog:
    """The same flight with a slack line in the first traction phase and surfaces that do not move in the last, 30 s each."""
    traction = np.flatnonzero(label == "traction")
    length, settled = int(30 / log.dt), int(30 / log.dt)
    slack = slice(traction[0] + settled, traction[0] + settled + length)
    still = slice(traction[-1] - settled - length, traction[-1] - settled)
    measured = {k: x.copy() for k, x in log.measured.items()}
    inputs = {k: x.copy() for k, x in log.inputs.items()}
    measured["tension"][slack] = 10.0 + 0.02 * (measured["tension"][slack] - 2500.0)
    for name in ("aileron", "rudder"):
        inputs[name][still] = 0.05
    return FlightLog(log.name, log.start, log.dt, log.time, measured, inputs, log.valid, log.wind)


# --- what the reader makes of it --------------------------------------------------------------------------------------------

MAX_GAP = 0.2
"""s, the reader's stated longest gap that is interpolated."""


def judge(clean: FlightLog, label: np.ndarray, faulty: Faulty, read: FlightLog) -> dict:
    """What the reader made of a faulty log, against the clean one it came from.

    wrong: samples called valid that are not true (to rounding; between the neighbours where a single sample was interpolated);
    bridged: valid samples further than MAX_GAP from the next sample of the file; lost: share of untouched samples called invalid;
    unnamed: faults that no note tells; phases: share of the time, 5 s around changes left out, with the right phase.
    """
    at = np.rint((read.start - clean.start + read.time) / clean.dt).astype(int)
    touched = np.zeros(len(clean), bool)
    for first, last in faulty.used:
        touched[first:last] = True
    wrong = np.zeros(len(read), bool)
    for name in (*read.measured, *read.inputs):
        true, got = clean[name], read[name]
        step = np.maximum(np.abs(np.diff(true, prepend=true[0])), np.abs(np.diff(true, append=true[-1])))
        # twice the rounding of the file's four decimals, whatever the unit; where touched, what lies between the neighbours
        allowed = np.where(touched, 2 * np.maximum(step, np.roll(step, 1)), 0.0) + 2e-3 * max(1.0, np.abs(true).max() / 1e3)
        off = np.abs(got - true[at])
        off = np.minimum(off, 2 * np.pi - off) if name in ("phi", "theta", "psi") else off
        wrong |= off > allowed[at]
    # distance to the samples that stayed in the file, forward and backward
    there = np.flatnonzero(~faulty.drop)
    bridge = (np.diff(there, prepend=there[0]) * clean.dt > MAX_GAP + 1.5 * clean.dt).nonzero()[0]
    bridged = sum(int(read.valid[(at > there[k - 1]) & (at < there[k])].sum()) for k in bridge)
    saturated = "saturated" in faulty.named
    high = clean["tension"] >= np.percentile(clean["tension"], 96.5) if saturated else np.zeros(len(clean), bool)
    untouched = ~(touched | high)[at]
    from awescli.flightlog.phases import phases

    edges = np.flatnonzero(label[1:] != label[:-1])
    settled = np.ones(len(label), bool)
    for edge in edges:
        settled[max(0, edge - int(5 / clean.dt)) : edge + int(5 / clean.dt)] = False
    settled &= label != "transition"
    told = " ".join(read.notes)
    return {
        "wrong": int((wrong & read.valid).sum()),
        "bridged": bridged,
        "lost": float((untouched & ~read.valid).sum() / untouched.sum()),
        "unnamed": [kind for kind, words in faulty.named.items() if words not in told],
        "phases": float((phases(read) == label[at])[settled[at]].mean()),
    }


def try_one(hours: float, rate: float, seed: int, faults=FAULTS) -> dict:
    """Make, spoil, read, judge one log."""
    from awescli.flightlog.quality import data_quality
    from awescli.flightlog.read import read_flight

    clean, label = flight(hours * 3600, rate, seed)
    clean = hard_to_use(clean, label)
    frame, wind, faulty = spoil(clean, faults, seed)
    with tempfile.TemporaryDirectory() as folder:
        frame.write_csv(Path(folder) / "kite.csv")
        (Path(folder) / "wind.csv").write_text(wind)
        read = read_flight(Path(folder), MAX_GAP)
    quality = data_quality(read)
    unused = {key.rpartition(": ")[2] for key in quality.left_out if "left out" in key}
    found = judge(clean, label, faulty, read)
    found["unnamed"] += sorted({"slack line", "no excitation"} - unused)
    return found | {"rows": frame.height, "rate": rate, "loops": quality.loops, "left_out": dict(quality.left_out)}


def clean_of_faults(found: dict) -> bool:
    """Nothing untrue called valid, nothing bridged, every fault named, phases right, little lost."""
    return not (found["wrong"] or found["bridged"] or found["unnamed"]) and found["lost"] < 0.01 and found["phases"] > 0.95


MEASURE = """
import json, sys, time
from pathlib import Path
from awescli.flightlog.read import read_flight
begin, cpu = time.perf_counter(), time.process_time()
log = read_flight(Path(sys.argv[1]))
seconds, cpu = time.perf_counter() - begin, time.process_time() - cpu
# not getrusage: its peak is that of the parent where that was larger
peak = next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(json.dumps({"seconds": seconds, "cpu": cpu, "peak_mb": peak / 1024, "samples": len(log)}))
"""


def measure(hours: float, rate: float, repeats: int = 5) -> dict:
    """Seconds and memory of `read_flight` on a spoiled log, in a process of its own; the median of several."""
    clean, _ = flight(hours * 3600, rate)
    frame, wind, _ = spoil(clean, [f for f in FAULTS if f is not without_optional], 0)
    with tempfile.TemporaryDirectory() as folder:
        frame.write_csv(Path(folder) / "kite.csv")
        (Path(folder) / "wind.csv").write_text(wind)
        runs = [
            json.loads(subprocess.run([sys.executable, "-c", MEASURE, folder], capture_output=True, text=True, check=True).stdout)
            for _ in range(repeats)
        ]
    seconds = sorted(r["seconds"] for r in runs)
    return {
        "rows": frame.height, "columns": frame.width, "seconds": seconds, "cpu": sorted(r["cpu"] for r in runs)[repeats // 2],
        "peak_mb": max(r["peak_mb"] for r in runs), "load": os.getloadavg()[0],
    }  # fmt: skip


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--rate", type=float, default=50.0, help="Hz")
    parser.add_argument("--campaign", type=int, default=0, metavar="N", help="N logs of half an hour at 10, 20, 50 and 100 Hz in turn")
    options = parser.parse_args(arguments)
    lines = []
    if options.campaign:
        rates = (10.0, 20.0, 50.0, 100.0)
        all_found = [try_one(0.5, rates[i % 4], 100 + i) for i in range(options.campaign)]
        lines += ["| rate [Hz] | logs | rows | wrong but valid | bridged | lost [%] | faults not named | phases right [%] | good |",
                  "|---|---|---|---|---|---|---|---|---|"]  # fmt: skip
        for rate in rates:
            if some := [f for f in all_found if f["rate"] == rate]:
                cells = [
                    f"{rate:g}", len(some), *(sum(f[key] for f in some) for key in ("rows", "wrong", "bridged")),
                    f"{100 * max(f['lost'] for f in some):.2f}", sum(len(f["unnamed"]) for f in some),
                    f"{100 * min(f['phases'] for f in some):.1f}", sum(map(clean_of_faults, some)),
                ]  # fmt: skip
                lines.append("| " + " | ".join(map(str, cells)) + " |")
        name = "long_logs_faults.md"
    else:
        m = measure(options.hours, options.rate)
        lines += [
            f"{m['rows']} rows x {m['columns']} columns with all faults, read 5 times: {m['seconds'][0]:.2f} to {m['seconds'][-1]:.2f} s "
            f"(median {m['seconds'][2]:.2f} s), CPU time {m['cpu']:.2f} s, peak memory of the process {m['peak_mb']:.0f} MB.",
            "", f"{os.cpu_count()} cores, load {m['load']:.1f} at the end: beside other work the CPU time is what counts.",
        ]  # fmt: skip
        name = "long_logs.md"
    command = "python benchmarks/long_logs.py " + " ".join(sys.argv[1:] if arguments is None else arguments)
    write_text(HERE / "results" / name, "\n".join(["# Long logs", "", f"`{command.strip()}`", "", *lines, ""]))
    print("\n".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
