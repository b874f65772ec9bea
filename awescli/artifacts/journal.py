"""The log file of a folder of results: what awes said there, run after run, with the time of day."""

import os
import stat
from collections.abc import Iterable
from contextlib import suppress
from datetime import datetime
from pathlib import Path

from awescli.artifacts.folders import MARK, own_path

LOG = "awes.log"
"""In the folder that awes keeps for itself among the results."""
LONGEST = 2_000_000
"""Bytes from which a new file is begun; the one before is kept as awes.log.1."""


class Journal:
    """Lines for the log file of `out`; they wait until a run has made awes' own folder there. No line that cannot be written stops a run,
    for the results are what counts."""

    def __init__(self, out: Path):
        self.path = own_path(out, LOG)
        self._waiting: list[str] = []

    def write(self, lines: Iterable[str]) -> None:
        """Lines of text, as they were said."""
        now = datetime.now().astimezone().isoformat(timespec="seconds")
        self._waiting += [f"{now} [{os.getpid()}] {line}\n" for text in lines for line in text.splitlines()]
        # not before the folder is known as ours: a link or somebody's folder of that name is refused by `locked`
        if (self.path.parent / MARK).is_file() and not self.path.parent.is_symlink():
            with suppress(OSError):
                self._append("".join(self._waiting).encode(errors="backslashreplace"))
                self._waiting = []

    def _append(self, text: bytes) -> None:
        with suppress(FileNotFoundError):
            if self.path.lstat().st_size > LONGEST:
                os.replace(self.path, self.path.with_name(f"{LOG}.1"))
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
        descriptor = os.open(self.path, flags, 0o666)
        try:
            found = os.fstat(descriptor)
            if stat.S_ISREG(found.st_mode) and found.st_nlink == 1:  # a second name of somebody's file is not written to
                os.write(descriptor, text)
        finally:
            os.close(descriptor)
