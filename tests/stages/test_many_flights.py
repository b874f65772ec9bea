"""A plan of many flights, with dummy stages: what is refused, what each flight's end says, resumption, and the table."""

import csv
import json
import re

import pytest
from stages.dummy_stages import DUMMIES, Fit, awes, make_folder

from awescli.notation.errors import BadInput
from awescli.stages.plan import read_plan, read_plans

SERIAL = ("--workers", "0")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A plan of three flights, a, b and c."""
    plan = make_folder(tmp_path)
    for name in "abc":
        (tmp_path / "logs" / name).mkdir(parents=True)
        (tmp_path / "logs" / name / "kite.csv").write_text(f"{name}\n")
    plan.write_text(plan.read_text().replace("flight: flight", "flights: [logs/a, logs/b, logs/c]"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def table(folder):
    return {row["flight"]: row for row in json.loads((folder / "out" / "flights.json").read_text())["flights"]}


@pytest.mark.parametrize("workers", ["0", "2"])
def test_every_flight_has_an_ordinary_run_of_its_own(folder, workers):
    """What `flight: logs/a` with `out: elsewhere` makes is what stands in out/a, byte for byte but for times and paths."""
    result = awes("run", "--workers", workers)
    assert result.exit_code == 0, result.output
    assert [row["status"] for row in table(folder).values()] == ["done"] * 3 and list(table(folder)) == ["a", "b", "c"]
    with open(folder / "out" / "flights.csv") as file:
        assert [(row["flight"], row["status"], row["log"]) for row in csv.DictReader(file)] == [
            (name, "done", str(folder / "logs" / name)) for name in "abc"
        ]
    (folder / "alone.yaml").write_text((folder / "stages.yaml").read_text().replace("flights: [logs/a, logs/b, logs/c]", "flight: logs/b"))
    assert awes("run", "--stages", "alone.yaml", "--set", "out=alone").exit_code == 0
    for file in (folder / "alone").rglob("*"):
        if file.is_file() and ".awes" not in file.parts and file.name != "provenance.json":
            assert (folder / "out" / "b" / file.relative_to(folder / "alone")).read_bytes() == file.read_bytes()
    again = awes("run", *SERIAL)
    assert {row["stages"]["identify"] for row in table(folder).values()} == {"unchanged"} and again.exit_code == 0


def test_a_page_stands_beside_the_table_and_links_to_the_reports_that_there_are(folder):
    result = awes("run", *SERIAL, "--set", "evaluate.report=true")
    assert result.exit_code == 0 and "flights.html" in result.stdout
    page = (folder / "out" / "flights.html").read_text()
    links = re.findall(r'<a href="\./([^"]*)"', page)
    assert links == [f"{name}/evaluate/report.html" for name in "abc"] and all((folder / "out" / link).is_file() for link in links)


def test_what_has_changed_is_run_again_and_nothing_else(folder):
    awes("run", *SERIAL)
    (folder / "logs" / "b" / "kite.csv").write_text("changed\n")
    awes("run", *SERIAL)
    assert [row["stages"]["identify"] for row in table(folder).values()] == ["unchanged", "ran", "unchanged"]


def test_one_flight_of_many(folder):
    result = awes("identify")
    assert result.exit_code == 2 and "the plan names 3 flights" in result.stderr and "--flight a" in result.stderr
    assert result.stderr.count("error:") == 1 and not (folder / "out").exists()
    assert awes("identify", "--flight", "b").exit_code == 0
    assert (folder / "out" / "b" / "identify" / "params.json").is_file() and not (folder / "out" / "a").exists()
    assert "Did you mean" in awes("identify", "--flight", "bb").stderr
    assert awes("run", "--flight", "c").exit_code == 0 and not (folder / "out" / "flights.json").exists()
    needed = awes("trace-residual", "--flight", "a")
    assert needed.exit_code == 2 and "awes identify --flight a" in needed.stderr
    with pytest.raises(BadInput, match="3 flights"):
        read_plan(folder / "stages.yaml", DUMMIES)


@pytest.mark.parametrize(
    "end, code, status",
    [("good", 0, "done"), ("diverge", 3, "no answer"), ("no answer", 3, "no answer"), ("fault", 1, "fault")],
)
def test_the_exit_code_is_that_of_the_worst(folder, end, code, status):
    result = awes("run", *SERIAL, "--set", f"identify.end={end}")
    assert result.exit_code == code and {row["status"] for row in table(folder).values()} == {status}, result.output
    assert status == "done" or "3 of 3 flights" in result.stderr


def test_a_flight_that_cannot_be_run_stops_no_other(folder):
    """Its results are refused (its folder holds somebody's file of a stage's name); the others are done, and the code says 2."""
    (folder / "out" / "b").mkdir(parents=True)
    (folder / "out" / "b" / "identify").write_text("the user's own")
    result = awes("run", "--workers", "2")
    assert result.exit_code == 2, result.output
    assert [row["status"] for row in table(folder).values()] == ["done", "refused", "done"]
    assert "1 of 3 flights: refused" in result.stderr and "b: " in result.stderr
    assert (folder / "out" / "b" / "identify").read_text() == "the user's own"


def test_rows_tell_nothing_of_an_earlier_plan(folder):
    """A flight whose run fails now has no verdict of the run before."""
    awes("run", *SERIAL)
    result = awes("run", *SERIAL, "--set", "identify.end=diverge")
    assert result.exit_code == 3 and all(row["stages"] == {} for row in table(folder).values())


def test_an_interruption_ends_all_and_the_next_start_goes_on(folder):
    result = awes("run", *SERIAL, "--set", "identify.end=interrupt")
    assert result.exit_code == 130 and "interrupted" in result.stderr and not (folder / "out" / "flights.json").exists()
    done = awes("run", "--workers", "0")
    assert done.exit_code == 0 and [row["status"] for row in table(folder).values()] == ["done"] * 3


@pytest.mark.parametrize("how", [("--force",), ("--from", "identify")])
def test_a_forced_run_that_was_interrupted_forces_no_flight_twice(folder, how, monkeypatch):
    """Flights that had ended before the interruption were forced again. Then the run is over, and the same command a new one; an
    ordinary run in between gives the forced one up."""
    assert awes("run", *SERIAL).exit_code == 0
    flown, ordinary = [], Fit.run

    def ctrl_c_at(name):
        def run(self, context, config):
            if context.flight.name == name:
                raise KeyboardInterrupt
            flown.append(context.flight.name)
            return ordinary(self, context, config)

        flown.clear()
        monkeypatch.setattr(Fit, "run", run)

    def statuses():
        return [row["stages"]["identify"] for row in table(folder).values()]

    ctrl_c_at("b")
    assert awes("run", *SERIAL, *how).exit_code == 130 and flown == ["a"]
    ctrl_c_at("c")
    assert awes("run", *SERIAL, *how).exit_code == 130 and flown == ["b"]
    ctrl_c_at("")
    assert awes("run", *SERIAL, *how).exit_code == 0 and flown == ["c"] and statuses() == ["unchanged", "unchanged", "ran"]
    ctrl_c_at("")
    assert awes("run", *SERIAL, *how).exit_code == 0 and flown == ["a", "b", "c"] and statuses() == ["ran"] * 3
    ctrl_c_at("b")
    assert awes("run", *SERIAL, *how).exit_code == 130
    ctrl_c_at("")
    assert awes("run", *SERIAL).exit_code == 0 and flown == []
    assert awes("run", *SERIAL, *how).exit_code == 0 and flown == ["a", "b", "c"]


def test_a_flight_without_an_answer_is_not_forced_twice_either(folder, monkeypatch):
    """It has ended: its stages that had run stand, the answer is the same."""
    settings = ("--set", "identify.end=no answer", "--force")
    flown, ordinary = [], Fit.run

    def run(self, context, config):
        if context.flight.name == "c" and flown.count("a") == 1 and len(flown) == 2:
            raise KeyboardInterrupt
        flown.append(context.flight.name)
        return ordinary(self, context, config)

    monkeypatch.setattr(Fit, "run", run)
    assert awes("run", *SERIAL, *settings).exit_code == 130
    flown.append("again")
    assert awes("run", *SERIAL, *settings).exit_code == 3 and flown == ["a", "b", "again", "c"]
    assert [row["status"] for row in table(folder).values()] == ["no answer"] * 3


def test_dry_run_and_check_write_nothing(folder):
    result = awes("run", "--dry-run")
    assert result.exit_code == 0 and "a: identify: would run (first run)" in result.stdout
    assert [f["flight"] for f in json.loads(awes("run", "--dry-run", "--json").stdout)["flights"]] == ["a", "b", "c"]
    assert not (folder / "out").exists()


@pytest.mark.parametrize(
    "line, where, what",
    [
        ("flights: [logs/a, other/a]", r":1: flights.1", "two flights are called 'a'"),
        ("flights: [logs/a, logs/A2, nowhere]", r":1: flights.2", "nowhere is no flight: there is no such flight folder"),
        ("flights: [logs/a, empty]", r":1: flights.1", "empty is no flight: no flight log that awes knows"),
        ("flights: [none*]", r":1: flights.0", "no folder matches none*"),
        ("flights: []", r":1: flights", "at least 1"),
        ("flights:", r":1: flights", "list"),
        ("flights: logs/a", r":1: flights", "list"),
        ("flight: logs/a\nflights: [logs/b]", r":2: flights", "names a `flight` and `flights` too"),
        ("flights: [identify]", r":1: flights.0", "where awes keeps others"),
    ],
)  # fmt: skip
def test_flights_that_cannot_be_told_apart_or_are_none(folder, line, where, what):
    for path in ("other/a", "logs/A2", "identify"):
        (folder / path).mkdir(parents=True)
        (folder / path / "kite.csv").write_text("1\n")
    (folder / "empty").mkdir()
    (folder / "stages.yaml").write_text(f"{line}\nkite: kite.yaml\nstages: {{identify: {{}}}}\n")
    for command in ("run", "check", "identify"):
        result = awes(command)
        assert result.exit_code == 2 and re.search(f"stages.yaml{where}", result.stderr), result.stderr
        assert what in result.stderr and result.stderr.count("error:") == 1
    assert not (folder / "out").exists()


def test_results_never_land_on_a_flight(folder):
    result = awes("run", "--set", "out=logs")
    assert result.exit_code == 2 and "the flight's own folder" in result.stderr
    assert sorted(p.name for p in (folder / "logs" / "a").iterdir()) == ["kite.csv"]


def test_patterns_and_set(folder, monkeypatch):
    """A pattern is looked for beside the plan; `--set` from the current folder."""
    (folder / "stages.yaml").write_text((folder / "stages.yaml").read_text().replace("[logs/a, logs/b, logs/c]", "['logs/[ab]', logs/c]"))
    assert list(read_plans(folder / "stages.yaml", DUMMIES).by_flight) == ["a", "b", "c"]
    monkeypatch.chdir(folder / "logs")
    found = read_plans(folder / "stages.yaml", DUMMIES, {"flights": "['[bc]']", "out": "here"})
    assert {name: (plan.flight, str(plan.out)) for name, plan in found.by_flight.items()} == {
        name: (folder / "logs" / name, f"here/{name}") for name in "bc"
    }


def test_options_for_many_are_refused_for_one(folder):
    (folder / "stages.yaml").write_text((folder / "stages.yaml").read_text().replace("flights: [logs/a, logs/b, logs/c]", "flight: logs/a"))
    assert "--workers: one flight is run" in awes("run", "--workers", "2").stderr
    assert "names one flight" in awes("identify", "--flight", "a").stderr


def test_no_scheduler_there_is_one_error(folder):
    import awescli.stages.workers as workers

    patience, workers.PATIENCE = workers.PATIENCE, 1
    try:
        result = awes("run", "--scheduler", "tcp://127.0.0.1:9")
    finally:
        workers.PATIENCE = patience
    assert result.exit_code == 2 and "no Dask scheduler answers" in result.stderr and not (folder / "out").exists()


def test_without_dask_there_is_one_error_and_a_way_on(folder, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "distributed", None)
    result = awes("run")
    assert result.exit_code == 2 and "--workers 0" in result.stderr and not (folder / "out").exists()
    assert awes("run", "--workers", "0").exit_code == 0
