"""`awes verify`: every kind of change is one line and exit code 2; an untouched run passes."""

import json

import pytest
from stages.dummy_stages import DUMMIES, make_folder
from typer.testing import CliRunner

from awescli.cli import build_app

APP = build_app(DUMMIES)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    make_folder(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(APP, ["run"]).exit_code == 0
    return tmp_path


def verify(*arguments):
    return CliRunner().invoke(APP, ["verify", *arguments])


def test_an_untouched_run_passes_from_anywhere(folder, monkeypatch, tmp_path_factory):
    result = verify()
    assert result.exit_code == 0 and "identify: 2 files" in result.stdout and "all hashes as in the provenance" in result.stdout
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    assert verify(str(folder / "out")).exit_code == 0


@pytest.mark.parametrize(
    "change, lines",
    [
        (
            lambda f: (f / "out/identify/params.json").write_text("{}"),
            ["out/identify/params.json: changed since it was written", "out/identify: not what trace-residual was made from",
             "out/identify: not what evaluate was made from"],
        ),
        (lambda f: (f / "out/evaluate/metrics.json").unlink(), ["out/evaluate/metrics.json: missing"]),
        (lambda f: (f / "out/evaluate/other.txt").write_text("x"), ["out/evaluate/other.txt: not one of the stage's artifacts"]),
        (
            lambda f: (f / "flight/kite.csv").write_text("3,4\n"),
            [f"the flight changed since {stage} was made from it" for stage in ("identify", "trace-residual", "evaluate")],
        ),
        (
            lambda f: (f / "kite.yaml").unlink(),
            [f"the kite that {stage} was made from is not there" for stage in ("identify", "trace-residual", "evaluate")],
        ),
        (lambda f: (f / "out/evaluate/provenance.json").write_text("[1]"), ["out/evaluate/provenance.json: not readable as provenance"]),
    ],
)  # fmt: skip
def test_every_change_is_one_line(folder, change, lines):
    change(folder)
    result = verify()
    assert result.exit_code == 2
    told = result.stderr.strip().split("\n")
    assert len(told) == len(lines) and all(any(line in t for t in told) for line in lines), told
    answer = json.loads(verify("--json").stdout)
    assert len(answer["mismatches"]) == len(lines)


def test_a_folder_without_results_is_said_so(folder):
    result = verify("flight")
    assert result.exit_code == 2 and "no results of awes are here" in result.stderr
