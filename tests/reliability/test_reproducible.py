"""Same inputs and seed, several processes: byte-identical artifacts, whatever the folder, the day and the number of threads."""

import json
import os
import subprocess
import sys

import pytest
from small_run import make_small_run

from awescli.artifacts import read_json

TIMES = ("provenance.json", "report.html", "lock", "awes.log")
"""Files that hold times: provenance, the page that shows it, and the log."""


def files(out):
    return {p.relative_to(out).as_posix(): p.read_bytes() for p in sorted(out.rglob("*")) if p.is_file() and p.name not in TIMES}


def awes(folder, threads: int, *arguments: str, first: str = ""):
    """The command line in a folder, with so many threads for everything. first: what the process does before awes is imported."""
    names = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "OMP_NUM_THREADS", "PYTHONHASHSEED")
    own = {name: str(threads) for name in names} | {"TZ": f"UTC{threads}", "LC_ALL": ("C", "C.UTF-8")[threads % 2]}
    command = [sys.executable, "-c", f"{first}\nfrom awescli.cli import main; main()", *arguments]
    return subprocess.run(command, cwd=folder, env=os.environ | own, capture_output=True, text=True)


LATER = """
import datetime, time, numpy, scipy.linalg
now = time.time
time.time = lambda: now() + 4e8
class Later(datetime.datetime):
    @classmethod
    def now(cls, tz=None):
        return cls.fromtimestamp(time.time(), tz)
datetime.datetime = Later
"""
"""The clock stands 12 years ahead, and numpy is there before awes."""


@pytest.mark.slow
def test_two_runs_leave_the_same_bytes(small_run, tmp_path):
    """With two BLAS threads everything from trace-residual on used to differ: the order of a sum depends on how it is dealt out. One run
    is that of the tests' own process."""
    make_small_run(tmp_path)
    for file in tmp_path.rglob("*.*"):  # inputs of 2002
        os.utime(file, (1.04e9,) * 2)
    done = awes(tmp_path, 2, "run", "--quiet", first=LATER)
    assert done.returncode == 0, done
    makes = (small_run / "out", tmp_path / "out")
    here, late = map(files, makes)
    assert len(here) > 15 and here.keys() == late.keys()
    assert [name for name in here if here[name] != late[name]] == []
    for out in makes:
        told = read_json(out / "trace-residual" / "provenance.json")["machine"]["blas"]
        assert told and all(library["threads"] == 1 and library["library"] for library in told)
    began = [read_json(out / "identify" / "provenance.json")["timing"]["started"] for out in makes]
    assert int(began[1][:4]) - int(began[0][:4]) in (12, 13)
    # and every JSON artifact is of the form that its readers ask for
    for file in makes[0].glob("*/*.json"):
        assert isinstance(read_json(file), dict)
        assert json.loads(file.read_text())["version"] == 2


@pytest.mark.parametrize("first", ["", "import numpy, scipy.linalg"])
def test_a_stage_computes_with_one_thread_and_gives_them_back(tmp_path, first):
    """What the user chose stands again afterwards: awes may be a guest in the process."""
    program = f"""
{first}
import awescli, numpy, scipy.linalg
from threadpoolctl import threadpool_info
from awescli.stages.blas import blas, one_blas_thread
threads = lambda: [i["num_threads"] for i in threadpool_info() if i["user_api"] == "blas"]
before = threads()
with one_blas_thread():
    inside, told = threads(), [b["threads"] for b in blas()]
print(before == threads() and set(before) == {{2}} and set(inside) == {{1}} == set(told))
"""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "2", "MKL_NUM_THREADS": "2", "BLIS_NUM_THREADS": "2"}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
    assert done.stdout == "True\n", done
