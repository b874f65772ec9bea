"""The shell around every command: errors become messages and exit codes, signals become interruptions.

Exit codes: 0 done; 1 a fault of awes; 2 bad input; 3 a numerical failure; 130 interrupted.
"""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

import typer

from awescli.cli.screen import Screen
from awescli.notation.errors import AwesError

LATER = 0.02
"""[s] until an interruption is tried again."""
LOADING = ("<frozen importlib._bootstrap>", "numpy/lib/_version.py")
"""Ends of the names of files that run while a compiled module loads, or asks numpy for its version: what is raised in there it turns into
an error of its own (pyo3: a panic on the terminal)."""


@contextmanager
def shell(as_json: bool = False, quiet: bool = False) -> Iterator[Screen]:
    """A screen to print on; errors become messages and exit codes, signals become interruptions."""
    screen = Screen(as_json, quiet)
    code = 0
    interruption = _Interruption()
    interruption.begin()
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
        code = 130 if interruption.raised else 1
        fault = f"error: {_last_place(e)}: {type(e).__name__}: {e}\n  This is a fault of awes. AWES_DEBUG=1 shows where it happened."
        # compiled code hands an interruption on as an error of its own
        screen.error(screen.interrupted() if interruption.raised else fault)
    finally:
        screen.close()
        interruption.end()
    if code:
        raise typer.Exit(code)


@dataclass
class _Interruption:
    """SIGTERM stops a run as cleanly as Ctrl-C does: both become a KeyboardInterrupt, as soon as nothing is loading.

    before: signal -> its handler before `begin`; nothing outside the main thread. raised: whether an interruption was.
    """

    before: dict[int, Any] = field(default_factory=dict)
    raised: bool = False

    def begin(self) -> None:
        for number in (signal.SIGTERM, signal.SIGINT):
            # what runs in the background of a shell is deaf to Ctrl-C, and stays so
            if number == signal.SIGTERM or signal.getsignal(number) is not signal.SIG_IGN:
                try:
                    self.before[number] = signal.signal(number, self._interrupt)
                except ValueError:
                    return

    def end(self) -> None:
        if signal.SIGALRM in self.before:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in self.before.items():
            signal.signal(number, handler)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        if _loading(frame):
            self.before.setdefault(signal.SIGALRM, signal.signal(signal.SIGALRM, self._interrupt))
            signal.setitimer(signal.ITIMER_REAL, LATER)
            return
        self.raised = True
        raise KeyboardInterrupt


def _loading(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.endswith(LOADING):
            return True
        frame = frame.f_back
    return False


def _last_place(e: BaseException) -> str:
    """`identify.py:120`: the deepest frame of an unexpected error."""
    trace, place = e.__traceback__, "awes"
    while trace is not None:
        place = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"
        trace = trace.tb_next
    return place
