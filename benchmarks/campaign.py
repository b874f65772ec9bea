"""Many cases, one result file each: resumable, on this machine or on a Dask cluster, with the same results as one case after the other.

A campaign is a function `work(name, case) -> dict` of plain data that holds all it needs (seeds included), so a result does not depend on
where, when or beside what it was made. Files appear whole, as each case ends: an interrupted campaign goes on where it stopped, and the
cases of a worker that dies are given to another. Dask (extra `campaign`) because schedulers, worker restarts and lost connections are
its trade; it pickles only between our own processes, nothing that is kept.

    python benchmarks/SOME_CAMPAIGN.py                        on this machine, --jobs workers
    python benchmarks/SOME_CAMPAIGN.py --scheduler ADDRESS    on a cluster whose workers have this repository installed at the same path
    python benchmarks/SOME_CAMPAIGN.py --jobs 0               one after the other, in this process, without Dask
"""

import argparse
import json
import os
import subprocess
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from awescli.artifacts import write_text

DEATHS = 3
"""Workers that one case may take with it before it is called failed: a killed worker is bad luck, three are the case itself."""

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
    for count, (name, outcome) in enumerate(_outcomes(work, todo, jobs, scheduler), 1):
        if isinstance(outcome, Exception):
            failed[name] = f"{type(outcome).__name__}: {outcome}".splitlines()[0]
            line = f"FAILED {name}: {failed[name]}"
        else:
            write_text(result_file(folder, name), json.dumps(outcome, default=float))
            line = say(name, outcome)
        print(f"[{count}/{len(todo)}] {line}", flush=True)
    return failed


def _outcomes(work: Work, todo: Mapping[str, Any], jobs: int, scheduler: str | None) -> Iterator[tuple[str, dict | Exception]]:
    """(name, result or what it raised), as they come."""
    if not todo:
        return
    if jobs < 1 and scheduler is None:
        for name, case in todo.items():
            try:
                yield name, work(name, case)
            except Exception as e:
                yield name, e
        return
    from distributed import as_completed

    with _client(min(jobs, len(todo)), scheduler) as client:
        # pure=False: a case of this run is never answered by what another client of the same scheduler left behind
        futures = {client.submit(work, name, case, pure=False, retries=0): name for name, case in todo.items()}
        for future in as_completed(futures):
            error = future.exception()
            yield futures[future], future.result() if error is None else error
            future.release()


@contextmanager
def _client(jobs: int, scheduler: str | None) -> Iterator[Any]:
    """A connection to the cluster: the one at the address, or one of our own with `jobs` processes."""
    import dask
    from distributed import Client, LocalCluster

    if scheduler is not None:
        with Client(scheduler) as client:
            yield client
        return
    settings = {
        "distributed.scheduler.allowed-failures": DEATHS,
        # one case per core: threads inside a case would only wait for each other. A user's own choice stands.
        "distributed.nanny.pre-spawn-environ.OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "1"),
    }
    with (
        dask.config.set(settings),
        LocalCluster(n_workers=jobs, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster,
        Client(cluster) as client,
    ):
        yield client
