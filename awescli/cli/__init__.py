"""Floor 8: the command line, built from STAGES; the only room that prints or exits."""

import sys


def main() -> None:
    """Entry point of the `awes` command. Ctrl-C while modules still load ends it as quietly as Ctrl-C later."""
    try:
        from awescli.cli.app import main as run
    except KeyboardInterrupt:
        sys.exit(130)
    run()


def build_app(stages):
    """The `awes` application with one command for every stage (a `typer.Typer`)."""
    from awescli.cli.app import build_app as build

    return build(stages)


__all__ = ["build_app", "main"]
