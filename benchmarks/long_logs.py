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
from pathlib import Path

import awescli  # noqa: F401  (thread settings before numpy)

# isort: split
import numpy as np
from long_logs_faults import FAULTS, Faulty, hard_to_use, spoil, without_optional
from long_logs_flight import flight

from awescli.artifacts import write_text
from awescli.flightlog.log import FlightLog

HERE = Path(__file__).parent
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
