"""Eliminate the inner nodes of segments from the last link to the first, compiled: the matrices are too small for one call of numpy each.

In a link, x = [w+, s, w] is what counts at its two nodes: the processes at the second one, state and processes at the first. M (x, [x, w at
the end of the segment, globals, residual]) is its Gram matrix; V, the part of [s, w] in that of the link behind, says all of what comes
after. With the state at the second node s+ = E x,

    M += [E x, w+]' V [E x, w+],      M_w+,w+ = C C',      Y = C^-1 M_w+,others,      V = M_others,others - Y' Y.

A row of M is LANES numbers wide at a time. It has room behind its end for as many as a last vector takes too much: those are never read.
"""

import ctypes
from collections.abc import Callable
from functools import cache

import numpy as np

from awescli.engine.llvm_ir import Body, hexadecimal, print_rowwise
from awescli.engine.machine import LANES, _compile
from awescli.estimation.elimination import HARDER, RIDGE, TRIES

AT_ONCE = 4
"""Vectors of a row that are summed in registers at once."""
COMBINE = ("ptr %y", "ptr %a", "i64 %between_a", "ptr %x", "i64 %between_x", "i64 %terms", "i64 %vectors", "double %sign")
ELIMINATE = (
    "ptr %M", "ptr %E", "ptr %behind", "ptr %R", "ptr %T", "i64 %segments", "i64 %links", "i64 %n_s", "i64 %W", "i64 %columns",
    "i64 %row", "i64 %row_E", "i64 %row_R", "i64 %segment_M", "i64 %segment_E", "i64 %segment_behind", "i64 %segment_R",
)  # fmt: skip
"""Sizes, and from where to where it is numbers: row: of M, behind and T; segment_: from segment to segment."""


def padded(n: int) -> int:
    """Numbers in the vectors that n numbers take."""
    return -(-n // LANES) * LANES


def row_length(columns: int) -> int:
    """Of a matrix of so many columns: vectors may begin at any of them."""
    return padded(columns + LANES - 1)


def eliminate_backward(M: np.ndarray, E: np.ndarray, behind: np.ndarray, R: np.ndarray, columns: int) -> None:
    """Eliminate w+ in links, the last first.

    M: (K, links, width, row_length(columns)), written over: rows of w+ become Y (its columns from W on), those of [s, w] become V.
    E: (K, links, n_s, padded(width)), zero behind its width.
    behind: (K, width, row_length(columns)) of the link behind, done.
    R: (K, links, W, padded(W)) of ones on the diagonal, becomes C^-1.
    Each link lies in one piece.
    """
    K, links, width, row = M.shape
    n_s = E.shape[2]
    W = (width - n_s) // 2
    if not links:
        return
    T = np.zeros((n_s + W, row))
    between = [a.strides[0] // 8 for a in (M, E, behind, R)]
    sizes = (K, links, n_s, W, columns, row, E.shape[3], R.shape[3], *between)
    _function()(*(a.ctypes.data for a in (M, E, behind, R, T)), *sizes)


@cache
def _function() -> Callable:
    text = _print_combine() + _print_eliminate() + print_rowwise("scaled", lambda x, by: x * by, 1, 1, LANES)
    text += print_rowwise("copy", lambda x: x, 1, 0, LANES)
    text += "".join(f"declare double @llvm.{name}.f64(double)\n" for name in ("sqrt", "fabs"))
    kinds = [ctypes.c_void_p if a.startswith("ptr") else ctypes.c_int64 for a in ELIMINATE]
    return ctypes.CFUNCTYPE(None, *kinds)(_compile(text).get_function_address("eliminate"))


class _Rows(Body):
    """Prints functions on rows of numbers."""

    def __init__(self):
        super().__init__(LANES)

    def at(self, pointer: str, *numbers: int | str) -> str:
        """Address so many numbers behind another."""
        for n in numbers:
            pointer = self.line(f"getelementptr double, ptr {pointer}, i64 {n}")
        return pointer

    def times(self, a: int | str, b: int | str) -> str:
        return self.whole("mul", a, b)

    def vectors(self, n: str) -> str:
        """How many vectors n numbers take."""
        return self.whole("udiv", self.whole("add", n, LANES - 1), LANES)

    def number(self, pointer: str) -> str:
        return self.line(f"load double, ptr {pointer}, align 8")

    def put(self, number: str, pointer: str) -> None:
        self.lines.append(f"  store double {number}, ptr {pointer}, align 8")

    def combine(self, y: str, factors: tuple[str, str], rows: tuple[str, str], terms: int | str, vectors: str, sign: float = 1.0) -> None:
        """y += sign * sum of rows, each times its factor; factors, rows: (the first, numbers from one to the next)."""
        (a, between_a), (x, between_x) = factors, rows
        self.call(
            "@combine", f"ptr {y}", f"ptr {a}", f"i64 {between_a}", f"ptr {x}", f"i64 {between_x}", f"i64 {terms}", f"i64 {vectors}",
            f"double {hexadecimal(sign)}",
        )  # fmt: skip


def _print_combine() -> str:
    """combine(y, a, between_a, x, between_x, terms, vectors, sign): see `_Rows.combine`."""
    body = _Rows()
    sums = [body.line(f"alloca {body.type}") for _ in range(AT_ONCE)]

    def added_up(first: str, count: int) -> None:
        here = [body.row("%y", body.whole("add", first, i)) for i in range(count)]
        for total, place in zip(sums, here, strict=False):
            body.lines.append(f"  store {body.type} {body.line(f'load {body.type}, ptr {place}, align 8')}, ptr {total}")
        with body.loop("%terms") as j:
            factor = body.line(f"fmul double %sign, {body.number(body.at('%a', body.times(j, '%between_a')))}")
            one = body.line(f"insertelement {body.type} poison, double {factor}, i64 0")
            every = body.line(f"shufflevector {body.type} {one}, {body.type} poison, <{LANES} x i32> zeroinitializer")
            x = body.at("%x", body.times(j, "%between_x"))
            for i, total in enumerate(sums[:count]):
                there = body.line(f"load {body.type}, ptr {body.row(x, body.whole('add', first, i))}, align 8")
                product = body.line(f"fmul contract {body.type} {every}, {there}")
                so_far = body.line(f"load {body.type}, ptr {total}")
                body.lines.append(f"  store {body.type} {body.line(f'fadd contract {body.type} {so_far}, {product}')}, ptr {total}")
        for total, place in zip(sums, here, strict=False):
            body.lines.append(f"  store {body.type} {body.line(f'load {body.type}, ptr {total}')}, ptr {place}, align 8")

    whole = body.whole("udiv", "%vectors", AT_ONCE)
    with body.loop(whole) as group:
        added_up(body.times(group, AT_ONCE), AT_ONCE)
    done = body.times(whole, AT_ONCE)
    with body.loop(body.whole("sub", "%vectors", done)) as i:
        added_up(body.whole("add", done, i), 1)
    return body.function("combine", COMBINE, "internal")


def _print_eliminate() -> str:
    body = _Rows()
    kept, width = body.whole("add", "%n_s", "%W"), body.whole("add", "%n_s", body.times("%W", 2))
    body.lines += [f"  %{name} = alloca double" for name in ("one", "ridge", "total", "exists")]
    body.put(hexadecimal(1.0), "%one")
    with body.loop("%segments") as k:
        M, E, behind, R = (body.at(f"%{name}", body.times(k, f"%segment_{name}")) for name in ("M", "E", "behind", "R"))
        with body.loop("%links") as done:
            m = body.whole("sub", body.whole("sub", "%links", 1), done)
            here = body.at(M, body.times(m, body.times(width, "%row")))
            last = body.line(f"icmp eq i64 {done}, 0")
            next_ = body.at(here, body.times(width, "%row"))
            V = body.at(body.line(f"select i1 {last}, ptr {behind}, ptr {next_}"), body.times("%W", "%row"), "%W")
            E_m, R_m = body.at(E, body.times(m, body.times("%n_s", "%row_E"))), body.at(R, body.times(m, body.times("%W", "%row_R")))
            _bring_back(body, here, E_m, V, kept, width)
            _take_out(body, here, R_m, kept)
    return body.function("eliminate", ELIMINATE)


def _bring_back(body: _Rows, M: str, E: str, V: str, kept: str, width: str) -> None:
    """M += [E x, w+]' V [E x, w+], with T = V [E x, w+]."""
    others = body.whole("sub", "%columns", width)
    with body.loop(kept) as i:
        T, v = body.at("%T", body.times(i, "%row")), body.at(V, body.times(i, "%row"))
        with body.loop(body.vectors(width)) as j:
            body.lines.append(f"  store {body.type} zeroinitializer, ptr {body.row(T, j)}, align 8")
        body.combine(T, (v, "1"), (E, "%row_E"), "%n_s", body.vectors(width))
        with body.loop("%W") as j:
            there = body.at(T, j)
            body.put(body.line(f"fadd double {body.number(there)}, {body.number(body.at(v, '%n_s', j))}"), there)
        body.call("@copy", f"ptr {body.at(T, width)}", f"ptr {body.at(v, kept)}", f"i64 {body.vectors(others)}")
    with body.loop(width) as i:
        body.combine(body.at(M, body.times(i, "%row")), (body.at(E, i), "%row_E"), ("%T", "%row"), "%n_s", body.vectors("%columns"))
    with body.loop("%W") as i:
        of_w = body.at("%T", body.times(body.whole("add", "%n_s", i), "%row"))
        body.combine(body.at(M, body.times(i, "%row")), ("%one", "0"), (of_w, "0"), 1, body.vectors("%columns"))


def _take_out(body: _Rows, M: str, R: str, kept: str) -> None:
    """Rows of w+ become [C', Y], the others M - Y' Y; R = C^-1."""
    _make_firm(body, M)
    with body.loop("%W") as j:
        row, inverse = body.at(M, body.times(j, "%row")), body.at(R, body.times(j, "%row_R"))
        body.combine(inverse, (body.at(M, j), "%row"), (R, "%row_R"), j, body.vectors("%W"), -1.0)
        by = _factor(body, M, j, "%columns")
        for line, n in ((row, "%columns"), (inverse, "%W")):
            body.call("@scaled", f"ptr {line}", f"ptr {line}", f"double {by}", f"i64 {body.vectors(n)}")
    with body.loop(kept) as i:
        column = body.whole("add", "%W", i)
        row = body.at(M, body.times(column, "%row"), "%W")
        others = body.vectors(body.whole("sub", "%columns", "%W"))
        body.combine(row, (body.at(M, column), "%row"), (body.at(M, "%W"), "%row"), "%W", others, -1.0)


def _factor(body: _Rows, M: str, j: str, columns: str) -> str:
    """Row j of C', those before it known, but for the division by the root of its pivot: one over that."""
    row = body.at(M, body.times(j, "%row"))
    body.combine(row, (body.at(M, j), "%row"), (M, "%row"), j, body.vectors(columns), -1.0)
    root = body.line(f"call double @llvm.sqrt.f64(double {body.number(body.at(row, j))})")
    return body.line(f"fdiv double {hexadecimal(1.0)}, {root}")


def _make_firm(body: _Rows, M: str) -> None:
    """`elimination.firm_cholesky`: the least ridge on the diagonal of w+ with which C exists, tried on a copy of these rows in T; of what
    has none the diagonal is left."""
    body.put(hexadecimal(RIDGE), "%ridge")
    body.put(hexadecimal(0.0), "%total")
    body.put(hexadecimal(0.0), "%exists")
    with body.loop(TRIES), body.when(body.line(f"fcmp oeq double {body.number('%exists')}, {hexadecimal(0.0)}")):
        ridge = body.number("%ridge")
        body.put(body.line(f"fadd double {body.number('%total')}, {ridge}"), "%total")
        body.put(body.line(f"fmul double {ridge}, {hexadecimal(HARDER)}"), "%ridge")
        body.put(hexadecimal(1.0), "%exists")
        with body.loop("%W") as j:
            row, pivot = body.at("%T", body.times(j, "%row")), body.at("%T", body.times(j, "%row"), j)
            body.call("@copy", f"ptr {row}", f"ptr {body.at(M, body.times(j, '%row'))}", f"i64 {body.vectors('%W')}")
            body.put(_with_ridge(body, pivot), pivot)
            by = _factor(body, "%T", j, "%W")
            positive = body.line(f"fcmp ogt double {body.number(pivot)}, {hexadecimal(0.0)}")
            body.put(body.line(f"select i1 {positive}, double {body.number('%exists')}, double {hexadecimal(0.0)}"), "%exists")
            body.call("@scaled", f"ptr {row}", f"ptr {row}", f"double {by}", f"i64 {body.vectors('%W')}")
    exists = body.line(f"fcmp ogt double {body.number('%exists')}, {hexadecimal(0.0)}")
    with body.loop("%W") as j:
        row, pivot = body.at(M, body.times(j, "%row")), body.at(M, body.times(j, "%row"), j)
        size = body.line(f"call double @llvm.fabs.f64(double {body.number(pivot)})")
        alone = body.line(f"fadd double {size}, {hexadecimal(1.0)}")
        firm = body.line(f"select i1 {exists}, double {_with_ridge(body, pivot)}, double {alone}")
        with body.when(body.line(f"xor i1 {exists}, true")), body.loop("%W") as i:
            body.put(hexadecimal(0.0), body.at(row, i))
        body.put(firm, pivot)


def _with_ridge(body: _Rows, pivot: str) -> str:
    """An element of the diagonal with `total` times (one and itself)."""
    value = body.number(pivot)
    more = body.line(f"fmul double {body.number('%total')}, {body.line(f'fadd double {value}, {hexadecimal(1.0)}')}")
    return body.line(f"fadd double {value}, {more}")
