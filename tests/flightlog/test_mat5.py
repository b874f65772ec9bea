"""The MATLAB reader against scipy's, and against bytes that nobody should believe."""

import subprocess
import sys
import zlib

import numpy as np
import pytest
from flightlog.synthetic import SHARED
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import loadmat, savemat

from awescli.flightlog import mat5
from awescli.flightlog.mat5 import Unread, read_mat
from awescli.notation.errors import BadInput

AP2 = SHARED / "flights" / "ampyx-ap2" / "validationDataFC114_1_v2_pc.mat"


def plain(value):
    """What scipy gives, in the shape that read_mat gives."""
    if isinstance(value, np.ndarray) and value.dtype.names:
        return {name: plain(value[name].item()) for name in value.dtype.names}
    return np.asarray(value, dtype=float)


def same(a, b):
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    return np.array_equal(np.squeeze(a), np.squeeze(b), equal_nan=True)


NUMBERS = st.sampled_from([np.float64, np.float32, np.int8, np.uint16, np.int32, np.uint64])
ARRAYS = st.tuples(NUMBERS, st.lists(st.integers(1, 4), min_size=2, max_size=3), st.integers(0, 99)).map(
    lambda t: (np.random.default_rng(t[2]).standard_normal(t[1]) * 50).astype(t[0])
)
NAMES = st.text("abcXYZ", min_size=1, max_size=20)
STRUCTS = st.recursive(ARRAYS, lambda inner: st.dictionaries(NAMES, inner, min_size=1, max_size=4), max_leaves=8)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.dictionaries(NAMES, STRUCTS, min_size=1, max_size=4), st.booleans())
def test_reads_what_scipy_reads(tmp_path, data, compressed):
    file = tmp_path / "a.mat"
    savemat(file, {"s": data, "other": np.arange(3)}, do_compression=compressed)
    kinds, value = read_mat(file, "s", "")
    assert kinds["s"] == "struct" and set(kinds) == {"s", "other"}
    assert same(plain(loadmat(file, squeeze_me=True)["s"]), value)


@pytest.mark.skipif(not AP2.exists(), reason="the measured flight is not here")
def test_reads_the_measured_flight_as_scipy_does():
    assert same(plain(loadmat(AP2, squeeze_me=True)["validationData"]), read_mat(AP2, "validationData", "")[1])


def test_what_is_no_number_is_left_unread(tmp_path):
    savemat(tmp_path / "a.mat", {"s": {"text": "abc", "cell": np.array([1, "x"], dtype=object), "z": np.array([1j])}})
    value = read_mat(tmp_path / "a.mat", "s", "")[1]
    assert value == {"text": Unread("char"), "cell": Unread("cell"), "z": Unread("double")}


def test_bombs_do_not_go_off(tmp_path, monkeypatch):
    """A variable that unpacks to more than the limit, one that says it is larger than it is, structs without end."""
    monkeypatch.setattr(mat5, "MAX_UNPACKED", 100_000)
    savemat(tmp_path / "a.mat", {"s": np.zeros(50_000)}, do_compression=True)
    assert (tmp_path / "a.mat").stat().st_size < 2000
    with pytest.raises(BadInput, match="unpacks to more than"):
        read_mat(tmp_path / "a.mat", "s", "")
    assert read_mat(tmp_path / "a.mat", "t", "") == ({"s": "double"}, None)  # what is not wanted is not unpacked
    savemat(tmp_path / "b.mat", {"s": np.zeros((4, 4))})
    raw = bytearray((tmp_path / "b.mat").read_bytes())
    at = raw.index(np.array([4, 4], "<i4").tobytes())
    raw[at : at + 8] = np.array([2**31 - 1, 2**31 - 1], "<i4").tobytes()
    (tmp_path / "b.mat").write_bytes(bytes(raw))
    with pytest.raises(BadInput, match="not that of its numbers"):
        read_mat(tmp_path / "b.mat", "s", "")
    deep = {"x": np.zeros(2)}
    for _ in range(20):
        deep = {"x": deep}
    savemat(tmp_path / "c.mat", {"s": deep})
    with pytest.raises(BadInput, match="more than 8 deep"):
        read_mat(tmp_path / "c.mat", "s", "")


def compressed(pieces) -> bytes:
    """A .mat file of one compressed variable."""
    packer = zlib.compressobj(1)
    body = b"".join(packer.compress(piece) for piece in pieces) + packer.flush()
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + np.array([15, len(body)], "<u4").tobytes() + body


def header(name: bytes, count: int, stored: int) -> bytes:
    """A double matrix of `count` numbers stored as bytes, up to its data."""
    head = np.array([6, 8, 6, 0, 5, 8, 1, count], "<u4").tobytes() + np.array([1, len(name)], "<u4").tobytes() + name.ljust(8, b"\0")
    return np.array([14, len(head) + 8 + stored], "<u4").tobytes() + head + np.array([2, stored], "<u4").tobytes()


READ = """
import sys, time
from pathlib import Path
from awescli.flightlog.mat5 import read_mat
from awescli.notation.errors import BadInput
began = time.process_time()
try:
    read_mat(Path(sys.argv[1]), "s", "")
except BadInput as e:
    # the peak of this process since it began; that of getrusage holds what the process before had
    peak = next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM"))
    print(e.what, "|", int(peak) // 1024, "|", time.process_time() - began)
"""


@pytest.mark.parametrize("claimed", [700, 150])
def test_a_small_file_cannot_take_the_memory(tmp_path, claimed):
    """700 MB of zeros in 3 MB, and 150 MB of bytes that would be 1.2 GB as float64: a file of 467 kB used to take 4.3 GB."""
    megabyte = bytes(1_000_000)
    (tmp_path / "a.mat").write_bytes(compressed([header(b"s", claimed * 10**6, claimed * 10**6), *[megabyte] * claimed]))
    done = subprocess.run([sys.executable, "-c", READ, str(tmp_path / "a.mat")], capture_output=True, text=True, check=True)
    what, memory, seconds = done.stdout.split(" | ")
    assert ("unpacks to more than" if claimed > 160 else "numbers take more than") in what
    assert int(memory) < 500 and float(seconds) < 10


def test_a_file_of_matlab_7_3_is_named_as_such(tmp_path):
    """Its first line looks like that of version 5, so that it used to be called damaged."""
    start = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM"
    for name, content in (("a", start.ljust(512) + b"\x89HDF\r\n\x1a\n" + bytes(2000)), ("b", b"\x89HDF\r\n\x1a\n" + bytes(2000))):
        (tmp_path / f"{name}.mat").write_bytes(content)
        with pytest.raises(BadInput, match="MATLAB 7.3 file") as caught:
            read_mat(tmp_path / f"{name}.mat", "s", "")
        assert "-v7" in caught.value.do


def test_too_many_variables_are_not_looked_through(tmp_path):
    one = header(b"x", 0, 0)
    (tmp_path / "a.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + one * 5000)
    with pytest.raises(BadInput, match="more than 1000 variables"):
        read_mat(tmp_path / "a.mat", "s", "")


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, 1000), st.binary(max_size=8), st.integers(0, 8)), min_size=1, max_size=6), st.booleans())
def test_damaged_bytes_are_read_or_refused(tmp_path, damage, compressed):
    file = tmp_path / "a.mat"
    savemat(file, {"s": {"a": np.arange(12.0), "b": {"c": np.ones((3, 4))}}}, do_compression=compressed)
    raw = bytearray(file.read_bytes())
    for at, new, gone in damage:
        at %= len(raw)
        raw[at : at + gone] = new
    file.write_bytes(bytes(raw))
    try:
        read_mat(file, "s", "")
    except BadInput as e:
        assert str(file) in str(e)
