"""The shell around every command: errors become messages and exit codes, signals become interruptions.

Exit codes: 0 done; 1 a fault of awes; 2 bad input; 3 a numerical failure; 130 interrupted.
"""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from awescli.cli.screen import Screen
from awescli.notation.errors import AwesError


@contextmanager
def shell(as_json: bool = False, quiet: bool = False) -> Iterator[Screen]:
    """A screen to print on; errors become messages and exit codes, signals become interruptions."""
    screen = Screen(as_json, quiet)
    code = 0
    before = _interruptible()
    try:
        yield screen
    except AwesError as e:
        code = e.exit_code
        screen.error(f"error: {e}")
    except KeyboardInterrupt:
        code = 130
        screen.error(screen.interrupted())
    except BrokenPipeError:  # `awes ... | head`: the reader has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as e:
        code = 2
        screen.error(f"error: {e.filename or 'file'}: {e.strerror or e}\n  Check paths, permissions and free space.")
    except (typer.Exit, typer.Abort):
        raise
    except Exception as e:
        if os.environ.get("AWES_DEBUG"):
            raise
        code = 1
        screen.error(f"error: {_last_place(e)}: {type(e).__name__}: {e}\n  This is a fault of awes. AWES_DEBUG=1 shows where it happened.")
    finally:
        screen.close()
        for number, handler in before.items():
            signal.signal(number, handler)
    if code:
        raise typer.Exit(code)


def _interruptible() -> dict[int, Any]:
    """SIGTERM stops a run as cleanly as Ctrl-C does. Returns signal -> its handler before; nothing outside the main thread."""

    def interrupt(number: int, frame: Any) -> None:
        raise KeyboardInterrupt

    before = {}
    for number in (signal.SIGTERM, signal.SIGINT):
        # what runs in the background of a shell is deaf to Ctrl-C, and stays so
        if number == signal.SIGTERM or signal.getsignal(number) is not signal.SIG_IGN:
            try:
                before[number] = signal.signal(number, interrupt)
            except ValueError:
                return {}
    return before


def _last_place(e: BaseException) -> str:
    """`identify.py:120`: the deepest frame of an unexpected error."""
    trace, place = e.__traceback__, "awes"
    while trace is not None:
        place = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"
        trace = trace.tb_next
    return place
