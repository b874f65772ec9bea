"""What kinematics alone tells of sensors: python benchmarks/flight_path.py [--flights N] [--ap2 FOLDER_WITH_THE_MAT] [--family F]

Flights of the development kite, known exactly, logged by sensors drawn from a seed (sensors.py): noise 0.5 to 2 times the kite file's,
attitude that drifts by 0.2 to 1 deg within 2 to 20 s, gusts up to 0.8 m/s, a wind record that is off by 1 m/s, 10, 25 or 50 Hz, half of
them with vanes. `clean` ones hold nothing else; the others one error of a sensor each, at its listed size. Counted: levels against truth,
intervals, what is found that is there, and what is found that is not. With --ap2 also the errors of trial flight AP2: each is put into the
measured record alone. Results are kept per flight in benchmarks/results/flight_path/ (resumable); the table goes to
benchmarks/results/flight_path.md. --jobs, --scheduler: campaign.py.
"""

import argparse
import sys
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from statistics import mean, median

from campaign import add_options, kept, run_campaign

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.artifacts import write_text

HERE = Path(__file__).parent
RESULTS = HERE / "results" / "flight_path"
DEG = 3.14159265358979 / 180

KINDS: dict[str, tuple[dict, str, str, float]] = {
    "position late": ({"late": {("p_n", "p_e", "p_d"): 0.15}}, "position_latency", "p_n", 0.15),
    "attitude late": ({"late": {("phi", "theta", "psi"): 0.06}}, "attitude_latency", "phi", 0.06),
    "velocity late": ({"late": {("v_n", "v_e", "v_d"): 0.1}}, "velocity latency", "v_n", 0.1),
    "rates late": ({"late": {("p", "q", "r"): 0.06}}, "rate latency", "p", 0.06),
    "acceleration late": ({"late": {("a_x", "a_y", "a_z"): 0.06}}, "acceleration latency", "a_x", 0.06),
    "airspeed low": ({"scale": 0.93}, "airspeed_scale", "V_a", -0.07),
    "airspeed slow": ({"lag": 0.6}, "airspeed_lag", "V_a", 0.6),
    "heading off": ({"bias": {"psi": 3 * DEG}}, "heading_bias", "psi", 3 * DEG),
    "pitch gyro off": ({"bias": {"q": 1.0 * DEG}}, "imu_bias", "q", 1.0 * DEG),
    "accelerometer off": ({"bias": {"a_z": 1.0}}, "imu_bias", "a_z", 1.0),
    "vane off": ({"vanes": True, "bias": {"alpha": 3.5 * DEG}}, "vane_bias", "alpha", 3.5 * DEG),
}
"""Kind -> how the sensors differ, and the error: name, channel, size [SI]."""


def run_flight(name: str, case: tuple[str, int]) -> dict:
    """One flight, its sensors, its reconstruction."""
    import numpy as np
    from sensors import Sensors

    from awescli.flightlog.reconstruction.flight_path import reconstruct
    from awescli.physics.declaration import read_kite
    from awescli.simulation.campaign_flights import dev_like

    kind, seed = case
    random = np.random.default_rng([seed, 77])
    truth = read_kite(HERE.parent / "data" / "kites" / "development.yaml")
    true = dev_like(truth, seed % 8, {}, noise=False, turn=(-1.0, 1.0)[seed % 2]).log
    drift, gusts = (random.uniform(0.2, 1.0) * DEG, random.uniform(2, 20)), (random.uniform(0.0, 0.8), random.uniform(2, 8))
    how = dict(
        factor=float(np.exp(random.uniform(np.log(0.5), np.log(2)))), attitude=drift, gusts=gusts, vanes=bool(seed % 4 < 2),
        wind=tuple(random.normal(0, [1.0, 1.0, 0.2])),
    )  # fmt: skip
    changed, *wrong = KINDS.get(kind, ({}, "", "", 0.0))
    sensors = Sensors(**how | changed)
    log = every(sensors.record(true, seed), int(random.choice([1, 2, 5])))
    begun = time.process_time()
    path = reconstruct(log)
    seconds = time.process_time() - begun
    levels = []
    for n in path.noise:
        white = sensors.factor * sensors.white.get(n.channel, 0.0)
        if white and n.white:
            levels.append((f"white {group(n.channel)}", n.white.value / white, n.white.low <= white <= n.white.high))
    for n in (n for n in path.noise if n.channel in ("phi", "psi")):
        if n.drift and n.memory:
            levels.append((f"drift {n.channel}", n.drift.value / drift[0], n.drift.low <= drift[0] <= n.drift.high))
            levels.append((f"memory {n.channel}", n.memory.value / drift[1], n.memory.low <= drift[1] <= n.memory.high))
    sizes = {(e.name, e.acts_on[0]): e for e in path.errors}
    true_sizes = {key: wrong[2] if key == tuple(wrong[:2]) else 0.0 for key in sizes}
    return {
        "kind": kind, "seed": seed, "rate": 1 / log.dt, "seconds": seconds, "levels": levels,
        "z": [[*key, (e.size - true_sizes[key]) / e.std] for key, e in sizes.items()],
        "found": [[e.name, e.acts_on[0], e.size, e.std] for e in path.findings],
    }  # fmt: skip


def every(log, stride: int):
    """Every `stride`-th row of a log."""
    rows = slice(None, None, stride)
    return replace(
        log, dt=log.dt * stride, time=log.time[rows], valid=log.valid[rows], measured={k: s[rows] for k, s in log.measured.items()},
        inputs={k: s[rows] for k, s in log.inputs.items()},
    )  # fmt: skip


def group(channel: str) -> str:
    """The kind of channel that a channel is of."""
    if channel[1:2] == "_" and channel != "V_a":
        return {"p": "position", "v": "velocity", "a": "acceleration"}[channel[0]]
    return {"V_a": "airspeed", "alpha": "vanes", "beta": "vanes"}.get(channel, "rates" if len(channel) == 1 else "attitude")


def measured_record(folder: Path) -> list[str]:
    """The rows of the measured AP2: each error put into its record alone."""
    import numpy as np

    from awescli.flightlog.read import read_flight
    from awescli.flightlog.reconstruction.flight_path import reconstruct
    from awescli.flightlog.reconstruction.tables import said

    log = read_flight(folder)
    late = {n: np.interp(log.time - 0.24, log.time, log[n]) for n in ("p_n", "p_e", "p_d")}
    errors = {
        "untouched": {}, "position 0.24 s late": late, "airspeed 10 % low": {"V_a": 0.9 * log["V_a"]},
        "pitch gyro 2.5 deg/s off": {"q": log["q"] + 2.5 * DEG}, "vane 3.5 deg off": {"alpha": log["alpha"] + 3.5 * DEG},
    }  # fmt: skip
    rows = ["", "Measured flight of the Ampyx AP2, 49 s (`--ap2`): each error alone in its record.", "", "| put in | found |", "|---|---|"]
    for name, change in errors.items():
        path = reconstruct(replace(log, measured={**log.measured, **change}))
        vane = "; ".join(f"cannot tell: {said(e)}" for e in path.errors if e.target == "alpha") if "alpha" in change else ""
        rows.append(f"| {name} | {'; '.join(said(e) for e in path.findings) or vane or 'nothing'} |")
    return rows


def table(results: list[dict], ap2: Iterable[str]) -> str:
    """Levels, intervals, what was found."""
    clean, seconds = sum(r["kind"] == "clean" for r in results), [r["seconds"] for r in results]
    lines = [
        "# Sensors from kinematics alone", "",
        f"`python benchmarks/flight_path.py --flights {clean} --family {results[0]['seed'] // 100_000}`: {len(results)} flights of 150 s, "
        f"{median(seconds):.1f} s of one core each (median; {max(seconds):.1f} s the longest).", "",
        "| level | told | measured / true, median | off by more than 10 % (white), 25 % (drift) | true one inside the 95 % interval |",
        "|---|---|---|---|---|",
    ]  # fmt: skip
    levels = [level for r in results for level in r["levels"]]
    for name in sorted({level[0] for level in levels}, reverse=True):
        own = [level for level in levels if level[0] == name]
        far = mean(abs(ratio - 1) > (0.1 if name.startswith("white") else 0.25) for _, ratio, _ in own)
        inside = mean(hit for *_, hit in own)
        lines.append(f"| {name} | {len(own)} | {median(ratio for _, ratio, _ in own):.3f} | {100 * far:.0f} % | {100 * inside:.0f} % |")
    lines += ["", "| error | estimates | true one inside value +- 1.96 std | found on flights without it |", "|---|---|---|---|"]
    z = [(f"{name} {channel}", value, r, (name, channel)) for r in results for name, channel, value in r["z"]]
    for name in sorted({entry[0] for entry in z}):
        own = [entry for entry in z if entry[0] == name]
        hits = mean(abs(value) < 1.96 for _, value, *_ in own)
        absent = [r for *_, r, key in own if KINDS.get(r["kind"], ({}, "", "", 0))[1:3] != key]
        false = sum(any((f[0], f[1]) == own[0][3] for f in r["found"]) for r in absent)
        lines.append(f"| {name} | {len(own)} | {100 * hits:.0f} % | {false} of {len(absent)} |")
    lines += ["", "| flights | found, alone | found, with others | missed |", "|---|---|---|---|"]
    for kind in ("clean", *KINDS):
        own, wanted = [r for r in results if r["kind"] == kind], KINDS.get(kind, ({}, "", "", 0.0))[1:3]
        found = [[tuple(f[:2]) for f in r["found"]] for r in own]
        right = [f == ([wanted] if kind != "clean" else []) for f in found]
        more = [not r and (wanted in f if kind != "clean" else bool(f)) for f, r in zip(found, right, strict=True)]
        lines.append(f"| {kind} | {sum(right)} of {len(own)} | {sum(more)} | {len(own) - sum(right) - sum(more)} |")
    return "\n".join([*lines, *ap2, ""])


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=40, help="clean ones; a sixth of that of every error")
    parser.add_argument("--family", type=int, default=0, help="of seeds; 0 is for development")
    parser.add_argument("--ap2", type=Path, help="folder with the .mat of the measured flight")
    add_options(parser)
    options = parser.parse_args(arguments)
    of = {"clean": options.flights, **dict.fromkeys(KINDS, -(-options.flights // 6))}
    seeds = {kind: [100_000 * options.family + 1000 * i + k for k in range(count)] for i, (kind, count) in enumerate(of.items())}
    cases = {f"{kind.replace(' ', '_')}-{seed}": (kind, seed) for kind, own in seeds.items() for seed in own}
    failed = run_campaign(run_flight, cases, RESULTS, options.jobs, options.scheduler)
    text = table(list(kept(RESULTS, cases).values()), measured_record(options.ap2) if options.ap2 else [])
    write_text(RESULTS.parent / "flight_path.md", text)
    print(text)
    return 3 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
