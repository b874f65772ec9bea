"""Objects in the cache of compiled code that are damaged, or that somebody planted: in a process of its own each, since they may end it."""

import os
import stat
from collections.abc import Callable
from pathlib import Path

import numpy as np
from fuzz_kinds import Judged

from awescli.engine import object_cache
from awescli.engine.machine import LANES, compile_program, evaluate

HEAD = len(object_cache.MAGIC) + 32
Damage = Callable[[Path, bytes, bytes, np.random.Generator], None]


def _answer(factor: float) -> float:
    """factor + 1, by compiled code."""
    one = np.ones((1, LANES))
    return evaluate(compile_program(lambda x, u, c: [factor * x[0] + u[0]], 1, 1, 1, linearised=False), one, one, one)[0, 0]


def _content(change: Callable[[bytes, bytes, np.random.Generator], bytes]) -> Damage:
    return lambda place, good, other, rng: place.write_bytes(change(good, other, rng)) and None


def _flip(good: bytes, rng: np.random.Generator, bits: int) -> bytes:
    damaged = bytearray(good)
    for at, bit in zip(rng.choice(len(good), bits, replace=False), rng.integers(0, 8, bits), strict=True):
        damaged[at] ^= 1 << bit
    return bytes(damaged)


def _zeros(good: bytes, rng: np.random.Generator) -> bytes:
    """A block that never reached the disk."""
    at = int(rng.integers(len(good)))
    block = good[at : at + 512]
    return good[:at] + bytes(len(block)) + good[at + len(block) :] if any(block) else good[:-1]


def _planted(place: Path, other: bytes, mode: int = 0o600) -> None:
    """The code of another function with a digest that is right for it."""
    key = place.name.removesuffix(".o")
    place.write_bytes(object_cache.MAGIC + object_cache._digest(key, other[HEAD:]) + other[HEAD:])
    place.chmod(mode)


def _of_another_user(place: Path, good: bytes, other: bytes, rng: np.random.Generator) -> None:
    _planted(place, other)
    os.chown(place, 4711, 4711)


def _in_anothers_folder(place: Path, good: bytes, other: bytes, rng: np.random.Generator) -> None:
    _planted(place, other)
    os.chown(place.parent, 4711, 4711)


def _open_folder(place: Path, good: bytes, other: bytes, rng: np.random.Generator) -> None:
    _planted(place, other)
    place.parent.chmod(int(rng.choice([0o770, 0o702, 0o777, 0o1777])))


def _linked(place: Path, good: bytes, other: bytes, rng: np.random.Generator) -> None:
    elsewhere = place.parent.parent / "elsewhere.o"
    place.unlink()
    _planted(place, other)
    place.rename(elsewhere)
    place.symlink_to(elsewhere)


DAMAGES: dict[str, Damage] = {
    "empty": _content(lambda good, other, rng: b""),
    "cut off": _content(lambda good, other, rng: good[: rng.integers(1, len(good))]),
    "longer": _content(lambda good, other, rng: good + rng.bytes(int(rng.integers(1, 100)))),
    "one bit flipped": _content(lambda good, other, rng: _flip(good, rng, 1)),
    "many bits flipped": _content(lambda good, other, rng: _flip(good, rng, int(rng.integers(2, 200)))),
    "a block of zeros": _content(lambda good, other, rng: _zeros(good, rng)),
    "random bytes": _content(lambda good, other, rng: rng.bytes(int(rng.integers(1, 20_000)))),
    "the object of another function": _content(lambda good, other, rng: other),
    "as awes 0.1 left it": _content(lambda good, other, rng: other[HEAD:]),
    "planted, by another user": _of_another_user,
    "planted, in another user's folder": _in_anothers_folder,
    "planted, writable by others": lambda place, good, other, rng: _planted(place, other, int(rng.choice([0o602, 0o620, 0o666, 0o777]))),
    "planted, in a folder that others may write": _open_folder,
    "planted, behind a link": _linked,
}

KINDS = {kind: 100 if "flipped" in kind or kind == "cut off" else 65 for kind in DAMAGES}


def prepare(folder: Path):
    """A judge of a cache with one object that is wrong."""
    os.environ["AWES_CACHE"] = str(folder / "cache")
    objects = folder / "cache" / "objects"
    _answer(2.0)
    (place,) = objects.glob("*.o")
    good = place.read_bytes()
    _answer(3.0)
    other = next(p for p in objects.glob("*.o") if p != place).read_bytes()

    def judge(kind: str, rng: np.random.Generator) -> Judged:
        if "another user" in kind and os.geteuid() != 0:
            return Judged("refused", "not tried: only root can give files away")
        os.chown(objects, os.geteuid(), os.getegid())
        objects.chmod(0o700)
        for file in objects.iterdir():
            file.unlink()
        place.write_bytes(good)
        DAMAGES[kind](place, good, other, rng)
        status, said = _in_a_fork(lambda: str(_answer(2.0)))
        if status != 0:
            return Judged("fault", f"exit status {status} {said}")
        if said != "3.0":
            return Judged("unnoticed", f"answered {said} instead of 3.0")
        mended = stat.S_ISREG(place.lstat().st_mode) and place.read_bytes() == good
        return Judged("repaired" if mended else "refused", "compiled again")

    return judge


def _in_a_fork(work: Callable[[], str]) -> tuple[int, str]:
    """(exit code or minus the signal, what it said) of a process that begins where this one is."""
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        code = 70
        try:
            os.write(writing, work().encode())
            code = 0
        finally:
            os._exit(code)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        said = pipe.read()
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), said
