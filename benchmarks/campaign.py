"""Many cases, one result file each: resumable, on this machine or on a Dask cluster, with the same results as one case after the other.

A campaign is a function `work(name, case) -> dict` of plain data that holds all it needs (seeds included), so a result does not depend on
where, when or beside what it was made. Files appear whole, as each case ends: an interrupted campaign goes on where it stopped, and the
cases of a worker that dies are given to another (Dask, extra `campaign`; awescli/stages/workers.py).

    python benchmarks/SOME_CAMPAIGN.py                        on this machine, --jobs workers
    python benchmarks/SOME_CAMPAIGN.py --scheduler ADDRESS    on a cluster whose workers have this repository installed at the same path
    python benchmarks/SOME_CAMPAIGN.py --jobs 0               one after the other, in this process, without Dask
"""

import argparse
import json
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from awescli.artifacts import write_text
from awescli.stages.workers import connected, outcomes

Work = Callable[[str, Any], dict]


def add_options(parser: argparse.ArgumentParser) -> None:
    """--jobs and --scheduler, alike in all campaigns."""
    parser.add_argument("--jobs", type=int, default=2, help="local workers; 0: one case after the other in this process")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="a running Dask scheduler (tcp://HOST:PORT) instead of local workers")


def commit() -> str:
    """The code that makes the results: its git commit, "+" where the working tree differs from it, "unknown" outside of a repository."""
    here = Path(__file__).parent
    try:
        asked = [["git", "rev-parse", "--short", "HEAD"], ["git", "status", "--porcelain", "--untracked-files=no"]]
        head, changed = (subprocess.run(words, cwd=here, capture_output=True, text=True, check=True).stdout.strip() for words in asked)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{head}+" if changed else head


def result_file(folder: Path, name: str) -> Path:
    """Where the result of a case is kept."""
    return folder / f"{name.replace(':', '_').replace('/', '_')}.json"


def kept(folder: Path, cases: Mapping[str, Any]) -> dict[str, dict]:
    """Results that are there, in the order of the cases."""
    return {name: json.loads(file.read_text()) for name in cases if (file := result_file(folder, name)).is_file()}


def run_campaign(
    work: Work,
    cases: Mapping[str, Any],
    folder: Path,
    jobs: int = 2,
    scheduler: str | None = None,
    say: Callable[[str, dict], str] = lambda name, result: name,
) -> dict[str, str]:
    """Run the cases that have no result yet and keep each result as its case ends; gives back what failed: name -> why.

    say(name, result): the line printed for a result. A case that raises fails alone; it gets no file, so the next run tries it again.
    """
    todo = {name: case for name, case in cases.items() if not result_file(folder, name).is_file()}
    print(f"{len(cases)} cases, {len(cases) - len(todo)} done before", flush=True)
    failed: dict[str, str] = {}
    if not todo:
        return failed
    with connected(min(jobs, len(todo)), scheduler) as client:
        for count, (name, outcome) in enumerate(outcomes(client, work, todo), 1):
            if isinstance(outcome, Exception):
                failed[name] = f"{type(outcome).__name__}: {outcome}".splitlines()[0]
                line = f"FAILED {name}: {failed[name]}"
            else:
                write_text(result_file(folder, name), json.dumps(outcome, default=float))
                line = say(name, outcome)
            print(f"[{count}/{len(todo)}] {line}", flush=True)
    return failed
