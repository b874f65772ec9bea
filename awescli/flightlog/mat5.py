"""MATLAB 5 files -> nested plain data: structs, numbers, nothing else; every length is checked before it is believed.

scipy.io reads more of the format, but a damaged file can end the interpreter inside it (a segmentation fault that fuzzing found), and a
log comes from anywhere. Format: MAT-File Format, The MathWorks, version 5.
"""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from awescli.notation.errors import BadInput
from awescli.notation.regular_files import open_regular

MAX_BYTES = 300_000_000
"""Of a file."""
MAX_UNPACKED = 160_000_000
"""Bytes that a compressed variable may unpack to, and that all its numbers may take as float64: three hours at 50 Hz take 130 million. A
file of half a megabyte can hold four gigabytes of zeros."""
MAX_VARIABLES = 1000

MAX_DEPTH = 8
"""Structs in structs."""

MAX_FIELDS = 10_000

NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""miXXX storage types of numbers -> numpy's."""

MATRIX, COMPRESSED = 14, 15

CLASSES = {
    1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 6: "double", 7: "single", 8: "int8", 9: "uint8", 10: "int16", 11: "uint16",
    12: "int32", 13: "uint32", 14: "int64", 15: "uint64", 16: "function", 17: "opaque",
}  # fmt: skip
REFUSED = ("object", "function", "opaque")
"""Classes that hold code, or what only MATLAB can make sense of."""

NUMERIC = tuple(name for key, name in CLASSES.items() if key >= 6 and name not in REFUSED)


@dataclass(frozen=True)
class Unread:
    """A value of a class that a flight log has no use for, left unread."""

    kind: str


Value = np.ndarray | dict | Unread
"""Numbers as float64 without axes of length 1; a struct as field -> Value."""


class _Damaged(ValueError):
    """What is wrong with the bytes."""


def read_mat(path: Path, wanted: str, do: str) -> tuple[dict[str, str], Value | None]:
    """(name -> MATLAB class of every variable in the file, the value of the variable `wanted` or None).

    Raises BadInput, with `do` as the cure, for files that are damaged, too large, or hold objects.
    """
    try:
        with open_regular(path, MAX_BYTES) as file:
            raw = memoryview(file.read())
        if _is_hdf5(raw):
            raise BadInput("this is a MATLAB 7.3 file (HDF5), which awes does not read", str(path), "Save it with save(..., '-v7').")
        order = _byte_order(raw)
        kinds: dict[str, str] = {}
        value = None
        for number, (kind, body) in enumerate(_elements(raw[128:], order)):
            if number >= MAX_VARIABLES:
                raise _Damaged(f"more than {MAX_VARIABLES} variables")
            # what it is and what it is called stands in the first bytes: the rest is unpacked only where it is wanted
            start = _unpacked(body, 4096)[:4096] if kind == COMPRESSED else None
            header = _matrix_header(_inside(start, order) if start is not None else body, order)
            kinds[header.name] = header.kind
            if header.name == wanted and header.kind not in REFUSED:
                whole = _inside(_unpacked(body, MAX_UNPACKED), order) if start is not None else body
                value = _matrix(whole, order, 0, _Room(MAX_UNPACKED))
    except OSError as e:
        raise BadInput(f"cannot be read ({e.strerror or e})", str(path), "Check the path and its permissions.") from None
    except _Damaged as e:
        raise BadInput(f"not a readable MATLAB 5 file ({e})", str(path), do) from None
    if refused := [f"{name} ({kind})" for name, kind in kinds.items() if kind in REFUSED]:
        what = f"MATLAB objects are not read: {', '.join(refused)[:200]}"
        raise BadInput(what, str(path), "Save plain structs and numbers (save -v6).")
    return kinds, value


def variables(path: Path) -> dict[str, str]:
    """name -> MATLAB class of every variable in a file, none of them read. Raises BadInput as `read_mat`."""
    return read_mat(path, "", "Is the file complete?")[0]


@dataclass
class _Room:
    """Bytes that numbers may still take."""

    left: int

    def take(self, size: int) -> None:
        """Raises _Damaged before memory is asked for."""
        self.left -= size
        if self.left < 0:
            raise _Damaged(f"its numbers take more than {MAX_UNPACKED / 1e6:g} MB")


def _is_hdf5(raw: memoryview) -> bool:
    """Whether it is of MATLAB 7.3: the same first line as version 5 has, then HDF5, with or without a block of the user's before it."""
    return bytes(raw[:10]) == b"MATLAB 7.3" or any(bytes(raw[at : at + 8]) == b"\x89HDF\r\n\x1a\n" for at in (0, 512))


def _byte_order(raw: memoryview) -> str:
    if len(raw) < 136:
        raise _Damaged("too short")
    order = {b"IM": "<", b"MI": ">"}.get(bytes(raw[126:128]))
    if order is None:
        raise _Damaged("no MATLAB 5 header")
    return order


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """(type, bytes) of the elements one after the other."""
    at = 0
    while at + 8 <= len(data):
        kind, size = (int(v) for v in np.frombuffer(data[at : at + 8], order + "u4"))
        if kind >> 16:  # a small element: type and size share the first word, four bytes of data follow
            kind, size, begin, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if size > 4:
                raise _Damaged("a small element of more than 4 bytes")
        else:
            begin = at + 8
            end = begin + size if kind == COMPRESSED else begin + size + -size % 8
        if begin + size > len(data):
            raise _Damaged("an element is longer than the file")
        yield kind, data[begin : begin + size]
        at = end


def _unpacked(body: memoryview, most: int) -> memoryview:
    """The first `most` bytes of a compressed element; more than MAX_UNPACKED are refused."""
    try:
        unpacked = zlib.decompressobj().decompress(body, most + 1)
    except zlib.error as e:
        raise _Damaged(str(e)) from None
    if len(unpacked) > MAX_UNPACKED:
        raise _Damaged(f"a variable unpacks to more than {MAX_UNPACKED / 1e6:g} MB")
    return memoryview(unpacked)


def _inside(unpacked: memoryview, order: str) -> memoryview:
    """The matrix in a compressed element, as much of it as is there."""
    if len(unpacked) < 8:
        raise _Damaged("an empty variable")
    kind, size = (int(v) for v in np.frombuffer(unpacked[:8], order + "u4"))
    if kind != MATRIX:
        raise _Damaged("a variable is no matrix")
    return unpacked[8 : 8 + size]


@dataclass(frozen=True)
class _Header:
    """kind: MATLAB class; shape; name; parts: the elements after the name."""

    kind: str
    complex: bool
    shape: tuple[int, ...]
    name: str
    parts: Iterator[tuple[int, memoryview]]


def _matrix_header(body: memoryview, order: str) -> _Header:
    parts = _elements(body, order)
    try:
        (flags_type, flags), (shape_type, shape), (name_type, name) = next(parts), next(parts), next(parts)
    except StopIteration:
        raise _Damaged("a matrix without class, size or name") from None
    if (flags_type, shape_type, name_type) != (6, 5, 1) or len(flags) != 8 or len(shape) % 4 or not 8 <= len(shape) <= 128:
        raise _Damaged("a matrix whose header is none")
    word = int(np.frombuffer(flags[:4], order + "u4")[0])
    sizes = tuple(int(n) for n in np.frombuffer(shape, order + "i4"))
    if (word & 0xFF) not in CLASSES or min(sizes) < 0:
        raise _Damaged("a matrix of no known class or size")
    return _Header(CLASSES[word & 0xFF], bool(word & 0x800), sizes, bytes(name).decode("latin-1"), parts)


def _matrix(body: memoryview, order: str, depth: int, room: _Room) -> Value:
    """The value of a matrix element."""
    if depth > MAX_DEPTH:
        raise _Damaged(f"structs more than {MAX_DEPTH} deep")
    if not len(body):
        return np.empty(0)
    header = _matrix_header(body, order)
    if header.kind in NUMERIC and not header.complex:
        return _numbers(header, order, room)
    if header.kind == "struct" and all(n == 1 for n in header.shape):
        return _struct(header, order, depth, room)
    return Unread(header.kind)


def _numbers(header: _Header, order: str, room: _Room) -> np.ndarray:
    """float64 of the header's shape, axes of length 1 left out."""
    kind, data = next(header.parts, (0, memoryview(b"")))
    if kind not in NUMBERS:
        raise _Damaged("numbers of no known type")
    stored = np.dtype(order + NUMBERS[kind])
    count = 1
    for n in header.shape:  # exact: Python's integers do not overflow
        count *= n
    if count * stored.itemsize != len(data):
        raise _Damaged("a matrix whose size is not that of its numbers")
    room.take(8 * count)
    return np.squeeze(np.frombuffer(data, stored).astype(float).reshape(header.shape, order="F"))


def _struct(header: _Header, order: str, depth: int, room: _Room) -> dict[str, Value]:
    (length_type, length), (names_type, names) = next(header.parts, (0, b"")), next(header.parts, (0, b""))
    if length_type != 5 or len(length) != 4 or names_type != 1:
        raise _Damaged("a struct without field names")
    width = int(np.frombuffer(length, order + "i4")[0])
    if width < 1 or len(names) % width or len(names) // width > MAX_FIELDS:
        raise _Damaged("a struct whose field names do not fit")
    fields = [bytes(names[i : i + width]).split(b"\0")[0].decode("latin-1") for i in range(0, len(names), width)]
    found: dict[str, Value] = {}
    for field in fields:
        kind, body = next(header.parts, (0, memoryview(b"")))
        if kind != MATRIX:
            raise _Damaged(f"field '{field[:40]}' is no matrix")
        found[field] = _matrix(body, order, depth + 1, room)
    return found
