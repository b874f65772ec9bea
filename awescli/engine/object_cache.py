"""Compiled code kept on disk for the next process: the one place where awes runs what it finds in a file, so nothing there is believed.

An object is used only if it lies in a folder of the user's own, is the user's own file, and still has the digest that was written with it
under the key that is asked for (the key holds source, processor and LLVM). Anything else is as if it were not there: compiling again
costs a second. The folder may be deleted at any time. Where the system has no owners of files, nothing is kept.
"""

import hashlib
import os
import re
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

MAGIC = b"awes object 2\n"
LARGEST = 64_000_000
"""Bytes of one object; a kite's largest has two million."""
MOST = 400_000_000
"""Bytes of all objects, beyond which those not used for longest go."""
OLDEST = 90 * 86400.0
"""s without use after which an object goes."""
ABANDONED = 3600.0
"""s after which a half-written file is of a process that has ended."""
_OBJECT = re.compile(r"[0-9a-f]{64}\.o\Z")
_HALF = re.compile(r"\.[0-9a-f]{64}\.o\.\d+\Z")


def folder() -> Path | None:
    """Where objects are kept: $AWES_CACHE or ~/.cache/awes, in both the folder `objects`. None where there is no home."""
    if chosen := os.environ.get("AWES_CACHE"):
        return Path(chosen).absolute() / "objects"
    try:
        home = Path.home()
    except RuntimeError:  # a user without a home, as in some containers
        return None
    return home / ".cache" / "awes" / "objects" if home.is_absolute() else None


def load(key: str) -> bytes | None:
    """The object that `store` kept under `key` (64 hexadecimal digits); None where there is none that may be used."""
    with _opened(make=False) as place:
        if place is None:
            return None
        try:
            file = os.open(f"{key}.o", os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=place)
        except OSError:
            return None
        with os.fdopen(file, "rb") as opened:
            if not _private(os.fstat(file), stat.S_ISREG) or os.fstat(file).st_size > LARGEST:
                return None
            try:
                content = opened.read(LARGEST + 1)
            except OSError:
                return None
            code = _checked(key, content)
            if code is not None:
                with suppress(OSError):
                    os.utime(file)  # in use: not the next to go
            return code


def store(key: str, code: bytes) -> None:
    """Keep an object under `key`, whole or not at all. A cache that cannot be written costs a second at the next start, nothing else."""
    if len(code) > LARGEST:
        return
    with _opened(make=True) as place:
        if place is None:
            return
        half = f".{key}.o.{os.getpid()}"
        try:
            with suppress(FileNotFoundError):
                os.unlink(half, dir_fd=place)
            file = os.open(half, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600, dir_fd=place)
            with os.fdopen(file, "wb") as opened:
                opened.write(MAGIC + _digest(key, code) + code)
                opened.flush()
                os.fsync(file)
            os.rename(half, f"{key}.o", src_dir_fd=place, dst_dir_fd=place)
            os.fsync(place)
            if key[0] == "0":  # one object of sixteen has the folder looked through, which may hold thousands
                _prune(place)
        except OSError:
            with suppress(OSError):
                os.unlink(half, dir_fd=place)


def why_unused() -> str:
    """Why nothing can be kept, in a sentence; empty where all is well, also where nothing was kept yet."""
    where = folder()
    if where is None or not hasattr(os, "geteuid"):
        return "there is no home folder" if where is None else "this system does not tell the owners of files"
    try:
        found = where.lstat()
    except FileNotFoundError:
        return ""
    except OSError as e:
        return f"{where} cannot be looked at ({e.strerror})"
    if not stat.S_ISDIR(found.st_mode):
        return f"{where} is no folder"
    return "" if _private(found, stat.S_ISDIR) else f"{where} is not yours alone: chown it to you, or chmod go-w"


@contextmanager
def _opened(make: bool) -> Iterator[int | None]:
    """A descriptor of the folder, held open so that nobody puts another in its place; None where it is not to be used."""
    where, place = folder(), None
    if where is not None and hasattr(os, "geteuid"):
        try:
            if make:
                where.parent.mkdir(parents=True, exist_ok=True)
                with suppress(FileExistsError):
                    where.mkdir(mode=0o700)
            place = os.open(where, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        except OSError:
            place = None
    try:
        yield place if place is not None and _private(os.fstat(place), stat.S_ISDIR) else None
    finally:
        if place is not None:
            os.close(place)


def _private(found: os.stat_result, kind: Callable[[int], bool]) -> bool:
    """Of the asked kind, the user's own, and written by nobody else."""
    return kind(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _digest(key: str, code: bytes) -> bytes:
    """Of an object and what it is the object of: one under another's name is as wrong as a damaged one."""
    return hashlib.sha256(key.encode() + b"\0" + code).digest()


def _checked(key: str, content: bytes) -> bytes | None:
    """The object in a file's content; None where it is not what was stored under `key`."""
    begin = len(MAGIC) + hashlib.sha256().digest_size
    code = content[begin:]
    return code if content[:begin] == MAGIC + _digest(key, code) and code else None


def _prune(place: int) -> None:
    """Remove files of ours that nobody has used for long, then the oldest of too many, and what killed processes left half-written."""
    now, kept = time.time(), []
    for entry in os.scandir(place):
        ours, half = _OBJECT.match(entry.name), _HALF.match(entry.name)
        if not (ours or half):
            continue
        with suppress(FileNotFoundError):
            found = entry.stat(follow_symlinks=False)
            if now - found.st_mtime > (OLDEST if ours else ABANDONED):
                os.unlink(entry.name, dir_fd=place)
            elif ours:
                kept.append((found.st_mtime, entry.name, found.st_size))
    total = sum(size for *_, size in kept)
    for _, name, size in sorted(kept):
        if total <= MOST:
            return
        with suppress(FileNotFoundError):
            os.unlink(name, dir_fd=place)
        total -= size
