"""Does the thesis' recipe end, on any flight? python benchmarks/thesis_plan.py FLIGHT=KITE.yaml ... [--long] [--only NAME]

examples/thesis/stages.yaml (Rositani 2025: the law by linear programmes, 18 s from measured states with the loop closed, a network of
8-8) is run by `awes run` in a process of its own on the bundled flight, on every FLIGHT folder with its kite file and, with --long, on a
flight of 36 minutes (120 x 18 s) that data/make_km1_demo.py makes. Asked: it ends everywhere, and every stage has converged or says by
name why not; 36 minutes in at most 15 minutes and 6 GB on two cores. The fits were developed on the development flights.

One result a flight in results/thesis/, so a run can be interrupted and resumed; the table goes to results/thesis_plan.md.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from campaign import commit, kept, result_file

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.artifacts import write_text

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "benchmarks" / "results"
PLAN = ROOT / "examples" / "thesis" / "stages.yaml"
LONG, LONG_SECONDS = "36 min", 2160
MODELS = ("initial", "identified", "hybrid", "linear")
STAGES = ("fit-controller", "identify", "train-hybrid", "evaluate")


def run(name: str, flight: Path, kite: Path | None, folder: Path) -> dict[str, Any]:
    """`awes run` of the plan on one flight: what its stages say, its errors, time [s] and largest memory [GB]."""
    out = folder / "out"
    command = [sys.executable, "-m", "awescli", "run", "--stages", str(PLAN), "--set", f"flight={flight}", "--set", f"out={out}"]
    command += ["--set", f"kite={kite}"] if kite else []
    begin, text = time.perf_counter(), folder / "text"
    with text.open("w") as stream:
        running = subprocess.Popen(command, stdout=stream, stderr=subprocess.STDOUT, cwd=ROOT)
        _, status, used = os.wait4(running.pid, 0)
        running.returncode = os.waitstatus_to_exitcode(status)
    said = {
        "flight": name, "commit": commit(), "exit": running.returncode, "wall_s": time.perf_counter() - begin,
        "processor_s": used.ru_utime + used.ru_stime, "memory_gb": used.ru_maxrss / 1e6,
    }  # fmt: skip
    stages = {s: json.loads(file.read_text()) for s in STAGES if (file := out / s / "metrics.json").is_file()}
    last = [line for line in text.read_text().splitlines() if line.strip()][-1:] if running.returncode else []
    return said | {"error": " ".join(last), "outcomes": {s: m["outcome"] for s, m in stages.items() if "outcome" in m}} | scores(stages)


def scores(stages: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Of the test part: mean NRMSE of every model over the states, the law's error on each surface that it moves, seconds ahead."""
    if "evaluate" not in stages:
        return {}
    m, law = stages["evaluate"], stages["fit-controller"]["nrmse"]["test"]
    errors = {name: m[name]["nrmse"]["test"]["mean"] for name in MODELS if m.get(name, {}).get("nrmse")}
    return {"horizon_s": m["horizon_s"], "errors": errors, "noise": m["noise_floor"]["mean"], "law": law}


def table(results: list[dict[str, Any]]) -> str:
    """Every flight, a row each."""
    columns = ("flight", "ends", "law", "identify", "network", "ahead", "rudder", *MODELS, "noise alone", "time [s]", "processor [s]", "GB")
    commits = ", ".join(sorted({r["commit"] for r in results}))
    lines = [
        "# The thesis' recipe on other flights", "",
        f"`python benchmarks/thesis_plan.py FLIGHT=KITE.yaml ... --long`, commit {commits}; {os.cpu_count()} cores, beside other work.", "",
        "Mean NRMSE of the states on the test part, loop closed, from measured states; `rudder`: NRMSE of the law there.", "",
        "| " + " | ".join(columns) + " |", "|" + " --- |" * len(columns),
    ]  # fmt: skip
    for r in results:
        o, e = r["outcomes"], r.get("errors", {})
        cells = [r["flight"], "yes" if r["exit"] == 0 else f"no: {r['error']}", *(o.get(s, "-") for s in STAGES[:3])]
        cells += [f"{r['horizon_s']:g} s" if e else "-", f"{min(r['law'].values()):.4f}" if e else "-"]
        cells += [f"{e[m]:.4f}" if m in e else "-" for m in MODELS] + [f"{r['noise']:.4f}" if e else "-"]
        lines.append("| " + " | ".join([*cells, f"{r['wall_s']:.0f}", f"{r['processor_s']:.0f}", f"{r['memory_gb']:.2f}"]) + " |")
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("flights", nargs="*", metavar="FLIGHT=KITE.yaml", help="folder of a flight, and its kite file")
    parser.add_argument("--long", action="store_true", help=f"also a flight of {LONG_SECONDS // 60} minutes")
    parser.add_argument("--only", help="just the flight of this name")
    args = parser.parse_args()
    flights: dict[str, tuple[Path, Path] | None] = {"bundled": None}
    for flight, _, kite in (text.partition("=") for text in args.flights):
        flights[Path(flight).name] = (Path(flight).resolve(), Path(kite).resolve())
    if args.long:
        flights[LONG] = None
    folder = RESULTS / "thesis"
    for name, where in flights.items():
        if args.only in (None, name) and not result_file(folder, name).is_file():
            with tempfile.TemporaryDirectory() as scratch:
                flight, kite = where or (made(Path(scratch)) if name == LONG else ROOT / "data" / "km1_demo", None)
                result = run(name, flight, kite, Path(scratch))
            write_text(result_file(folder, name), json.dumps(result))
            print(table([result]).splitlines()[-1], flush=True)
    write_text(RESULTS / "thesis_plan.md", table(list(kept(folder, {LONG: None, **flights}).values())))
    return 0


def made(scratch: Path) -> Path:
    """The long flight."""
    subprocess.run([sys.executable, str(ROOT / "data" / "make_km1_demo.py"), str(scratch / "long"), str(LONG_SECONDS)], check=True)
    return scratch / "long"


if __name__ == "__main__":
    sys.exit(main())
