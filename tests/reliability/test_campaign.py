"""Campaigns: the same files from Dask as from one case after the other; a killed worker or an interruption loses nothing."""

import json
import sys

import pytest
from campaign import kept, result_file, run_campaign
from reliability.campaign_work import computes, fails, fills_memory_again, identifies, kills_every_worker, kills_its_worker_once


def files(folder):
    return {p.name: p.read_bytes() for p in sorted(folder.iterdir())}


def test_dask_gives_the_bytes_of_the_serial_run(tmp_path):
    """Also for a real fit, whose workers are other processes with another number of threads."""
    cases = {f"fit:{seed}": {"seed": seed} for seed in (11, 12)}
    assert run_campaign(identifies, cases, tmp_path / "serial", jobs=0) == {}
    assert run_campaign(identifies, cases, tmp_path / "dask", jobs=2) == {}
    assert files(tmp_path / "dask") == files(tmp_path / "serial") and len(files(tmp_path / "dask")) == 2


def test_a_killed_worker_loses_nothing(tmp_path):
    """SIGKILL of the worker in three of twelve cases: they are given to another, and all results are those of the serial run."""
    cases = {f"c{i:02d}": {"seed": i} | ({"mark": str(tmp_path / f"mark{i}")} if i in (0, 5, 9) else {}) for i in range(12)}
    assert run_campaign(kills_its_worker_once, cases, tmp_path / "dask", jobs=2) == {}
    assert len(list(tmp_path.glob("mark*"))) == 3  # all three did die
    assert run_campaign(computes, cases, tmp_path / "serial", jobs=0) == {}
    assert files(tmp_path / "dask") == files(tmp_path / "serial")


def test_a_case_that_kills_every_worker_fails_by_name(tmp_path):
    failed = run_campaign(kills_every_worker, {"bad": {}}, tmp_path, jobs=1)
    assert list(failed) == ["bad"] and "KilledWorker" in failed["bad"] and not result_file(tmp_path, "bad").exists()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="how memory is given back is a matter of the C library")
def test_workers_keep_the_memory_that_they_need_again(tmp_path):
    """Guards a third of the time of fits in gusts: Dask has free memory given back at once, and 1024 pages of each 4 MB are filled anew."""
    assert run_campaign(fills_memory_again, {"one": {}}, tmp_path, jobs=1) == {}
    assert kept(tmp_path, {"one": {}})["one"]["pages"] < 50 * 1024 / 10


def test_resumes_where_it_stopped_and_tries_failed_cases_again(tmp_path, capsys):
    cases = {f"c{i}": {"seed": i} for i in range(4)}
    assert run_campaign(fails, cases, tmp_path, jobs=0) == {"c2": "ValueError: case 2 is broken"}
    assert list(kept(tmp_path, cases)) == ["c0", "c1", "c3"]
    marked = json.dumps({"mine": True})
    result_file(tmp_path, "c1").write_text(marked)  # a kept result is not made again
    assert run_campaign(computes, cases, tmp_path, jobs=0) == {}
    assert "4 cases, 3 done before" in capsys.readouterr().out
    assert result_file(tmp_path, "c1").read_text() == marked and "c2" in kept(tmp_path, cases)


def test_runs_on_the_scheduler_at_an_address(tmp_path):
    """`--scheduler ADDRESS`: a cluster that somebody else started."""
    from distributed import LocalCluster

    cases = {f"c{i}": {"seed": i} for i in range(3)}
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        assert run_campaign(computes, cases, tmp_path / "dask", scheduler=cluster.scheduler_address) == {}
    assert run_campaign(computes, cases, tmp_path / "serial", jobs=0) == {}
    assert files(tmp_path / "dask") == files(tmp_path / "serial")
