"""What somebody gets who installs awes instead of cloning it: the wheel, its metadata, its demo, on a system of another kind too."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest
from typer.testing import CliRunner

from awescli.artifacts import new_folder
from awescli.cli import build_app
from awescli.notation.errors import BadInput
from awescli.stages import STAGES
from awescli.stages.demonstration import FILES

ROOT = Path(__file__).parents[1]
BUILT_FROM = ("awescli", "data", "pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE", "stages.yaml")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """The wheel of a copy of the sources, so that nothing is left in the checkout; without a network."""
    source, to = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for name in BUILT_FROM:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, source / name)
    options = ("--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check", "--quiet", "--wheel-dir", str(to))
    done = subprocess.run([sys.executable, "-m", "pip", "wheel", *options, str(source)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return next(to.glob("awes-*.whl"))


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory) -> Path:
    """A folder that holds what the wheel holds, and nothing of the checkout."""
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


def python(words, installed, cwd, **env):
    """Python with the installed awes in front of every other."""
    return subprocess.run(
        [sys.executable, *words], cwd=cwd, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(installed), **env}
    )


@pytest.mark.slow
def test_the_demo_of_an_installed_wheel_is_checked(installed, tmp_path):
    where = python(["-c", "import awescli; print(awescli.__file__)"], installed, tmp_path)
    assert where.stdout.startswith(str(installed))
    made = python(["-m", "awescli", "demo", "my demo"], installed, tmp_path)
    assert made.returncode == 0 and "next: cd 'my demo'; awes check; awes run" in made.stdout, made.stderr
    folder = tmp_path / "my demo"
    assert sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()) == sorted(FILES)
    for name in FILES:
        assert (folder / name).read_bytes() == (ROOT / name).read_bytes()
    checked = python(["-m", "awescli", "check"], installed, folder)
    assert checked.returncode == 0 and "verdict: good" in checked.stdout, checked.stderr
    assert python(["-m", "awescli", "run", "--dry-run"], installed, folder).returncode == 0


@pytest.mark.slow
def test_a_wheel_holds_all_of_the_package_and_is_the_same_code(installed, tmp_path):
    """Also what is no Python; and a result of the checkout is not made again by the wheel."""
    package = {p.relative_to(ROOT) for p in (ROOT / "awescli").rglob("*") if p.is_file() and "__pycache__" not in p.parts}
    assert not [p for p in package if not (installed / p).is_file()]
    tell = "from awescli.stages.runner import code_hash; print(code_hash())"
    here, there = (python(["-c", tell], folder, tmp_path).stdout for folder in (ROOT, installed))
    assert here == there != ""


@pytest.mark.slow
def test_the_metadata_leave_room_for_other_builds_and_the_tests_do_not(installed):
    """A wheel that pins torch cannot be installed beside anything; what the tests ran with stands in constraints.txt."""
    metadata = Parser().parsestr(next(installed.glob("awes-*.dist-info/METADATA")).read_text())
    needs = metadata.get_all("Requires-Dist")
    assert not [n for n in needs if "==" in n.partition(";")[0]]
    torch = re.search(r"^torch==([\d.]+)$", (ROOT / "constraints.txt").read_text(), re.M)[1]
    low, high = re.search(r"torch<(\d+),>=([\d.]+)", " ".join(needs)).groups()[::-1]
    assert [int(n) for n in low.split(".")] <= [int(n) for n in torch.split(".")][:2] and int(torch.split(".")[0]) < int(high)
    pythons = {c.rpartition(" ")[2] for c in metadata.get_all("Classifier") if re.search(r"Python :: 3\.\d+$", c)}
    assert pythons == {"3.11", "3.12", "3.13"} and metadata["Requires-Python"] == ">=3.11"
    assert metadata.get_payload().startswith("# awes")


def test_constraints_name_everything_that_is_required():
    named = set(re.findall(r"^([\w.-]+)==", (ROOT / "constraints.txt").read_text(), re.M))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    required = {re.match(r"[\w-]+", need)[0] for need in project["dependencies"]}
    assert {n.lower() for n in required} <= {n.lower() for n in named}


def demo(*words):
    return CliRunner().invoke(build_app(STAGES), ["demo", *words])


def test_the_demo_of_a_checkout_is_the_same(tmp_path):
    assert demo(str(tmp_path / "new" / "demo")).exit_code == 0
    for name in FILES:
        assert (tmp_path / "new" / "demo" / name).read_bytes() == (ROOT / name).read_bytes()
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["demo"]


def test_the_demo_takes_an_empty_folder_and_no_other(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    assert demo("empty").exit_code == 0 and (tmp_path / "empty" / "stages.yaml").is_file()
    (tmp_path / "file").write_text("mine")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes").write_text("mine")
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    for name, what in (("empty", "holds files"), ("full", "holds files (notes)"), ("file", "no folder"), ("link", "no folder")):
        refused = demo(name)
        assert refused.exit_code == 2 and what in refused.stderr and "Name a new folder, or an empty one." in refused.stderr, refused.stderr
    assert [p.name for p in (tmp_path / "full").iterdir()] == ["notes"] and not (tmp_path / "elsewhere").exists()


@pytest.mark.parametrize("there", [True, False], ids=["empty", "new"])
def test_a_demo_that_cannot_be_written_leaves_nothing(tmp_path, there):
    """Here because its second file would need a folder where the first one is a file."""
    folder = tmp_path / "demo"
    if there:
        folder.mkdir()
    with pytest.raises(BadInput, match="cannot be written"):
        new_folder(folder, {"a": b"1", "a/b": b"2"})
    assert folder.exists() == there and not [p for p in tmp_path.rglob("*") if p != folder]


NO_LOCKS = "import sys; sys.modules['fcntl'] = None\nfrom awescli.cli import main\nmain()"
"""awes on a system without POSIX locks, as Windows is."""


@pytest.mark.slow
def test_without_posix_locks_awes_starts_and_says_where_it_runs(tmp_path):
    def awes(*words):
        return python(["-c", NO_LOCKS, *words], ROOT, tmp_path)

    assert awes("--help").returncode == 0 and awes("demo", "d").returncode == 0
    for words in (("check",), ("run", "--dry-run")):
        assert awes(*words, "--stages", "d/stages.yaml").returncode == 0
    refused = awes("identify", "--stages", "d/stages.yaml")
    assert refused.returncode == 2 and "WSL" in refused.stderr and "Traceback" not in refused.stderr
