"""Somebody who has a log, a kite file and docs/tutorial.md types what stands there, command by command, and nothing else; each command is
also one that awes has just printed as the next.

The log is the bundled flight as a stranger's logger would have written it: knots, feet, degrees and pounds, east before north, altitude up,
25 Hz, no airspeed, the weather in a file of its own. Its truth: the rudder follows its set-point with 0.2 s of lag.
"""

import re
import shlex
from pathlib import Path

import pytest
from flightlog.foreign import knots_and_feet
from test_documentation import command_blocks
from typer.testing import CliRunner

from awescli.cli import build_app
from awescli.flightlog.read import read_flight
from awescli.stages import STAGES

ROOT = Path(__file__).parents[1]
KITE = ROOT / "data" / "kites" / "km1_initial.yaml"
TUTORIAL = ROOT / "docs" / "tutorial.md"
TAU = 0.2


class Newcomer:
    """Types commands, keeps what was printed, and does what it says: commands after `next:`, lines of files that are to be completed."""

    def __init__(self, folder: Path, monkeypatch):
        self.folder, self.monkeypatch, self.printed = folder, monkeypatch, ""
        monkeypatch.chdir(folder)
        monkeypatch.setenv("COLUMNS", "80")

    def types(self, command: str) -> str:
        """One command; it must end well."""
        program, *words = shlex.split(command)
        if program == "cd":
            self.folder = self.folder / words[0]
            self.monkeypatch.chdir(self.folder)
            return ""
        assert program == "awes", command
        result = CliRunner().invoke(build_app(STAGES), words)
        assert result.exit_code == 0, f"{command}\n{result.stdout}\n{result.stderr}"
        self.printed = result.stdout
        return result.stdout

    def follows(self) -> list[str]:
        """The commands that the last print says come next."""
        return re.findall(r"(?:^|[;,:] )((?:awes|cd) [\w./-]+)", re.search(r"next: (.*)", self.printed)[1])

    def completes(self, unit: str) -> None:
        """Finish every line of flight.yaml that init says it could not map, as the tutorial says: the unit, and the # away."""
        says = " ".join(TUTORIAL.read_text().split())
        for name, column in re.findall(r"^  (\w+), column (\w+): ", self.printed, re.M):
            assert f"`# {name}: {{column: {column}, unit: ...}}`, write the unit in place of the three dots, and take the `#` away" in says
            file = self.folder / "my_flight" / "flight.yaml"
            old = f"  # {name}: {{column: {column}, unit: ...}}"
            assert old in file.read_text()
            file.write_text(file.read_text().replace(old, f"  {name}: {{column: {column}, unit: {unit}}}"))


def quoted_is_printed(stage: str, printed: str) -> None:
    """The lines that the tutorial quotes of a stage's answer are what it prints: the same words, and numbers within 3 %."""
    (quoted,) = re.findall(rf"^```text\n({stage}: .*?)^```$", TUTORIAL.read_text(), re.M | re.S)
    number = r"(?<![\w.])-?\d+(?:\.\d+)?"
    for line in quoted.splitlines():
        said = re.search(re.escape(re.sub(number, "NUMBER", line)).replace("NUMBER", r"(-?\d+(?:\.\d+)?)"), printed)
        assert said, f"{line}\nis not in\n{printed}"
        assert list(map(float, said.groups())) == pytest.approx([float(n) for n in re.findall(number, line)], rel=0.03)


@pytest.fixture(scope="module")
def demo():
    return read_flight(ROOT / "data" / "km1_demo")


@pytest.mark.slow
@pytest.mark.parametrize("says_the_unit_of_the_load", [pytest.param(True, marks=pytest.mark.campaign), False])
def test_the_tutorial_takes_an_unknown_log_to_a_right_verdict(demo, tmp_path, monkeypatch, says_the_unit_of_the_load):
    log = knots_and_feet(demo, tmp_path / "logs", every=2)
    if not says_the_unit_of_the_load:
        log.write_text(log.read_text().replace("load_lbf", "load", 1))
    mine = {"LOG.csv": str(log), "KITE.yaml": str(KITE)}
    typed = (shlex.join(mine.get(word, word) for word in words) for block in command_blocks(TUTORIAL) for words in block)
    me = Newcomer(tmp_path, monkeypatch)
    me.types(next(typed))
    assert "columns found" in me.printed and ("no unit in its name" in me.printed) == (not says_the_unit_of_the_load)
    me.completes("lbf")
    change, check = next(typed), next(typed)
    assert me.follows() == [change, check]
    me.types(change)
    me.types(check)
    assert "at 25 Hz" in me.printed and "verdict: good" in me.printed and "missing for a model" not in me.printed
    assert re.search(r"tension +N +30\d\d", me.printed) and not re.search(r"^  V_a ", me.printed, re.M)
    steps, identify = me.follows(), next(typed)
    assert steps[0] == "awes run" and identify in steps
    if says_the_unit_of_the_load:
        return  # the same flight from here on
    me.types(identify)
    quoted_is_printed("identify", me.printed)
    assert re.search(r"identify: converged: \d+ parameters", me.printed)
    trace = next(typed)
    assert me.follows() == [trace]
    me.types(trace)
    quoted_is_printed("trace-residual", me.printed)
    found = re.search(r"found: actuator_lag on rudder, tau ([\d.]+) s \[([\d.]+), ([\d.]+)\]", " ".join(me.printed.split()))
    assert found, me.printed
    value, low, high = map(float, found.groups())
    assert low < TAU < high and abs(value - TAU) < 0.03
    before, after, noise = map(float, re.search(r"ahead: ([\d.]+) -> ([\d.]+) \(noise alone ([\d.]+)\)", me.printed).groups())
    assert after < 0.6 * before and after < 1.4 * noise
    report = next(typed)
    assert f"report: {report}" in me.printed
    me.types(report)
    assert "The model lacked actuator lag (rudder)" in (me.folder / "out" / "evaluate" / "report.html").read_text()
    assert next(typed, None) is None


def test_the_tutorial_works_on_the_bundled_flight_too(tmp_path, monkeypatch):
    """`awes demo` writes what the tutorial says it does, and `awes init` takes that for LOG.csv and KITE.yaml."""
    says = " ".join(TUTORIAL.read_text().split())
    real = {name: re.search(rf"`{re.escape(name)}` is `([^`]+)`", says)[1] for name in ("LOG.csv", "KITE.yaml")}
    me = Newcomer(tmp_path, monkeypatch)
    me.types(re.search(r"No log at hand\? `(awes demo [^`]+)`", says)[1])
    init, change, check, *_ = (words for block in command_blocks(TUTORIAL) for words in block)
    for words in (init, change, check):
        me.types(shlex.join(real.get(word, word) for word in words))
    assert "verdict: good" in me.printed
