"""The command line, through its front door, with dummy stages."""

import json
import os
import pty
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from stages.dummy_stages import DUMMIES, awes, make_folder
from typer.testing import CliRunner

from awescli.cli import build_app
from awescli.cli.screen import _PlainTask
from awescli.stages import STAGES

ROOT = Path(__file__).parents[2]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    make_folder(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_users_own_sequence(folder):
    for command in (["identify"], ["trace-residual"], ["evaluate", "--report"]):
        result = awes(*command)
        assert result.exit_code == 0, result.stderr
    assert (folder / "out" / "evaluate" / "report.html").is_file()
    assert "identify: skipped, unchanged" in awes("identify").stdout


def test_a_stage_without_an_answer_ends_with_code_3(folder):
    """Also where nothing had to run: who goes by the exit code is never told that there is a model."""
    for _ in range(2):
        result = awes("identify", "--set", "identify.end=no answer")
        assert result.exit_code == 3 and "the fit stalled" in result.stderr and "Start closer." in result.stderr
    assert (folder / "out" / "identify" / "params.json").is_file()


def test_figures_go_where_the_user_wants_them(folder):
    awes("run")
    (folder / "paper").mkdir()
    (folder / "paper" / "mine.tex").write_text("kept")
    own = folder / "out" / ".awes"  # the log goes on
    before = {p: p.read_bytes() for p in (folder / "out").rglob("*") if p.is_file() and p.parent != own}
    for arguments in (["--figures", "paper"], [], ["--figures", "paper"]):
        result = awes("evaluate", *arguments)
        assert result.exit_code == 0 and "evaluate: skipped, unchanged" in result.stdout, result.stderr
        assert ("figures: 1 files in paper" in result.stdout) == bool(arguments)
        if arguments:
            assert sorted(p.name for p in (folder / "paper").iterdir()) == [".made-by-awes", "mine.tex", "one.png"]
            assert (folder / "paper" / "one.png").read_bytes() == b"PNG of from: trace-residual 3\n"
            (folder / "paper" / "one.png").write_bytes(b"an earlier copy, which awes may replace")
    now = {p: p.read_bytes() for p in (folder / "out").rglob("*") if p.is_file() and p.parent != own}
    assert now == before  # a view of the results, not one of them
    assert "files in" not in awes("evaluate", "--figures", "paper", "--dry-run").stdout
    (folder / "own").mkdir()
    (folder / "own" / "one.png").write_text("the user's own")
    result = awes("evaluate", "--figures", "own")
    assert result.exit_code == 2 and "own: awes did not make one.png" in result.stderr
    assert (folder / "own" / "one.png").read_text() == "the user's own"
    result = awes("evaluate", "--figures", "kite.yaml")
    assert result.exit_code == 2 and "--figures kite.yaml: is a file, a folder is needed" in result.stderr


def test_run_says_why_and_shows_the_summary(folder):
    result = awes("run", "--set", "identify.horizon=4.0")
    assert result.exit_code == 0
    assert "identify: runs (first run)" in result.stdout and "test error 0.0361, outcome converged" in result.stdout
    assert "\x1b" not in result.stdout
    table = result.stdout[result.stdout.index("evaluate: errors") :].split("\n")
    assert [line.split() for line in table[1:4]] == [["mean"], ["initial", "0.1"], ["identified", "0.0361"]]
    again = awes("run")
    assert "identify: runs (setting horizon changed 4.0 -> 5.0)" in again.stdout
    assert "evaluate: errors" in awes("run").stdout  # also when nothing had to run


def test_dry_run_quiet_and_json(folder):
    result = awes("run", "--dry-run")
    assert "identify: would run (first run)" in result.stdout and not (folder / "out").exists()
    assert awes("run", "--quiet").stdout == ""
    result = awes("run", "--json", "--from", "evaluate")
    answer = json.loads(result.stdout)
    assert [s["status"] for s in answer["stages"]] == ["skipped", "skipped", "ran"]
    assert answer["stages"][2]["summary"]["errors"]["initial"] == {"mean": 0.1}


@pytest.mark.parametrize("stage", [s.name for s in STAGES])
def test_every_stage_can_be_quiet_and_answer_in_json(stage):
    text = CliRunner().invoke(build_app(STAGES), [stage, "--help"]).stdout
    assert "--quiet" in text and "--json" in text


@pytest.mark.parametrize("stage", [s.name for s in DUMMIES])
def test_quiet_says_nothing_and_json_is_only_json(folder, stage):
    awes("run")
    quiet = awes(stage, "--quiet", "--force")
    assert (quiet.stdout, quiet.stderr, quiet.exit_code) == ("", "", 0)
    loud = awes(stage, "--json", "--force")
    assert json.loads(loud.stdout)["stages"][0]["status"] == "ran" and f"{stage}: done in" in loud.stderr
    both = awes(stage, "--json", "--quiet", "--force")
    assert json.loads(both.stdout)["stages"][0]["stage"] == stage and both.stderr == ""
    wrong = awes(stage, "--json", "--set", "identify.horizon=-1")
    assert wrong.exit_code == 2 and wrong.stdout == "" and "identify.horizon" in wrong.stderr


RUN = """
import sys
sys.path.insert(0, {tests!r})
from stages.dummy_stages import DUMMIES
from awescli.cli import build_app
build_app(DUMMIES)(["run", "--force"])
"""


def test_no_colour_codes_in_a_pipe_but_bars_on_a_terminal(folder):
    """A pipe gets plain lines whatever the environment asks for; a terminal gets rich's bars."""
    code = [sys.executable, "-c", RUN.format(tests=os.path.dirname(os.path.dirname(__file__)))]
    wild = {**os.environ, "FORCE_COLOR": "1", "CLICOLOR_FORCE": "1", "TERM": "xterm-256color", "COLORTERM": "truecolor"}
    piped = subprocess.run(code, env=wild, capture_output=True, text=True, timeout=60)
    assert piped.returncode == 0 and "identify: done in" in piped.stdout and "\x1b" not in piped.stdout + piped.stderr
    ours, theirs = pty.openpty()
    process = subprocess.Popen(code, env=wild, stdout=theirs, stderr=theirs)
    os.close(theirs)
    shown = b""
    while True:
        try:
            piece = os.read(ours, 65536)
        except OSError:  # Linux: the other end is closed
            break
        if not piece:
            break
        shown += piece
    assert process.wait(timeout=60) == 0 and b"\x1b[" in shown and b"identify: done in" in shown


@pytest.mark.parametrize(
    "arguments, code, message",
    [
        (["run", "--stages", "none.yaml"], 2, "none.yaml: there is no such file"),
        (["run", "--set", "identify.horizonn=1"], 2, "--set identify.horizonn: unknown key\n  Did you mean 'horizon'?"),
        (["run", "--set", "identify.horizon"], 2, "not KEY=VALUE"),
        (["run", "--from", "evalute"], 2, "Did you mean 'evaluate'?"),
        (["trace-residual"], 2, "Make it first: awes identify"),
        (["identify", "--set", "identify.end=diverge"], 3, "identify: the cost is infinite\n  Start closer."),
        (["identify", "--set", "identify.end=interrupt"], 130, "interrupted during identify"),
        (["identify", "--set", "identify.end=fault"], 1, "ZeroDivisionError"),
        (["identfy"], 2, "identfy"),
        (["run", "--frm", "x"], 2, "--frm"),
    ],
)
def test_exit_codes(folder, arguments, code, message):
    result = awes(*arguments)
    assert result.exit_code == code and message in result.stderr and "Traceback" not in result.stderr


def test_init_writes_a_plan_that_runs_and_overwrites_nothing(folder):
    with open(ROOT / "data" / "km1_demo" / "kite.csv") as demo:
        (folder / "flight" / "kite.csv").write_text("".join(demo.readline() for _ in range(3)))
    (folder / "kite.yaml").write_text((ROOT / "data" / "kites" / "development.yaml").read_text())
    result = awes("init", "new", "--flight", "flight", "--kite", "kite.yaml")
    assert result.exit_code == 0, result.stderr
    text = (folder / "new" / "stages.yaml").read_text()
    assert "flight: " in text and "../flight" in text and "# horizon: 5.0    # seconds between re-initialisations" in text
    assert awes("run", "--stages", "new/stages.yaml").exit_code == 0
    assert (folder / "new" / "out" / "evaluate" / "metrics.json").is_file()
    again = awes("init", "new", "--flight", "flight", "--kite", "kite.yaml")
    assert again.exit_code == 2 and "not overwritten" in again.stderr
    assert awes("init", "new2", "--flight", "no", "--kite", "kite.yaml").exit_code == 2 and not (folder / "new2").exists()


def test_check_tells_all_that_is_wrong_with_the_inputs(folder):
    result = awes("check")
    assert result.exit_code == 2 and "plan    stages.yaml: good, runs identify, trace-residual, evaluate" in result.stdout
    assert "kite.yaml:1: this is no kite file (it holds: from)" in result.stderr and result.stderr.count("kite.yaml") == 1
    assert "flight" in result.stderr and "Traceback" not in result.stderr


def test_every_part_of_the_data_quality_is_shown(capsys):
    import numpy as np

    from awescli.cli.commands import quality_sections
    from awescli.cli.screen import Screen
    from awescli.flightlog.log import FlightLog
    from awescli.flightlog.quality import data_quality

    time = np.arange(3000) / 50
    turn = 2 * np.pi * time / 10
    circle = {"p_n": 300 + 60 * np.cos(turn), "p_e": 60 * np.sin(turn), "p_d": -200 + 0 * time}
    circle |= {"v_n": -12 * np.pi * np.sin(turn), "v_e": 12 * np.pi * np.cos(turn), "v_d": 0 * time}
    angles = {name: 0 * time for name in ("phi", "theta", "psi", "p", "q", "r")}
    log = FlightLog("circle", 0.0, 0.02, time, circle | angles, {"rudder": 0 * time}, np.ones(3000, bool), notes=("made up",))
    sections = quality_sections(data_quality(log))
    for title, content in sections.items():
        Screen().section(title, content)
    shown = capsys.readouterr().out
    for name in ("p_n", "position against velocity", "made up", "verdict: "):
        assert name in shown


def test_check_compares_the_ranges_of_the_parts():
    """Guards a test part that leaves what train flew: `check` says so, with a table; the default split of the bundled flight does not."""
    plan = ["check", "--stages", str(Path(__file__).parents[2] / "stages.yaml"), "--set", "split.order=chronological"]
    result = CliRunner().invoke(build_app(STAGES), plan)
    shown = " ".join(result.stdout.split())
    assert result.exit_code == 0 and "ranges of the parts" in shown and "verdict: look at ranges" in shown
    assert "Test flies tether length 532 to 554 m, train 480 to 516 m" in shown
    result = CliRunner().invoke(build_app(STAGES), plan[:3])
    assert "verdict: good" in result.stdout and "ranges of the parts" in result.stdout


def test_schema_prints_the_schemas_of_all_files(folder):
    schema = json.loads(awes("schema").stdout)
    assert set(schema) == {"stages", "kite", "flight"} and "flight" in schema["stages"]["properties"]
    column = schema["flight"]["definitions"]["Column"]["properties"]
    assert {"column", "unit", "sign", "scale", "offset"} <= set(column) and "file" in schema["flight"]["definitions"]["Wind"]["properties"]


def test_help_names_every_stage_and_setting():
    text = awes("--help").stdout
    assert all(stage.name in text and stage.help in text for stage in DUMMIES)
    text = awes("evaluate", "--help").stdout
    assert "--report" in text and "evaluate.report (False): also write report.html" in text
    assert "--report" not in awes("identify", "--help").stdout
    assert awes("--version").stdout.startswith("awes ")


def test_help_answers_at_once():
    """0.3 s is the promise, and heavy imports are what breaks it (timing itself never decides a test)."""
    code = "import sys; from awescli.cli import main; sys.argv = ['awes', '--help']\ntry: main()\nexcept SystemExit: pass\n"
    code += "heavy = {'numpy', 'scipy', 'torch', 'polars', 'llvmlite', 'plotly', 'matplotlib', 'rich.table', 'jinja2'} & set(sys.modules)\n"
    code += "assert not heavy, heavy"
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


WAITING = """
import sys, time
sys.path.insert(0, {tests!r})
from stages.dummy_stages import DUMMIES, Fit
from awescli.cli import build_app

class Slow(Fit):
    def run(self, context, config):
        print("waiting", flush=True)
        time.sleep(30)

build_app((Slow(), *DUMMIES[1:]))(["run"])
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_interrupt_cleanly(folder, number):
    code = WAITING.format(tests=os.path.dirname(os.path.dirname(__file__)))
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while "waiting" not in process.stdout.readline():
        pass
    process.send_signal(number)
    _, stderr = process.communicate(timeout=20)
    assert process.returncode == 130 and "interrupted during identify" in stderr and "Traceback" not in stderr
    assert not list((folder / "out" / ".awes" / "partial").iterdir())


def test_a_killed_run_leaves_nothing_in_the_way(folder):
    assert awes("run").exit_code == 0
    before = (folder / "out" / "identify" / "params.json").read_bytes()
    code = WAITING.format(tests=os.path.dirname(os.path.dirname(__file__))).replace('["run"]', '["run", "--force"]')
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    while "waiting" not in process.stdout.readline():
        pass
    process.kill()
    process.communicate(timeout=20)
    assert list((folder / "out" / ".awes" / "partial").glob("identify-*"))
    assert (folder / "out" / "identify" / "params.json").read_bytes() == before
    assert "identify: skipped, unchanged" in awes("run").stdout
    assert not list((folder / "out" / ".awes" / "partial").iterdir())


def test_two_runs_in_one_folder(folder):
    from awescli.artifacts import locked

    with locked(folder / "out"):
        result = awes("run")
    assert result.exit_code == 2 and "another awes" in result.stderr


def test_control_characters_of_files_do_not_reach_the_terminal(folder):
    """A column's name could colour the screen, set its title or overwrite what stands there."""
    evil = "\x1b[31m\x1b]0;owned\x07\r\x9b2J\u202egnp.txt"
    (folder / "flight" / "kite.csv").write_text(f"epoch_ms,{evil}\n1,2\n")
    (folder / "kite.yaml").write_text("name: x\n")
    result = awes("check")
    assert result.exit_code == 2 and "\\x1b[31m" in result.stderr and "\\u202e" in result.stderr
    for text in (result.stderr, result.stdout):
        assert not [c for c in text if not (c.isprintable() or c in "\n\t")]


def test_a_path_that_is_no_text_is_shown_nevertheless(folder):
    """A file's name of bytes that are no UTF-8."""
    (folder / "empty").mkdir()
    (folder / "empty" / os.fsdecode(b"\xff.txt")).write_text("x")
    (folder / "kite.yaml").write_text("name: x\n")
    result = awes("check", "--set", "flight=empty")
    assert result.exit_code == 2 and "there is: \\udcff.txt" in result.stderr


LOADED = """
import os, signal, sys
os.kill(os.getpid(), {signal})
for i in range(10**5):  # time for it to arrive
    pass
print("loaded", flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_waits_until_a_module_is_loaded(tmp_path, number):
    """A kill campaign found a panic of a compiled module, exit code 70: the interruption came while it asked numpy for its version."""
    (tmp_path / "loads_long.py").write_text(LOADED.format(signal=int(number)))
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n" + "from awescli.cli.shell import shell\n"
    code += "import time, typer\ntry:\n    with shell():\n        import loads_long\n        time.sleep(20)\n"
    code += "except typer.Exit as e:\n    print(e.exit_code)\n"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "loaded\n130\n" and done.stderr.startswith("interrupted") and "Traceback" not in done.stderr, done


def test_what_follows_from_an_interruption_is_no_fault(capsys):
    """Code that turns it into an error of its own."""
    import typer

    from awescli.cli.shell import shell

    with pytest.raises(typer.Exit) as ended, shell():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            for _ in range(10**5):
                pass
        except KeyboardInterrupt as e:
            raise ImportError("a compiled module failed to load") from e
    assert ended.value.exit_code == 130 and "fault of awes" not in capsys.readouterr().err


@pytest.mark.parametrize("where", ["build_app", "commands"])
def test_ctrl_c_before_a_command_begins_leaves_no_traceback(where):
    """While commands are built, and while one reads its options: a kill campaign found a traceback there."""
    patched = {
        "build_app": "app.build_app = lambda stages: os.kill(os.getpid(), signal.SIGINT)",
        "commands": "commands.check = None; app.shell = lambda *a: os.kill(os.getpid(), signal.SIGINT)",
    }[where]
    code = f"import os, signal, sys; from awescli.cli import app, commands, main; {patched}; sys.argv = ['awes', 'check']; main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


def test_what_was_said_stands_in_the_log_file(folder, monkeypatch):
    """Run after run, with the time of day, what --quiet does not show and errors too; a dry run leaves nothing."""
    log = folder / "out" / ".awes" / "awes.log"
    monkeypatch.setattr("sys.argv", ["awes", "run", "--quiet"])
    awes("run", "--dry-run")
    assert not log.exists()
    assert awes("run", "--quiet").stdout == ""
    lines = log.read_text().splitlines()
    assert all(re.match(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[+-]\d\d:\d\d \[\d+\] ", line) for line in lines)
    assert lines[0].endswith("$ awes run --quiet") and any("identify: done in" in line for line in lines)
    awes("identify", "--set", "identify.end=no answer")
    more = log.read_text().splitlines()
    assert more[: len(lines)] == lines and any("the fit stalled" in line for line in more[len(lines) :])
    # a mistake of the plan is nothing that happened in this folder
    awes("identify", "--set", "identify.en=1")
    assert log.read_text().splitlines() == more


@pytest.mark.parametrize("planted", ["link", "second name", "folder", "pipe"])
def test_the_log_is_written_to_nothing_else(folder, planted):
    awes("run")
    log, mine = folder / "out" / ".awes" / "awes.log", folder / "mine"
    mine.write_text("mine")
    log.unlink()
    plant = {
        "link": lambda: log.symlink_to(mine),
        "second name": lambda: os.link(mine, log),
        "folder": log.mkdir,
        "pipe": lambda: os.mkfifo(log),
    }
    plant[planted]()
    assert awes("run", "--force").exit_code == 0
    assert mine.read_text() == "mine"


def test_a_log_does_not_grow_without_end(folder, monkeypatch):
    monkeypatch.setattr("awescli.artifacts.journal.LONGEST", 100)
    for _ in range(3):
        awes("run", "--force")
    own = folder / "out" / ".awes"
    assert sorted(p.name for p in own.glob("awes.log*")) == ["awes.log", "awes.log.1"]


def test_where_the_steps_are_known_the_rest_is_told(monkeypatch):
    """In a pipe: one line every ten seconds, with the time that is left where every step took as long."""
    clock, said = [0.0], []
    monkeypatch.setattr("awescli.cli.screen.time.monotonic", lambda: clock[0])
    task = _PlainTask(said.append, "scoring", 4)
    for _ in range(3):
        clock[0] += 12.0
        task.advance()
    assert said == ["  scoring", "  scoring 1/4 (about 36 s left)", "  scoring 2/4 (about 24 s left)", "  scoring 3/4 (about 12 s left)"]
    unknown = _PlainTask(said.append, "Gauss-Newton", None)
    clock[0] += 12.0
    unknown.advance()
    assert said[-1] == "  Gauss-Newton 1"


def test_the_shell_completes_commands():
    for words, expected in (("awes ide", "identify"), ("awes export --su", "--surfaces")):
        env = {**os.environ, "_AWES_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(len(words.split()) - 1)}
        code = "import sys; sys.argv = ['awes']; from awescli.cli import main; main()"
        done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
        assert expected in done.stdout.split(), done.stderr
