"""Floor 8: the command line, built from STAGES; the only room that prints or exits."""

from awescli.cli.app import build_app, main

__all__ = ["build_app", "main"]
