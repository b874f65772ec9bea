"""Floor 8: the command line, built from STAGES; the only room that prints or exits."""

import signal
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import typer

    from awescli.stages.base import Stage


def main() -> None:
    """Entry point of the `awes` command. Ctrl-C while modules still load, or commands are built, ends it as quietly as Ctrl-C later: from
    there on `shell` handles it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)
    from awescli.cli.app import main as run

    run()


def _leave(number: int, frame: object) -> None:
    sys.exit(130)


def build_app(stages: "Sequence[Stage]") -> "typer.Typer":
    """The `awes` application with one command for every stage (a `typer.Typer`)."""
    from awescli.cli.app import build_app as build

    return build(tuple(stages))


__all__ = ["build_app", "main"]
