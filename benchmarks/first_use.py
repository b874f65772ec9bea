"""What does it cost that awes compiles a kite where it is first met? python benchmarks/first_use.py [--beside CLONE ...]

`awes identify` and `awes trace-residual` on the bundled flight, with nothing kept of earlier runs (an empty $AWES_CACHE), and again with
what the first run kept; of this checkout, and then of clones of others. Results go to benchmarks/results/first_use.md.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from campaign import commit

from awescli.artifacts import write_text

HERE = Path(__file__).parent
TABLE = HERE / "results" / "first_use.md"
STAGES = ("identify", "trace-residual")


def timed(clone: Path, kept: Path, out: Path) -> list[float]:
    """Seconds of each stage by the awes of a clone."""
    found = []
    for stage in STAGES:
        begin = time.perf_counter()
        command = [sys.executable, "-m", "awescli", stage, "--stages", str(clone / "stages.yaml"), "--set", f"out={out}", "--quiet"]
        environment = os.environ | {"PYTHONPATH": str(clone), "AWES_CACHE": str(kept)}
        subprocess.run(command, check=True, cwd=clone, env=environment, stdout=subprocess.DEVNULL)
        found.append(time.perf_counter() - begin)
    return found


def commit_of(clone: Path) -> str:
    """Of another checkout."""
    return subprocess.run(["git", "rev-parse", "--short", "HEAD"], check=True, cwd=clone, capture_output=True, text=True).stdout.strip()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--beside", type=Path, nargs="*", default=[], help="clones of other commits")
    clones = {commit(): HERE.parent, **{commit_of(clone): clone.absolute() for clone in parser.parse_args().beside}}
    lines = ["| commit | " + " | ".join(f"{stage}, first | again" for stage in STAGES) + " |", "|---|" + "---|" * 2 * len(STAGES)]
    for name, clone in clones.items():
        with tempfile.TemporaryDirectory() as folder:
            kept = Path(folder) / "kept"
            kept.mkdir()
            first, again = (timed(clone, kept, Path(folder) / run) for run in ("first", "again"))
        seconds = [f"{s:.1f} s" for pair in zip(first, again, strict=True) for s in pair]
        lines.append(f"| {name} | {' | '.join(seconds)} |")
    says = "`python benchmarks/first_use.py --beside CLONE`: the bundled flight, with nothing kept of earlier runs, and again. Wall time."
    write_text(TABLE, "\n".join(["# What compiling costs", "", says, "", *lines, ""]))
    print(TABLE.read_text())


if __name__ == "__main__":
    main()
