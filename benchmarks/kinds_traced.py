"""Effects claimed of what is a mistake: python benchmarks/kinds_traced.py CLEAN_FLIGHT [--only WORDS]

Mistakes in a log (kinds_logs.py) or in a kite file that no check stops, on a flight of which nothing is missing: `awes identify` and `awes
trace-residual` run on it as any user would run them. A name is false unless it is the mistake itself (position half a second late is a
position latency); `none`, `unexplained`, `not_deterministic`, `not_testable` and refusals name nothing. Results are kept case by case in
results/kinds_traced/, so an interrupted run goes on; writes results/kinds_traced.md.

CLEAN_FLIGHT: a folder in Kitemill's format with a nominal.yaml (a development flight without undeclared effects).
"""

import argparse
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import yaml
from exact_scoring import answer_of
from kinds_logs import KINDS_OF, Log, kite_of

import awescli  # noqa: F401  (thread settings before numpy's work)
from awescli.artifacts import read_json, write_json, write_text
from awescli.notation.errors import AwesError

HERE = Path(__file__).parent
RESULTS = HERE / "results" / "kinds_traced"
PLAN = HERE.parent / "examples" / "dev_kite" / "stages.yaml"
Kite = dict[str, Any]

WIND = ("wind_offset", "wind_shear", "wind_veer")
LOGS: dict[str, tuple[str, ...]] = {
    "weather 40 min late": WIND,
    "wind direction counter-clockwise": WIND,
    "wind speed in kt": WIND,
    "load in lbf": ("load_cell_scale",),
    "load in daN": ("load_cell_scale",),
    "rudder x 4": ("surface_effectiveness",),
    "half of the rows lost": (),
    "a third lost in the middle": (),
    "every other row": (),
    "pasted twice with one clock": (),
    "clock 1 % long": (),
    "clock 3 % short": (),
    "p and q exchanged": (),
    "airspeed constant": ("airspeed_scale",),
    "reel-out speed of the other sign": (),
    "winch 5 s late": ("clock_offset",),
    "position 0.5 s late": ("position_latency",),
}
"""Kinds of kinds_logs.py that are only warned of on some flight, or not told -> effects that are the mistake itself."""


def _times(factor: float, *names: str) -> Callable[[Kite], None]:
    """Value and bounds, as a slip of a unit or of a table makes them."""

    def change(kite: Kite) -> None:
        for name in names:
            row = kite["parameters"][name]
            row |= {key: float(row[key]) * factor for key in ("value", "lower", "upper") if key in row}
            if factor < 0 and "lower" in row:
                row["lower"], row["upper"] = row["upper"], row["lower"]

    return change


def _shear(kite: Kite) -> None:
    kite["wind"]["exponent"] = 0.3


KITES: dict[str, tuple[Callable[[Kite], None], tuple[str, ...]]] = {
    "mass of another kite (x 1.3)": (_times(1.3, "m"), ("mass_offset",)),
    "mass in lb": (_times(2.2046, "m"), ("mass_offset",)),
    "inertias x 10": (_times(10.0, "Jx", "Jy", "Jz", "Jxz"), ()),
    "inertias in slug ft2": (_times(0.7376, "Jx", "Jy", "Jz", "Jxz"), ()),
    "line of the double diameter": (_times(2.0, "d_t"), ("tether_drag", "tether_weight")),
    "roll damping of the other sign": (_times(-1.0, "Clp"), ()),
    "pitch stability of the other sign": (_times(-1.0, "Cma"), ()),
    "side force of the other sign": (_times(-1.0, "CYb"), ()),
    "roll due to yaw rate of the other sign": (_times(-1.0, "Clr"), ()),
    "rudder's side force of the other sign": (_times(-1.0, "CYdr"), ()),
    "shear exponent 0.3": (_shear, ("wind_shear",)),
}  # fmt: skip
"""Mistakes of a kite file that no check refuses -> effects that are the mistake itself."""


def laid_out(kind: str, flight: Path, folder: Path) -> dict[str, str]:
    """A flight folder and a kite file with the mistake; the settings that point to them."""
    (folder / "flight").mkdir(parents=True)
    kite = kite_of(flight, folder, None)
    log = Log(pl.read_csv(flight / "kite.csv"), pl.read_csv(flight / "wind.csv"))
    if kind in LOGS:
        KINDS_OF[kind][0](log, np.random.default_rng(1))
    else:
        data = yaml.safe_load(kite.read_text())
        KITES[kind][0](data)
        write_text(kite, yaml.safe_dump(data, sort_keys=False))
    log.kite.write_csv(folder / "flight" / "kite.csv")
    log.wind.write_csv(folder / "flight" / "wind.csv")
    return {"flight": str(folder / "flight"), "kite": str(kite), "out": str(folder / "out")}


def traced(kind: str, flight: Path, folder: Path) -> dict[str, Any]:
    """What came of one mistake."""
    from awescli.stages import STAGES
    from awescli.stages.plan import read_plan
    from awescli.stages.runner import run_plan

    began = time.monotonic()
    plan = read_plan(PLAN, STAGES, laid_out(kind, flight, folder))
    result: dict[str, Any] = {"kind": kind, "flight": flight.name, "names": []}
    try:
        run_plan(plan, STAGES, only=["identify", "trace-residual"])
        effects = read_json(plan.out / "trace-residual" / "effects.json")
        answer = answer_of(effects)
        result |= {"verdict": answer.verdict, "reason": effects.get("reason") or "",
                   "names": [[":".join(part for part in name if part) for name in entry] for entry in answer.named]}  # fmt: skip
    except AwesError as e:
        said = re.sub(r"/\S*/", "", " ".join(str(e).split()))
        result |= {"verdict": "refused", "reason": said}
    return result | {"seconds": time.monotonic() - began}


def right(kind: str) -> tuple[str, ...]:
    return LOGS[kind] if kind in LOGS else KITES[kind][1]


def false_names(result: dict[str, Any]) -> list[str]:
    """First names that are not the mistake itself; a class of rivals is right if it holds it."""
    allowed = right(result["kind"])
    return [entry[0] for entry in result["names"] if not any(name.partition(":")[0] in allowed for name in entry)]


def table(results: list[dict[str, Any]], command: str) -> str:
    bad = [r for r in results if false_names(r)]
    lines = [
        "# Effects claimed of mistakes", "", f"`{command}`, {sum(r['seconds'] for r in results):.0f} s.", "",
        f"{len(results)} of {len(LOGS) + len(KITES)} mistakes, {len(bad)} with a false effect; "
        f"{sum(r['verdict'] == 'refused' for r in results)} refused, "
        f"{sum(bool(r['names']) and r not in bad for r in results)} named for what they are.", "",
        "| mistake | flight | verdict | named | false | why |", "|---|---|---|---|---|---|",
    ]  # fmt: skip
    for r in results:
        named = ", ".join(" or ".join(entry) for entry in r["names"]) or "-"
        cells = (r["kind"], r["flight"], r["verdict"], named, ", ".join(false_names(r)) or "-", r["reason"][:140].replace("|", "/"))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join([*lines, ""])


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("flight", type=Path)
    parser.add_argument("--only", default="", help="kinds that hold these words")
    options = parser.parse_args(arguments)
    results = []
    for kind in (*LOGS, *KITES):
        file = RESULTS / f"{options.flight.name}-{re.sub(r'[^a-z0-9]+', '_', kind.lower())}.json"
        if not file.is_file() and options.only in kind:
            folder = Path(tempfile.mkdtemp(prefix="kinds-"))
            try:
                write_json(file, traced(kind, options.flight, folder))
            finally:
                shutil.rmtree(folder)
            r = read_json(file, any_form=True)
            print(f"{kind}: {r['verdict']} {r['names']} {r['reason'][:200]} ({r['seconds']:.0f} s)", flush=True)
        if file.is_file():
            results.append(read_json(file, any_form=True))
    text = table(results, f"python benchmarks/kinds_traced.py FLIGHTS/{options.flight.name}")
    write_text(HERE / "results" / "kinds_traced.md", text)
    print(text)
    return 1 if any(map(false_names, results)) else 0


if __name__ == "__main__":
    sys.exit(main())
