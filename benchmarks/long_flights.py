"""What do `identify` and `trace-residual` need of a flight that is long?

    python benchmarks/long_flights.py [--minutes 2.5 10 30 90] [--seed 301]

The development kite on its circle, a loop in some 9 s, as `controller_size.py` flies it, with drag of sideslip that its user does not
declare and guesses 5 to 30 % off. Each command is typed as a user would, in a process of its own, on the log as a file: wall time,
processor time, largest resident memory. Linear in length is what the last column but one should say: processor time per minute of flight.
Results go to benchmarks/results/long_flights.md.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import awescli  # noqa: F401  (thread settings before numpy)
from awescli.artifacts import read_json, write_text

HERE = Path(__file__).parent
TABLE = HERE / "results" / "long_flights.md"
MISSING = "sideslip_drag"
COMMANDS = ("identify", "trace-residual")
PLAN = """flight: flight
kite: kite.yaml
out: out
stages:
  identify: {surfaces: recorded}
  trace-residual: {}
"""


def write_flight(folder: Path, minutes: float, seed: int) -> None:
    """Flight, kite file and plan of a user."""
    from controller_size import long_flight

    from awescli.flightlog.kitemill_csv import to_kitemill_csv
    from awescli.physics.declaration import kite_text

    flight = long_flight(minutes, seed, {MISSING: {"k": 1.25}})
    kite, wind = to_kitemill_csv(flight.log)
    files = {"flight/kite.csv": kite, "flight/wind.csv": wind, "kite.yaml": kite_text(flight.declared), "stages.yaml": PLAN}
    for name, text in files.items():
        write_text(folder / name, text)


def needed(folder: Path, command: str) -> dict:
    """What a command needs: seconds, of processor, peak memory [GB]. Ends the run where it fails."""
    begin = time.perf_counter()
    said = folder / f"{command}.txt"
    with said.open("w") as out:
        process = subprocess.Popen(
            [sys.executable, "-m", "awescli", command, "--stages", str(folder / "stages.yaml")], stdout=out, stderr=subprocess.STDOUT
        )
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = code = os.waitstatus_to_exitcode(status)
    if code:
        raise SystemExit(f"awes {command} ends with exit code {code}:\n{said.read_text()[-2000:]}")
    return {"wall": time.perf_counter() - begin, "processor": used.ru_utime + used.ru_stime, "memory": used.ru_maxrss / 1e6}


def row(minutes: float, seed: int) -> str:
    """A line of the table. The flight is made in a process of its own: this one stays small, for its memory is its children's least."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([sys.executable, __file__, "--fly", name, "--minutes", str(minutes), "--seed", str(seed)], check=True)
        found = {command: needed(folder, command) for command in COMMANDS}
        effects = read_json(folder / "out" / "trace-residual" / "effects.json")
    names = ", ".join(e["name"] for e in effects["effects"]) or "nothing"
    wall, processor = (sum(f[what] for f in found.values()) for what in ("wall", "processor"))
    memory = max(f["memory"] for f in found.values())
    cells = [f"{minutes:g}", *(f"{found[c]['wall']:.0f} s" for c in COMMANDS), f"{wall:.0f} s", f"{processor:.0f} s"]
    cells += [f"{memory:.2f} GB", f"{processor / minutes:.1f} s", f"{effects['verdict']}: {names}"]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, nargs="+", default=[2.5, 10.0, 30.0, 90.0])
    parser.add_argument("--seed", type=int, default=301)
    parser.add_argument("--fly", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.fly:
        write_flight(arguments.fly, arguments.minutes[0], arguments.seed)
        return
    from campaign import commit

    said = " ".join(f"{m:g}" for m in arguments.minutes)
    head = [
        "# Long flights", "", f"`python benchmarks/long_flights.py --minutes {said}`, commit {commit()}, {os.cpu_count()} cores.",
        f"The flight lacks {MISSING}.", "",
        "| minutes | identify | trace-residual | together | of processor | memory | processor per minute of flight | verdict |",
        "|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    rows: list[str] = []
    for minutes in arguments.minutes:
        rows.append(row(minutes, arguments.seed))
        print(rows[-1], flush=True)
        write_text(TABLE, "\n".join([*head, *rows, ""]))


if __name__ == "__main__":
    main()
