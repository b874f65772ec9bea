"""What is read is what is hashed; where results go, no input lies."""

import os

import pytest
from stages.dummy_stages import DUMMIES, make_folder

from awescli.notation.errors import BadInput
from awescli.stages.inputs import files_of, input_hash
from awescli.stages.plan import read_plan
from awescli.stages.runner import run_plan
from awescli.stages.verify import verify


def go(file, *only, **overrides):
    plan = read_plan(file, DUMMIES, {key.replace("__", "."): value for key, value in overrides.items()})
    return {r.stage: r.reason for r in run_plan(plan, DUMMIES, only or None)}


def unchanged(reasons):
    return set(reasons.values()) == {"unchanged"}


MAPPED = "time: {column: t, unit: s}\nsignals: {phi: {column: phi, unit: deg}}\n"


def layouts(folder):
    """Every way to name a flight whose log lies somewhere: (what to set, the files that are read)."""
    (folder / "logs").mkdir()
    (folder / "logs" / "log.csv").write_text("t,phi\n0,1\n")
    (folder / "flight.yaml").write_text(f"file: logs/log.csv\n{MAPPED}")
    (folder / "mapped").mkdir()
    (folder / "mapped" / "flight.yaml").write_text(f"file: ../logs/log.csv\n{MAPPED}")
    (folder / "kitemill").mkdir()
    (folder / "kitemill" / "kite.csv").write_text("1\n")
    (folder / "kitemill" / "wind_1.csv").write_text("1\n")
    (folder / "beside").mkdir()
    (folder / "beside" / "flight.yaml").write_text("format: kitemill\nfile: ../kitemill/kite.csv\n")
    (folder / "linked").mkdir()
    (folder / "linked" / "kite.csv").symlink_to(folder / "kitemill" / "kite.csv")
    return {
        "flight.yaml": ["flight.yaml", "logs/log.csv"],
        "mapped": ["mapped/flight.yaml", "logs/log.csv"],
        "kitemill": ["kitemill/kite.csv", "kitemill/wind_1.csv"],
        "beside": ["beside/flight.yaml", "kitemill/kite.csv", "kitemill/wind_1.csv"],
        "linked": ["kitemill/kite.csv"],
    }


@pytest.mark.parametrize("flight", ["flight.yaml", "mapped", "kitemill", "beside", "linked"])
@pytest.mark.parametrize("out", ["out", ".", "kitemill"])
def test_every_file_that_is_read_counts(tmp_path, monkeypatch, flight, out):
    """A log outside the flight's folder, weather, or anything beside `out: .`, used to change without a word; verify said all was well."""
    file = make_folder(tmp_path)
    monkeypatch.chdir(tmp_path)
    read = layouts(tmp_path)[flight]
    if out == flight:
        with pytest.raises(BadInput, match="results would be written into the flight's own folder"):
            go(file, flight=flight, out=out)
        return
    go(file, flight=flight, out=out)
    assert unchanged(go(file, flight=flight, out=out)) and not verify(tmp_path / out, DUMMIES).mismatches
    for name in read:
        with open(tmp_path / name, "a") as text:
            text.write("# one more line\n")
        assert any("the flight changed since" in line for line in verify(tmp_path / out, DUMMIES).mismatches)
        assert go(file, flight=flight, out=out)["identify"] == "input flight changed"
    assert {p.resolve() for p in files_of("flight", tmp_path / flight).values()} == {(tmp_path / n).resolve() for n in read}
    (tmp_path / "mapped" / "notes.txt").write_text("nobody reads this")
    assert unchanged(go(file, flight=flight, out=out))


def test_a_weather_file_that_appears_counts(tmp_path):
    file = make_folder(tmp_path)
    go(file)
    (tmp_path / "flight" / "wind.csv").write_text("1\n")
    assert go(file)["identify"] == "input flight changed"


def test_a_flight_in_the_settings_counts_by_what_is_read(tmp_path):
    """`identify.also: [{flight: ...}]`: the folder's log, wherever it lies."""
    from awescli.stages.identify import IdentifyConfig
    from awescli.stages.runner import _settings

    layouts(tmp_path)
    config = IdentifyConfig(also=[{"flight": tmp_path / "mapped"}])
    before = _settings(config)
    (tmp_path / "logs" / "log.csv").write_text("t,phi\n0,2\n")
    assert _settings(config) != before


def test_the_same_contents_elsewhere_are_the_same_input(tmp_path):
    layouts(tmp_path)
    before = input_hash("flight", tmp_path / "kitemill")
    (tmp_path / "kitemill").rename(tmp_path / "moved")
    (tmp_path / "moved" / "wind_1.csv").rename(tmp_path / "moved" / "wind.csv")
    assert input_hash("flight", tmp_path / "moved") == before
    os.utime(tmp_path / "moved" / "kite.csv")
    assert input_hash("flight", tmp_path / "moved") == before
    (tmp_path / "moved" / "wind.csv").rename(tmp_path / "moved" / "no.csv")
    assert input_hash("flight", tmp_path / "moved") != before


@pytest.mark.parametrize("key", ["kite", "flight", "identify.weights"])
def test_an_input_in_the_results_that_would_be_replaced_is_refused(tmp_path, key):
    """`kite: out/identify/kite.yaml` with the same `out`: every run would change its own input."""
    file = make_folder(tmp_path)
    go(file)
    inside = tmp_path / "out" / "identify"
    (inside / "kite.csv").write_text("1\n")
    path = {"kite": inside / "kite.yaml", "flight": inside, "identify.weights": inside / "params.json"}[key]
    with pytest.raises(BadInput, match="lies in the results of identify, which would replace it") as e:
        go(file, **{key.replace(".", "__"): str(path)})
    assert key in e.value.where
    assert (inside / "kite.csv").read_text() == "1\n"
    if key == "kite":  # as the input of a stage further down it is as good as any
        go(file, "evaluate", kite=str(path))


def test_an_input_that_changes_while_a_stage_runs_is_noticed(tmp_path, monkeypatch):
    """Hashed before, read after: the result would be called that of a flight that it was not made from."""
    file = make_folder(tmp_path)
    run = type(DUMMIES[0]).run

    def slow(self, context, config):
        (tmp_path / "flight" / "kite.csv").write_text("changed meanwhile\n")
        return run(self, context, config)

    monkeypatch.setattr(type(DUMMIES[0]), "run", slow)
    with pytest.raises(BadInput, match="input flight changed while identify was running"):
        go(file)
    assert not (tmp_path / "out" / "identify").exists()


def test_what_the_user_puts_beside_artifacts_makes_nothing_run_again(tmp_path):
    file = make_folder(tmp_path)
    go(file)
    (tmp_path / "out" / "identify" / "notes.txt").write_text("mine")
    assert unchanged(go(file))
    go(file, seed="3")
    assert (tmp_path / "out" / "identify" / "notes.txt").read_text() == "mine"
    assert verify(tmp_path / "out", DUMMIES).mismatches == (
        f"{tmp_path / 'out' / 'identify' / 'notes.txt'}: not one of the stage's artifacts",
    )


def test_a_folder_of_the_user_with_a_stages_name_stops_the_run_before_it_begins(tmp_path, monkeypatch):
    file = make_folder(tmp_path)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "identify").mkdir()
    (tmp_path / "identify" / "mydata.txt").write_text("mine")
    with pytest.raises(BadInput, match="identify: this folder holds files and no mark of awes"):
        go(file, out=".")
    assert sorted(os.listdir(tmp_path / "identify")) == ["mydata.txt"]


def test_a_provenance_of_somebody_else_is_compared_within_limits(tmp_path):
    """A run from elsewhere may name anything as its inputs: /dev/zero used to be read for ever."""
    file = make_folder(tmp_path)
    go(file)
    provenance = tmp_path / "out" / "identify" / "provenance.json"
    os.mkfifo(tmp_path / "pipe")
    plain = provenance.read_text()
    for path in ("/dev/zero", str(tmp_path / "pipe"), "/", "/proc/self/mem"):
        provenance.write_text(plain.replace(str(tmp_path / "kite.yaml"), path))
        assert any(path in line and "cannot be compared" in line for line in verify(tmp_path / "out", DUMMIES).mismatches)
    provenance.write_text(plain.replace('"upstream": {}', '"upstream": {"../../../../../..": "00"}'))
    assert any("is no stage" in line for line in verify(tmp_path / "out", DUMMIES).mismatches)
