"""Opening what somebody else names: regular files only, so that a pipe cannot make awes wait and a device cannot fill its memory."""

import os
import stat
from pathlib import Path
from typing import BinaryIO

from awescli.notation.errors import BadInput

KINDS = {
    stat.S_IFIFO: "a named pipe", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device", stat.S_IFSOCK: "a socket", stat.S_IFDIR: "a folder",
}  # fmt: skip


def open_regular(path: Path, most: int | None = None) -> BinaryIO:
    """The file at `path`, open for reading. Links are followed: where a user keeps a file is the user's business.

    most: bytes beyond which it is refused unread. Raises BadInput for what is no regular file or too large, OSError for what cannot be
    opened.
    """
    _refuse(os.stat(path), path, most)  # before opening: opening a device may already move it
    # non-blocking, in case a pipe takes the file's place just now
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        _refuse(os.fstat(descriptor), path, most)
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def _refuse(found: os.stat_result, path: Path, most: int | None) -> None:
    if not stat.S_ISREG(found.st_mode):
        kind = KINDS.get(stat.S_IFMT(found.st_mode), "no regular file")
        do = "Name the file inside it." if stat.S_ISDIR(found.st_mode) else "Name the file itself."
        raise BadInput(f"this is {kind}, a file is needed", str(path), do)
    if most is not None and found.st_size > most:
        raise BadInput(f"{found.st_size / 1e6:.0f} MB are too much (limit {most / 1e6:.0f} MB)", str(path), "Is this the file you meant?")
