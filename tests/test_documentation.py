"""Every command and YAML snippet of the documentation works as it stands there.

Blocks of commands run in the order of their page, in one folder, on a small flight with small settings. A run of somebody else's flight is
decided but not computed (`--dry-run`). Commands inside sentences and tables must name commands, options and settings that exist.
"""

import re
import shlex
import subprocess
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import pytest
from flightlog.foreign import knots_and_feet
from flightlog.synthetic import SHARED
from small_run import PLAN, make_small_run
from typer.main import get_command
from typer.testing import CliRunner

from awescli.cli import build_app
from awescli.flightlog.flight_check import read_flight_file
from awescli.flightlog.read import read_flight
from awescli.notation.document import open_document
from awescli.notation.yaml_text import parse_yaml
from awescli.physics.declaration import read_kite
from awescli.stages import STAGES
from awescli.stages.plan import plan_model, read_plan

ROOT = Path(__file__).parent.parent
TUTORIAL = ROOT / "docs" / "tutorial.md"
"""Run as a whole, on a whole flight, by tests/test_newcomer.py."""
PAGES = sorted(p for p in ROOT.rglob("*.md") if not any(part.startswith(".") or part == "results" for part in p.relative_to(ROOT).parts))
APP = build_app(STAGES)
COMMANDS = get_command(APP).commands
PROGRAMS = ("awes", "make", "python")
AP2, THOR, DEV = (SHARED / "flights" / name for name in ("ampyx-ap2", "umn-thor", "dev/d01"))
MEASURED = "FOLDER_WITH_THE_MAT"
SETTINGS = [f"{stage}.{key}={value}" for stage, values in parse_yaml(PLAN, "").data["stages"].items() for key, value in values.items()]
SMALL = [word for setting in SETTINGS for word in ("--set", setting)]


def blocks(page: Path, kind: str = "") -> list[str]:
    """The fenced blocks of a page, of one language (a regular expression)."""
    return [text for of, text in re.findall(r"^```(\w*)\n(.*?)^```$", page.read_text(), re.M | re.S) if re.fullmatch(kind, of)]


def command_blocks(page: Path) -> list[list[list[str]]]:
    """Blocks of commands, each a list of commands, each a list of words."""
    found = [[shlex.split(line, comments=True) for line in block.splitlines() if line.strip()] for block in _shell_blocks(page)]
    return [block for block in found if block]


def _shell_blocks(page: Path) -> list[str]:
    return [b for kind in ("", "sh", "bash", "shell") for b in blocks(page, kind) if b.split() and b.split()[0] in (*PROGRAMS, "cd", "pip")]


def inline_commands(page: Path) -> list[list[str]]:
    """Commands inside sentences and tables."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S)
    return [shlex.split(code) for code in re.findall(r"`((?:awes|make|python) [^`\n]+)`", text)]


def named(pages, extract):
    return [pytest.param(page, id=str(page.relative_to(ROOT))) for page in pages if extract(page)]


@dataclass
class Reader:
    """Somebody who types what a page says, in a folder that has what the page's capital words stand for."""

    folder: Path

    def words(self, command: list[str]) -> list[str]:
        real = {
            "LOG_FOLDER": self.folder / "flight", "KITE.yaml": self.folder / "kite.yaml", "OUT": self.folder / "OUT",
            "FLIGHT/nominal.yaml": DEV / "nominal.yaml", "FLIGHT": DEV, "RUN_A": self.folder / "out", "RUN_B": self.folder / "out",
            "LOG.csv": self.folder / "unknown" / "LOG.csv", "LONG": self.folder / "flight",
            "DATA/flight": self.folder / "flight", "DATA/kite.yaml": self.folder / "kite.yaml",
            "DIR": self.folder / "figures", "RUN": self.folder / "out", "NAME": "flight",
        }  # fmt: skip
        name = r"(^|=)([A-Z_]+(?:/nominal\.yaml|/kite\.yaml|/flight|\.yaml|\.csv)?)$"
        return [re.sub(name, lambda m: m[1] + str(real.get(m[2], m[2])), w) for w in command]

    def types(self, command: list[str], monkeypatch) -> None:
        program, *rest = self.words(command)
        if program == "cd":
            self.folder = self.folder / rest[0]
            monkeypatch.chdir(self.folder)
        elif program == "make":
            done = subprocess.run(["make", "-n", *rest], cwd=ROOT, capture_output=True, text=True)
            assert done.returncode == 0, done.stderr
        elif program == "python":
            _exists(rest)
        else:
            assert program == "awes"
            self._awes(rest)

    def _awes(self, words: list[str]) -> None:
        name = words[0]
        if "--stages" in words:  # somebody else's plan and flight
            plan = words.index("--stages") + 1
            flight = THOR if "umn_thor" in words[plan] else AP2
            if not flight.is_dir():
                pytest.skip("the measured flight is not here")
            words = [word.replace(MEASURED, str(flight)) for word in [*words[:plan], str(ROOT / words[plan]), *words[plan + 1 :]]]
            words += [] if name == "check" else ["--dry-run"]
        elif name in ("run", "check", *(s.name for s in STAGES)):
            words = [name, *SMALL, *words[1:]]
        result = CliRunner().invoke(APP, words)
        assert result.exit_code == 0, f"awes {shlex.join(words)}\n{result.output}"


def _exists(words: list[str]) -> None:
    """A script that is there, with options that it knows. What it computes takes minutes: each has its own test or result."""
    if words[0] == "-m":
        assert find_spec(f"{words[1]}.__main__"), words
        return
    script = ROOT / words[0]
    assert script.is_file(), words
    known = script.read_text() + ("".join(p.read_text() for p in (ROOT / "benchmarks").glob("campaign*.py")))
    for option in (w.partition("=")[0] for w in words[1:] if w.startswith("--")):
        assert f'"{option}"' in known, f"{words[0]} has no option {option}"


def settings_of(words: list[str]) -> dict[str, str]:
    """The KEY=VALUE of all --set."""
    return {w.partition("=")[0]: w.partition("=")[2] for before, w in zip(words, words[1:], strict=False) if before == "--set"}


@pytest.mark.slow
@pytest.mark.parametrize("page", named([p for p in PAGES if p != TUTORIAL], command_blocks))
def test_blocks_of_commands_run_in_their_order(page, tmp_path, monkeypatch):
    make_small_run(tmp_path)
    knots_and_feet(read_flight(tmp_path / "flight"), tmp_path / "unknown").rename(tmp_path / "unknown" / "LOG.csv")
    if any("flights" in parse_yaml(text, "").data for text in blocks(page, "ya?ml")):  # the page's plan is of many flights
        plan = tmp_path / "stages.yaml"
        plan.write_text(plan.read_text().replace("flight: flight", "flights: [flight]"))
    if page.parent.name != "how_to":  # whoever asks how to do one thing has a plan
        (tmp_path / "stages.yaml").unlink()
    monkeypatch.chdir(tmp_path)
    reader = Reader(tmp_path)
    for block in command_blocks(page):
        for command in block:
            reader.types(command, monkeypatch)


@pytest.mark.parametrize("page", named(PAGES, inline_commands))
def test_commands_in_sentences_exist(page):
    for program, *words in inline_commands(page):
        if program == "make":
            assert subprocess.run(["make", "-n", *words], cwd=ROOT, capture_output=True).returncode == 0, words
        elif program == "python":
            _exists(words)
        else:
            assert words[0] in COMMANDS, f"there is no command awes {words[0]}"
            options = {o for p in COMMANDS[words[0]].params for o in p.opts}
            assert not [w for w in words[1:] if w.startswith("--") and w.partition("=")[0] not in options], words


@pytest.mark.parametrize("page", [pytest.param(p, id=str(p.relative_to(ROOT))) for p in PAGES])
def test_settings_in_sentences_exist(page, tmp_path):
    """`--set KEY=VALUE` anywhere in a page is a setting of the plan."""
    plan = make_small_run(tmp_path)
    for text in re.findall(r"--set ('[^']+'|[\w.:{}\[\],-]+=[^\s`;,)]+)", page.read_text()):
        key, _, value = shlex.split(text)[0].partition("=")
        if not re.fullmatch(r"[A-Z_]+", value) and key != "KEY":
            open_document(plan, omit=("stages",)).with_overrides({key: value}, plan_model(STAGES)).check(plan_model(STAGES))


@pytest.mark.parametrize("page", named(PAGES, lambda p: blocks(p, "ya?ml")))
def test_yaml_snippets_are_valid(page, tmp_path):
    plan = make_small_run(tmp_path)
    for snippet in blocks(page, "ya?ml"):
        keys = set(parse_yaml(snippet, str(page)).data)
        if keys & {"format", "signals", "units"}:
            read_flight_file(page, text=snippet)
        elif keys & {"aerodynamics", "parameters"}:
            (tmp_path / "snippet.yaml").write_text(snippet)
            read_kite(tmp_path / "snippet.yaml")
        else:  # a plan, or some settings of one
            whole = snippet if "stages" in keys else "stages:\n" + re.sub("^", "  ", snippet, flags=re.M)
            head = "".join(f"{key}: {path}\n" for key, path in (("flight", "flight"), ("kite", "kite.yaml")) if key not in keys)
            plan.write_text(head + whole)
            open_document(plan).check(plan_model(STAGES))


@pytest.mark.parametrize("file", sorted([ROOT / "stages.yaml", *ROOT.glob("examples/*/stages.yaml")]), ids=lambda f: f.parent.name)
def test_plans_of_the_examples_are_valid(file, tmp_path):
    small = make_small_run(tmp_path).parent
    plan = read_plan(file, STAGES, {"flight": str(small / "flight"), "kite": str(small / "kite.yaml")})
    assert plan.planned


@pytest.mark.parametrize("file", sorted([*ROOT.glob("data/kites/*.yaml"), *ROOT.glob("examples/*/kite.yaml")]), ids=lambda f: f.stem)
def test_kite_files_are_valid(file):
    assert read_kite(file).parameters


def test_the_speed_table_names_the_faster_way_of_every_peer():
    """Guards a figure against the slowest way alone: scipy's many solutions in one call stand beside one call each, with the numbers of the
    whole table."""
    whole = (ROOT / "benchmarks" / "results" / "engine_speed.md").read_text()
    shown = dict(re.findall(r"^\| Jacobian, times (scipy[^|]*) \| \*\*([^*]+)\*\*", (ROOT / "README.md").read_text(), re.M))
    told = dict(re.findall(r"^\| (scipy[^|]*) \|[^|]*\| \*\*([^*]+)\*\*", whole, re.M))
    assert shown == told and any("in one solve_ivp" in who for who in shown)


def test_the_flights_of_the_readme_are_those_that_were_flown():
    """Guards a sum that nobody added up again when a set was flown, and a set whose flights do not add up: the README's rows are the sums
    of the sections of the same name."""
    whole = (ROOT / "benchmarks" / "blind_flights.md").read_text()
    flown = {}
    for section in re.split(r"^## ", whole, flags=re.M)[1:]:
        rows = [[int(n) for n in row] for row in re.findall(r"^\| [^|]+ \| [^|]* \|" + r" (\d+) \|" * 5, section, re.M)]
        assert len(rows) == len(re.findall(r"^\| ", section, re.M)) - 1 and all(n == sum(answers) for n, *answers in rows), section
        flown[section.splitlines()[0]] = [sum(column) for column in zip(*rows, strict=True)]
    shown = re.findall(r"^\| ((?:Ours|JSBSim): [^|]+) \|" + r" (\d+) \|" * 5, (ROOT / "README.md").read_text(), re.M)
    assert {name: [int(n) for n in row] for name, *row in shown} == flown
