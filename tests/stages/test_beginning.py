"""awes init: a plan for what is there, a flight.yaml for what is not known, a kite file to fill in; one clear error for what is none."""

from pathlib import Path

import pytest
import yaml
from flightlog.foreign import knots_and_feet
from flightlog.synthetic import circle, write_folder
from typer.testing import CliRunner

from awescli.cli import build_app
from awescli.flightlog.read import read_flight
from awescli.physics.declaration import read_kite
from awescli.physics.kite import Kite
from awescli.physics.kite_template import kite_template
from awescli.stages import STAGES
from awescli.stages.plan import read_plan

ROOT = Path(__file__).parents[2]
APP = build_app(STAGES)
KITE = ROOT / "data" / "kites" / "km1_initial.yaml"


def awes(*arguments):
    result = CliRunner().invoke(APP, [str(a) for a in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.fixture(scope="module")
def demo():
    return read_flight(ROOT / "data" / "km1_demo").between(0, 1500)


def test_a_log_of_unknown_layout_gets_a_flight_file_that_reads(tmp_path, demo):
    log = knots_and_feet(demo, tmp_path / "logs")
    for flight in (log, log.parent):
        folder = tmp_path / f"plan of {flight.name}"
        result = awes("init", folder, "--flight", flight, "--kite", KITE)
        assert result.exit_code == 0, result.stderr
        assert max(map(len, result.stdout.splitlines()[:-2])) <= 80 and "columns found" in result.stdout
        assert sorted(p.name for p in folder.iterdir()) == ["flight.yaml", "stages.yaml"]
        plan = read_plan(folder / "stages.yaml", STAGES)
        assert plan.flight == folder / "flight.yaml" and plan.kite.samefile(KITE)
        back = read_flight(plan.flight)
        assert back.dt == pytest.approx(0.04) and back.wind is not None and "V_a" not in back
    assert sorted(p.name for p in log.parent.iterdir()) == ["flight_017.csv", "met_station.csv"]  # nothing was put beside the log


def test_a_kitemill_log_needs_no_flight_file_unless_it_has_another_name(tmp_path):
    folder = write_folder(tmp_path / "flight", circle(seconds=20.0))
    assert awes("init", tmp_path / "a", "--flight", folder, "--kite", KITE).exit_code == 0
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["stages.yaml"]
    assert awes("init", tmp_path / "b", "--flight", folder / "kite.csv", "--kite", KITE).exit_code == 0
    assert read_plan(tmp_path / "b" / "stages.yaml", STAGES).flight.samefile(folder)
    (folder / "kite.csv").rename(folder / "log 7.csv")
    assert awes("init", tmp_path / "c", "--flight", folder / "log 7.csv", "--kite", KITE).exit_code == 0
    assert len(read_flight(read_plan(tmp_path / "c" / "stages.yaml", STAGES).flight)) == 1000


def test_without_a_kite_one_to_fill_in_is_written_and_check_names_every_open_number(tmp_path, demo):
    log = knots_and_feet(demo, tmp_path / "logs")
    folder = tmp_path / "plan"
    result = awes("init", folder, "--flight", log)
    assert result.exit_code == 0 and "numbers to fill in" in result.stdout
    text = (folder / "kite.yaml").read_text()
    open_rows = [n for n, row in yaml.safe_load(text)["parameters"].items() if row["value"] == "fill_in"]
    check = awes("check", "--stages", folder / "stages.yaml")
    assert check.exit_code == 2
    for name in open_rows:
        line = next(i for i, row in enumerate(text.splitlines(), 1) if row.startswith(f"  {name}: "))
        assert f"kite.yaml:{line}: parameters.{name}: to be filled in: " in check.stderr, name
    assert check.stderr.count("to be filled in") == len(open_rows) > 35
    # a mistake beside them is told in the same go
    (folder / "kite.yaml").write_text(text.replace('"alpha": CLa', '"alfa": CLa'))
    assert "cannot read 'alfa'" in (again := awes("check", "--stages", folder / "stages.yaml").stderr) and "parameters.m: to be" in again
    # an open kite file is one that init takes
    (folder / "kite.yaml").write_text(text)
    assert "numbers to fill in" in awes("init", tmp_path / "other", "--flight", log, "--kite", folder / "kite.yaml").stdout


def test_the_template_is_a_whole_kite_once_its_numbers_are_there(tmp_path):
    file = tmp_path / "kite.yaml"
    for surfaces in ((), ("rudder",), ("aileron", "elevator", "rudder", "flaps")):
        file.write_text(kite_template(surfaces).replace("value: fill_in", "value: 0.5"))
        declared = read_kite(file)
        kite = Kite(declared)
        used = {m for row in declared.aerodynamics.terms.values() for m in row}
        assert set(surfaces) <= used and not ({"aileron", "elevator", "rudder", "flaps"} - set(surfaces)) & used
        assert {"m", "Jxz", "CLa", "dl"} <= set(kite.parameter_names) and declared.parameters["Jx"].free
    file.write_text(kite_template(on_line=False).replace("value: fill_in", "value: 0.5"))
    free = read_kite(file)
    assert "tether" not in free.effects and not {"dl", "CtD", "k_v"} & set(free.parameters) and Kite(free).tether is None


@pytest.mark.parametrize(
    "text, says",
    [
        ("flight: x\nkite: y\nstages: {}\n", "this is no kite file (it holds: flight, kite, stages)"),
        ("- 1\n- 2\n", "expected a mapping"),
        (f"parameters: {{{', '.join(f'p{i}: {i}.5' for i in range(50))}}}\naerodynamics: {{terms: {{}}}}\nname: x\n", "(49 further"),
        ("parameters: {a: [}\n", "kite.yaml"),
    ],
)
def test_what_is_no_kite_file_is_one_clear_error(tmp_path, demo, text, says):
    log = knots_and_feet(demo, tmp_path / "logs")
    (tmp_path / "my_kite.yaml").write_text(text)
    result = awes("init", tmp_path / "plan", "--flight", log, "--kite", tmp_path / "my_kite.yaml")
    assert result.exit_code == 2 and says in result.stderr and len(result.stderr.splitlines()) <= 3, result.stderr
    assert not (tmp_path / "plan").exists()


def test_nothing_is_overwritten_and_nothing_half_written(tmp_path, demo):
    log = knots_and_feet(demo, tmp_path / "logs")
    folder = tmp_path / "plan"
    folder.mkdir()
    (folder / "kite.yaml").write_text("mine")
    result = awes("init", folder, "--flight", log)
    assert result.exit_code == 2 and "not overwritten" in result.stderr and [p.name for p in folder.iterdir()] == ["kite.yaml"]
    assert awes("init", folder, "--flight", tmp_path / "none.csv").exit_code == 2
    (log.parent / "flight_017.csv").unlink()
    empty = awes("init", folder, "--flight", tmp_path / "plan", "--kite", KITE)
    assert empty.exit_code == 2 and "no flight log is in this folder" in empty.stderr


def test_a_log_far_from_its_flight_file_is_an_input(tmp_path, demo):
    """A drafted flight.yaml names log and weather elsewhere: a change in either makes the stages run again, and `verify` sees it."""
    from awescli.stages.inputs import files_of, input_hash

    log = knots_and_feet(demo, tmp_path / "logs")
    assert awes("init", tmp_path / "plan", "--flight", log, "--kite", KITE).exit_code == 0
    flight = tmp_path / "plan" / "flight.yaml"
    assert {p.name for p in files_of("flight", flight).values()} == {"flight.yaml", "flight_017.csv", "met_station.csv"}
    for file in (log, log.parent / "met_station.csv"):
        before, text = input_hash("flight", flight), file.read_text()
        file.write_text(text[:-400])
        assert input_hash("flight", flight) != before
        file.write_text(text)
        assert input_hash("flight", flight) == before
    assert files_of("kite", KITE) == {"kite": KITE}
