"""Same inputs and seed, two processes: byte-identical artifacts, whatever the folder, the time of day and the number of threads."""

import os
import subprocess
import sys

import pytest
from small_run import make_small_run

COMMAND = [sys.executable, "-c", "from awescli.cli import main; main()", "run", "--quiet"]
TIMES = ("provenance.json", "report.html", ".lock")
"""Files that hold times: provenance, and the page that shows it."""


def files(out):
    return {p.relative_to(out).as_posix(): p.read_bytes() for p in sorted(out.rglob("*")) if p.is_file() and p.name not in TIMES}


@pytest.mark.slow
def test_two_runs_leave_the_same_bytes(tmp_path):
    make_small_run(tmp_path / "here")
    make_small_run(tmp_path / "elsewhere")
    threads = {"here": "1", "elsewhere": "2"}
    runs = [
        subprocess.run(COMMAND, cwd=tmp_path / name, env=os.environ | {"OMP_NUM_THREADS": n, "PYTHONHASHSEED": n}, capture_output=True)
        for name, n in threads.items()
    ]
    assert [run.returncode for run in runs] == [0, 0], runs
    here, elsewhere = files(tmp_path / "here" / "out"), files(tmp_path / "elsewhere" / "out")
    assert len(here) > 15 and here.keys() == elsewhere.keys()
    assert [name for name in here if here[name] != elsewhere[name]] == []
