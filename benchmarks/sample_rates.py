"""Does a log tell the same at every rate? python benchmarks/sample_rates.py [FLIGHT=KITE.yaml ...] [--jobs N] [--rates 100 50 25 20 10]

The bundled flight, and further Kitemill logs with their kite files, are written at other rates: measured channels between rows by
interpolation, set-points as the controller held them. Each is identified and traced by `awes`, as a user would from the command line;
verdict, sizes with their 95 % intervals and identify's errors on unseen loops stand side by side in results/sample_rates.md.
"""

import argparse
import csv
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from campaign import add_options, commit, kept, run_campaign

from awescli.artifacts import write_text

HERE = Path(__file__).parent
ROOT = HERE.parent
RESULTS = HERE / "results" / "sample_rates"
ANGLES = ("phi", "theta", "psi")
PLAN = "stages:\n  fit-controller: {}\n  identify: {}\n  trace-residual: {}\n"


def resampled(source: Path, target: Path, rate: float) -> None:
    """Write the Kitemill log of `source` at `rate` [Hz] into the new folder `target`, its weather beside it."""
    with open(source / "kite.csv", newline="") as file:
        head, *rows = csv.reader(file)
    table = np.array([[float(x) if x else np.nan for x in row] for row in rows])
    seconds = (table[:, head.index("epoch_ms")] - table[0, head.index("epoch_ms")]) / 1e3
    wanted = np.arange(int(seconds[-1] * rate + 1e-9) + 1) / rate
    before = np.searchsorted(seconds, wanted + 1e-6, side="right") - 1
    columns = []
    for name, y in zip(head, table.T, strict=True):
        if name in ANGLES:
            columns.append((np.degrees(np.interp(wanted, seconds, np.unwrap(np.radians(y)))) + 180) % 360 - 180)
        else:
            columns.append(y[before] if name.endswith("_sp") else np.interp(wanted, seconds, y))
    target.mkdir(parents=True)
    with open(target / "kite.csv", "w", newline="") as file:
        out = csv.writer(file)
        out.writerow(head)
        out.writerows([repr(round(float(v), 9)) for v in row] for row in np.column_stack(columns))
    for weather in source.glob("wind*.csv"):
        shutil.copy(weather, target / weather.name)


def work(name: str, case: dict[str, Any]) -> dict[str, Any]:
    """A flight at a rate, from its log to its verdict."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        resampled(Path(case["flight"]), home / "flight", case["rate"])
        shutil.copy(case["kite"], home / "kite.yaml")
        (home / "stages.yaml").write_text(f"flight: flight\nkite: kite.yaml\n{PLAN}")
        ran = subprocess.run([sys.executable, "-m", "awescli", "run"], cwd=home, capture_output=True, text=True, check=False)
        if ran.returncode not in (0, 3):
            return {**case, "verdict": "failed", "why": ran.stderr[-400:]}
        identify = json.loads((home / "out" / "identify" / "metrics.json").read_text())
        effects = json.loads((home / "out" / "trace-residual" / "effects.json").read_text())
    sizes = {
        f"{e['name']} {n}": [v["value"], v["std"]] for e in effects["effects"] for n, v in e["parameters"].items()
    }  # fmt: skip
    error = effects["error"]
    return {
        **case, "commit": commit(), "verdict": effects["verdict"], "names": [e["name"] for e in effects["effects"]], "sizes": sizes,
        "identified": identify["nrmse"]["test"]["mean"], "noise": identify["noise_floor"]["mean"],
        "before": error["before"]["mean"], "after": error["after"]["mean"],
    }  # fmt: skip


def cases(flights: dict[str, tuple[Path, Path]], rates: list[float]) -> dict[str, dict]:
    """name -> what `work` needs."""
    return {
        f"{name}-{rate:g}": {"name": name, "flight": str(folder), "kite": str(kite), "rate": rate}
        for name, (folder, kite) in flights.items() for rate in rates
    }  # fmt: skip


def report(results: dict[str, dict]) -> str:
    """The table, as Markdown."""
    lines = [
        "# One log at other rates", "", f"Commit {', '.join(sorted({r['commit'] for r in results.values() if 'commit' in r}))}.",
        "Errors: mean NRMSE on unseen loops, 5 s ahead; identified over that at 50 Hz.", "",
        "| flight | rate [Hz] | verdict | size +- std | identified | over 50 Hz | traced | noise alone |",
        "|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    at_50 = {r["name"]: r for r in results.values() if r["rate"] == 50 and r["verdict"] != "failed"}
    for r in results.values():
        if r["verdict"] == "failed":
            lines.append(f"| {r['name']} | {r['rate']:g} | failed: {r['why'][:120]} | | | | | |")
            continue
        sizes = "; ".join(f"{n} {v:.4g} +- {s:.2g}" for n, (v, s) in r["sizes"].items())
        there = at_50.get(r["name"])
        ratio = f"{r['identified'] / there['identified']:.2f}" if there else ""
        said = f"{r['verdict']} {', '.join(r['names'])}"
        lines.append(
            f"| {r['name']} | {r['rate']:g} | {said} | {sizes} | {r['identified']:.4f} | {ratio} | {r['after']:.4f} | {r['noise']:.4f} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("flights", nargs="*", metavar="FLIGHT=KITE", help="folder of a Kitemill log, and its kite file")
    parser.add_argument("--rates", nargs="+", type=float, default=[100, 50, 25, 20, 10], help="[Hz]")
    add_options(parser)
    asked = parser.parse_args()
    flights = {"km1_demo": (ROOT / "data" / "km1_demo", ROOT / "data" / "kites" / "km1_initial.yaml")}
    for text in asked.flights:
        folder, _, kite = text.partition("=")
        flights[Path(folder).name] = (Path(folder).resolve(), Path(kite).resolve())
    every = cases(flights, asked.rates)
    failed = run_campaign(work, every, RESULTS, asked.jobs, asked.scheduler, lambda n, r: f"{n}: {r['verdict']} {r.get('names', '')}")
    write_text(RESULTS.with_suffix(".md"), report(kept(RESULTS, every)))
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
