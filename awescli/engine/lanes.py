"""How numbers of segments that lie one behind the other come to lie in rows of lanes, and back: printed, compiled, called.

    abreast(to, from, n, stride, count)      to (n, lanes): to[i, lane] = from[lane * stride + i]
    apart(to, from, n, stride, count)        to[lane * stride + i] = from[i, lane]

Where there are only `count` < lanes segments, the last is read, or written, again. Squares of lanes x lanes numbers are turned in the
registers: number by number it would take as long as computing them.
"""

import ctypes
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np

from awescli.engine.llvm_ir import Body
from awescli.engine.machine import LANES, _compile

ARGUMENTS = ("ptr %to", "ptr %from", "i64 %n", "i64 %stride", "i64 %count")


def print_lanes(lanes: int) -> str:
    """The functions `abreast` and `apart`."""
    return _print_abreast(lanes) + _print_apart(lanes)


def _print_abreast(lanes: int) -> str:
    body = _Turning(lanes, "%from")
    with body.squares() as i:
        rows = body.turned([body.read(place) for place in body.places(i)])
        for j, row in enumerate(rows):
            body.write(row, body.row("%to", body.whole("add", i, j)))
    with body.rest() as i:
        row = "poison"
        for lane, place in enumerate(body.places(i)):
            number = body.line(f"load double, ptr {place}, align 8")
            row = body.line(f"insertelement {body.type} {row}, double {number}, i64 {lane}")
        body.write(row, body.row("%to", i))
    return body.function("abreast", ARGUMENTS)


def _print_apart(lanes: int) -> str:
    body = _Turning(lanes, "%to")
    with body.squares() as i:
        rows = [body.read(body.row("%from", body.whole("add", i, j))) for j in range(lanes)]
        for place, numbers in zip(body.places(i), body.turned(rows), strict=True):
            body.write(numbers, place)
    with body.rest() as i:
        row = body.read(body.row("%from", i))
        for lane, place in enumerate(body.places(i)):
            number = body.line(f"extractelement {body.type} {row}, i64 {lane}")
            body.lines.append(f"  store double {number}, ptr {place}, align 8")
    return body.function("apart", ARGUMENTS)


class _Turning(Body):
    """segments: addresses where the segments of the lanes begin in the block `apart`."""

    def __init__(self, lanes: int, apart: str):
        super().__init__(lanes)
        last = self.whole("sub", "%count", 1)
        self.segments = []
        for lane in range(lanes):
            here = self.line(f"select i1 {self.line(f'icmp slt i64 {lane}, {last}')}, i64 {lane}, i64 {last}")
            self.segments.append(self.line(f"getelementptr double, ptr {apart}, i64 {self.whole('mul', here, '%stride')}"))
        self.whole_squares = self.whole("udiv", "%n", lanes)

    @contextmanager
    def squares(self) -> Iterator[str]:
        """The first row of each square."""
        with self.loop(self.whole_squares) as square:
            yield self.whole("mul", square, self.lanes)

    @contextmanager
    def rest(self) -> Iterator[str]:
        """Each row behind the last square."""
        done = self.whole("mul", self.whole_squares, self.lanes)
        with self.loop(self.whole("sub", "%n", done)) as i:
            yield self.whole("add", done, i)

    def places(self, i: str) -> list[str]:
        """Address of number i of every segment."""
        return [self.line(f"getelementptr double, ptr {segment}, i64 {i}") for segment in self.segments]

    def read(self, place: str) -> str:
        return self.line(f"load {self.type}, ptr {place}, align 8")

    def write(self, numbers: str, place: str) -> None:
        self.lines.append(f"  store {self.type} {numbers}, ptr {place}, align 8")

    def turned(self, rows: list[str]) -> list[str]:
        """The transposed square: ever larger blocks beside the diagonal change places."""
        size = 1
        while size < self.lanes:
            after = list(rows)
            for i in (i for i in range(self.lanes) if not i & size):
                j = i | size
                # lane l of two rows side by side: l of the first, lanes + l of the second
                upper = [self.lanes + lane - size if lane & size else lane for lane in range(self.lanes)]
                lower = [self.lanes + lane if lane & size else lane + size for lane in range(self.lanes)]
                after[i], after[j] = (self._shuffled(rows[i], rows[j], which) for which in (upper, lower))
            rows, size = after, 2 * size
        return rows

    def _shuffled(self, a: str, b: str, which: list[int]) -> str:
        mask = f"<{self.lanes} x i32> <{', '.join(f'i32 {lane}' for lane in which)}>"
        return self.line(f"shufflevector {self.type} {a}, {self.type} {b}, {mask}")


def lane_rows(*shape: int) -> np.ndarray:
    """(*shape, LANES) zeros that begin on a cache line: a row in two of them takes twice as long."""
    size = LANES * math.prod(shape)
    flat = np.zeros(size + 8)
    first = -flat.ctypes.data // 8 % 8
    return flat[first : first + size].reshape(*shape, LANES)


def abreast(segments: np.ndarray) -> np.ndarray:
    """(..., LANES) from up to LANES segments (count, ...), each in one piece; the last fills the lanes that are left."""
    to = lane_rows(*segments.shape[1:])
    _move("abreast", to, segments, segments)
    return to


def apart(lanes: np.ndarray, segments: np.ndarray) -> None:
    """Write lanes (..., LANES) to up to LANES segments (count, ...), each in one piece."""
    _move("apart", segments, lanes, segments)


def _move(name: str, to: np.ndarray, source: np.ndarray, segments: np.ndarray) -> None:
    assert segments[0].flags.c_contiguous and segments.dtype == float
    _functions()[name](to.ctypes.data, source.ctypes.data, segments[0].size, segments.strides[0] // 8, len(segments))


@cache
def _functions() -> dict[str, Callable]:
    engine = _compile(print_lanes(LANES))
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, *[ctypes.c_int64] * 3)
    return {name: kind(engine.get_function_address(name)) for name in ("abreast", "apart")}
