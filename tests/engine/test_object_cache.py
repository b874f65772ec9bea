"""Compiled code on disk is never believed: whatever is wrong with it, the answer is that of the source, and the object is made again."""

import os
import subprocess
import sys
import time

import numpy as np
import pytest

from awescli.engine import object_cache

PROGRAM = """
import sys
import numpy as np
from awescli.engine.machine import LANES, compile_program, evaluate
one = np.ones((1, LANES))
factor = float(sys.argv[1])
print(evaluate(compile_program(lambda x, u, c: [factor * x[0] + u[0]], 1, 1, 1, linearised=False), one, one, one)[0, 0])
"""


def run(cache, factor: float) -> str:
    """What a process of its own computes (it may crash): factor + 1."""
    environment = {**os.environ, "AWES_CACHE": str(cache)}
    done = subprocess.run([sys.executable, "-c", PROGRAM, str(factor)], env=environment, capture_output=True, text=True)
    return done.stdout.strip() or f"exit code {done.returncode}: {done.stderr[-300:]}"


def objects(cache):
    return sorted((cache / "objects").glob("*.o"))


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """(content of the object of 2 x + u, its name, content of the object of 3 x + u)."""
    cache = tmp_path_factory.mktemp("cache")
    assert run(cache, 2.0) == "3.0"
    (two,) = objects(cache)
    content = two.read_bytes()
    assert run(cache, 3.0) == "4.0"
    (three,) = (p for p in objects(cache) if p != two)
    return content, two.name, three.read_bytes()


HEAD = len(object_cache.MAGIC) + 32


def flipped(content: bytes, at: int) -> bytes:
    return content[:at] + bytes([content[at] ^ 4]) + content[at + 1 :]


DAMAGE = {
    "empty": lambda two, three: b"",
    "only the head": lambda two, three: two[:HEAD],
    "truncated": lambda two, three: two[: len(two) // 2],
    "one byte short": lambda two, three: two[:-1],
    "longer": lambda two, three: two + b"\0",
    "a flipped bit in the code": lambda two, three: flipped(two, HEAD + (len(two) - HEAD) // 2),
    "a flipped bit in the digest": lambda two, three: flipped(two, len(object_cache.MAGIC) + 3),
    "the object of another function": lambda two, three: three,
    "the code of another function under this head": lambda two, three: two[:HEAD] + three[HEAD:],
    "an object as awes 0.1 left it, of another function": lambda two, three: three[HEAD:],
    "text": lambda two, three: b"#!/bin/sh\n",
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_or_planted_object_is_compiled_again(tmp_path, filled, damage):
    """The empty one used to end every process with a segmentation fault, for ever; the planted one to run."""
    two, name, three = filled
    (tmp_path / "objects").mkdir(mode=0o700)
    place = tmp_path / "objects" / name
    place.write_bytes(DAMAGE[damage](two, three))
    assert run(tmp_path, 2.0) == "3.0"
    assert place.read_bytes() == two  # mended: the next process finds it


def planted(place, two, three):
    """The wrong function with a digest that is right for it: only its owner and its rights tell."""
    key = place.name.removesuffix(".o")
    place.write_bytes(object_cache.MAGIC + object_cache._digest(key, three[HEAD:]) + three[HEAD:])


def test_the_planted_object_would_run_if_it_were_the_users_own(tmp_path, filled):
    """That the next test can fail."""
    two, name, three = filled
    (tmp_path / "objects").mkdir(mode=0o700)
    planted(tmp_path / "objects" / name, two, three)
    (tmp_path / "objects" / name).chmod(0o600)
    assert run(tmp_path, 2.0) == "4.0"


RIGHTS = [
    "object of another user", "object that all may write", "folder of another user", "folder that the group may write",
    "linked object", "linked folder", "pipe",
]  # fmt: skip


@pytest.mark.parametrize("right", RIGHTS)
def test_what_is_not_the_users_alone_is_not_used(tmp_path, filled, right):
    two, name, three = filled
    folder = tmp_path / "objects"
    folder.mkdir(mode=0o700)
    place = folder / name
    planted(place, two, three)
    place.chmod(0o600)
    if "another user" in right:
        if os.geteuid() != 0:
            pytest.skip("only root can give files away")
        os.chown(place if right.startswith("object") else folder, 4711, 4711)
    elif right == "object that all may write":
        place.chmod(0o602)
    elif right == "folder that the group may write":
        folder.chmod(0o770)
    elif right == "linked object":
        place.rename(tmp_path / "elsewhere.o")
        place.symlink_to(tmp_path / "elsewhere.o")
    elif right == "linked folder":
        folder.rename(tmp_path / "elsewhere")
        folder.symlink_to(tmp_path / "elsewhere")
    else:
        place.unlink()
        os.mkfifo(place)
    assert run(tmp_path, 2.0) == "3.0"


KEY = "0123456789abcdef" * 4


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("AWES_CACHE", str(tmp_path))
    return tmp_path


def test_no_flipped_bit_and_no_length_passes(cache):
    """A thousand of each on the reader itself; only what was stored comes back."""
    random = np.random.default_rng(0)
    code = random.bytes(5000)
    object_cache.store(KEY, code)
    (place,) = objects(cache)
    whole = place.read_bytes()
    assert object_cache.load(KEY) == code and place.stat().st_mode & 0o777 == 0o600
    for at, bit in zip(random.integers(0, len(whole), 1000), random.integers(0, 8, 1000), strict=True):
        place.write_bytes(whole[:at] + bytes([whole[at] ^ 1 << bit]) + whole[at + 1 :])
        assert object_cache.load(KEY) is None
    for length in random.integers(0, len(whole), 1000):
        place.write_bytes(whole[:length])
        assert object_cache.load(KEY) is None
    place.write_bytes(whole)
    assert object_cache.load(KEY) == code and object_cache.load(KEY[::-1]) is None


def test_another_machine_and_another_llvm_have_objects_of_their_own(cache, monkeypatch):
    """The key holds processor, features, system and LLVM's version, and the digest holds the key."""
    from awescli.engine import machine

    made = machine._made_for()
    for name, value in (("get_host_cpu_name", "i386"), ("get_default_triple", "arm-none-eabi"), ("llvm_version_info", (1, 0, 0))):
        with monkeypatch.context() as other:
            other.setattr(machine.llvm, name, (lambda v: lambda: v)(value) if callable(getattr(machine.llvm, name)) else value)
            assert machine._made_for() != made
    features = machine.llvm.get_host_cpu_features()
    features["avx2"] = not features.get("avx2", False)
    monkeypatch.setattr(machine.llvm, "get_host_cpu_features", lambda: features)
    assert machine._made_for() != made


def test_an_object_is_durable_before_it_has_its_name(cache, monkeypatch):
    """A power cut after the rename must not leave an empty object: written, synced, renamed, folder synced."""
    order = []
    for name in ("fsync", "rename"):
        kept = getattr(os, name)
        monkeypatch.setattr(os, name, lambda *a, name=name, kept=kept, **k: (order.append(name), kept(*a, **k))[1])
    object_cache.store(KEY, b"code")
    assert order == ["fsync", "rename", "fsync"]


def test_a_full_disk_costs_nothing_but_time(cache, monkeypatch):
    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    object_cache.store(KEY, b"code")
    assert os.listdir(cache / "objects") == [] and object_cache.load(KEY) is None


def test_what_nobody_uses_goes_and_nothing_else(cache, monkeypatch):
    folder = cache / "objects"
    object_cache.store("a" * 64, b"x" * 1000)
    old = time.time() - 2 * object_cache.OLDEST
    for name in ("b" * 64 + ".o", "." + "c" * 64 + ".o.17", "mine.txt", "d" * 64):
        (folder / name).write_bytes(b"x")
        os.utime(folder / name, (old, old))
    first, second = "0" + "e" * 63, "0" + "f" * 63
    object_cache.store(first, b"x" * 1000)
    assert sorted(os.listdir(folder)) == [first + ".o", "a" * 64 + ".o", "d" * 64, "mine.txt"]
    monkeypatch.setattr(object_cache, "MOST", 2500)
    os.utime(folder / f"{first}.o", (time.time() - 100,) * 2)
    assert object_cache.load("a" * 64)  # used last
    object_cache.store(second, b"x" * 1000)
    assert sorted(p.stem for p in objects(cache)) == [second, "a" * 64] and (folder / "mine.txt").exists()


def test_a_folder_of_thousands_is_looked_through_now_and_then(cache, monkeypatch):
    """Guards a first trace: for each of its 48 objects a folder of 7000 was looked through, 0.16 s a time."""
    looked = []
    monkeypatch.setattr(object_cache, "_prune", looked.append)
    for digit in "0123456789abcdef":
        object_cache.store(digit * 64, b"x")
    assert len(looked) == 1 and len(objects(cache)) == 16


def test_without_a_home_nothing_is_kept(tmp_path, monkeypatch):
    """HOME unset, and no entry in the table of users: used to end in a fault of awes."""
    monkeypatch.delenv("AWES_CACHE", raising=False)

    def nobody():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(object_cache.Path, "home", nobody)
    object_cache.store(KEY, b"code")
    assert object_cache.load(KEY) is None and object_cache.why_unused() == "there is no home folder"
    monkeypatch.undo()
    monkeypatch.setenv("HOME", "")
    monkeypatch.delenv("AWES_CACHE", raising=False)
    assert object_cache.folder() is None or object_cache.folder().is_absolute()


def test_a_cache_that_cannot_be_used_is_said(cache):
    assert object_cache.why_unused() == ""
    object_cache.store(KEY, b"code")
    assert object_cache.why_unused() == ""
    (cache / "objects").chmod(0o777)
    assert "chmod go-w" in object_cache.why_unused() and object_cache.load(KEY) is None
