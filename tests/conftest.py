"""What many tests share: the development kite, a short noise-free flight of it, and a small run of all stages."""

# first, before anything imports numpy: it gives BLAS one thread, and fits are four times faster for it
import awescli  # noqa: F401, I001
import fcntl
import os
from pathlib import Path

import pytest
from kites import DEVELOPMENT, flight
from small_run import make_small_run
from typer.testing import CliRunner

from awescli.cli import build_app
from awescli.physics.kite import Kite
from awescli.stages import STAGES


@pytest.fixture(scope="session")
def development():
    """The declaration of the development kite."""
    return DEVELOPMENT


@pytest.fixture(scope="session")
def calm():
    """40 s of loops without noise and without anything undeclared."""
    return flight()


@pytest.fixture(scope="session")
def kite(calm):
    """The development kite in the wind record of `calm`."""
    return Kite(DEVELOPMENT, calm.log.wind.height)


@pytest.fixture(scope="session")
def small_run(tmp_path_factory) -> Path:
    """The folder in which `awes run` has made a small run of all stages, once for all workers; printed.txt is what it said, in 80 columns.
    Whoever changes something there works in a copy."""
    base = tmp_path_factory.getbasetemp()
    base = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder, printed = base / "small_run", base / "small_run" / "printed.txt"
    with open(base / "small_run.lock", "w") as lock, pytest.MonkeyPatch.context() as patch:
        fcntl.flock(lock, fcntl.LOCK_EX)  # a second worker waits for the first
        if not printed.is_file():
            make_small_run(folder)
            patch.chdir(folder)
            result = CliRunner().invoke(build_app(STAGES), ["run"], env={"COLUMNS": "80"})
            assert result.exit_code == 0, result.stderr
            printed.write_text(result.stdout)
    return folder
