"""Step compiled programs through time: classical RK4, LANES segments abreast, groups of lanes on all cores.

The loops know addresses of programs and sizes, no kite. x = [states, held set-points]; exogenous inputs run linearly between samples,
set-points are held from sample to sample (seed eq. 9e as flown: sample and hold).

They are printed as LLVM IR like the programs they call, with sizes as arguments: one compiled loop serves every kite, and costs a tenth
of a second once. ctypes lets go of Python's lock during a call, so plain threads share the groups.
"""

import ctypes
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from functools import cache

import numpy as np

from awescli.engine.llvm_ir import Body, hexadecimal, print_rowwise
from awescli.engine.machine import LANES, _compile

LIMIT = 1e6
"""A state beyond this, or not finite, has diverged; its lane stops there and is set back to its start so that it stays harmless."""

_COMMON = (
    "ptr f", "ptr g", "ptr initial", "ptr law", "i64 n_s", "i64 n_sp", "i64 n_u", "i64 n_y", "i64 samples", "i64 substeps", "double h",
    "ptr x0", "ptr sp", "ptr inputs", "ptr c", "ptr X", "ptr Y", "ptr alive", "ptr work",
)  # fmt: skip
_TANGENT = (
    "i64 n_col", "ptr state_columns", "i64 n_wrt", "ptr always", "i64 n_w", "ptr w_parameter", "ptr w_column", "ptr w_first",
    "ptr w_last", "i64 n_rows", "ptr rows", "i64 count", "i64 stride", "ptr J", "ptr columns",
)  # fmt: skip
"""Arguments of the printed loops, for one group of lanes; see `rollout` and `sensitivities`."""


class _Loop(Body):
    """Prints the loop over the samples of one group. tangent: sensitivities S (n_x, n_col, L) go beside every state."""

    def __init__(self, tangent: bool):
        super().__init__(LANES)
        self.tangent = tangent
        n_x = self.whole("add", "%n_s", "%n_sp")
        self.used = "%work"
        # a vector is a pair of addresses: its numbers, and their derivatives
        self.x, self.start, self.stage, self.total, self.k = (self._vector(n_x) for _ in range(5))
        self.u, self.n_x = self._rows("%n_u"), n_x
        self.D = self._rows(self.whole("mul", "%n_y", "%n_col")) if tangent else ""

    def _rows(self, n) -> str:
        here, self.used = self.used, self.row(self.used, n)
        return here

    def _vector(self, n) -> tuple[str, ...]:
        return (self._rows(n), self._rows(self.whole("mul", n, "%n_col"))) if self.tangent else (self._rows(n),)

    def _parts(self, first, n):
        """(first row, number of rows) of components first..first+n of a vector, for its numbers and its derivatives."""
        yield first, n
        if self.tangent:
            yield self.whole("mul", first, "%n_col"), self.whole("mul", n, "%n_col")

    def _copy(self, to, at, source, n) -> None:
        """to[at : at + n] = source[:n]"""
        for (first, rows), a, b in zip(self._parts(at, n), to, source, strict=True):
            self.call("@copy", f"ptr {self.row(a, first)}", f"ptr {b}", f"i64 {rows}")

    def _rowwise(self, name, *arguments) -> None:
        """A printed formula on the n_s stepped components; arguments: vectors and numbers."""
        for part, (_, rows) in enumerate(self._parts(0, "%n_s")):
            typed = [f"double {a}" if isinstance(a, str) else f"ptr {a[part]}" for a in arguments]
            self.call(f"@{name}", *typed, f"i64 {rows}")

    def _program(self, address, x, u, y) -> None:
        """y = program(x, u, c), with derivatives."""
        arguments = [x[0], u, "%c", y[0], *([x[1], y[1]] if self.tangent else [])]
        more = ["i64 %n_col", "ptr %columns"] if self.tangent else []
        self.call(address, *(f"ptr {a}" for a in arguments), *more)

    def _set_points(self, u, k) -> None:
        """The set-points of sample k: what the law says, or else the recorded ones."""
        recorded = self.row("%sp", self.whole("mul", k, "%n_sp"))
        self.call("@copy", f"ptr {self.row(self.x[0], '%n_s')}", f"ptr {recorded}", "i64 %n_sp")
        with self.when(self.line("icmp ne ptr %law, null")):
            self._program("%law", self.x, u, self.k)
            self._copy(self.x, "%n_s", self.k, "%n_sp")

    def _columns_now(self, k) -> None:
        """Columns that differentiate with respect to a parameter during step k: those of the whole segment and those of a window."""
        if not self.tangent:
            return
        load = lambda block, i: self.line(f"load i64, ptr {self.line(f'getelementptr i64, ptr %{block}, i64 {i}')}")  # noqa: E731
        with self.loop("%n_wrt") as j:
            self.lines.append(f"  store i64 {load('always', j)}, ptr {self.line(f'getelementptr i64, ptr %columns, i64 {j}')}")
        with self.loop("%n_w") as i:
            begun = self.line(f"icmp sle i64 {load('w_first', i)}, {k}")
            on = self.line(f"icmp slt i64 {k}, {load('w_last', i)}")
            with self.when(self.line(f"and i1 {begun}, {on}")):
                place = self.line(f"getelementptr i64, ptr %columns, i64 {load('w_parameter', i)}")
                self.lines.append(f"  store i64 {load('w_column', i)}, ptr {place}")

    def _begin(self) -> None:
        """x and S at the first sample."""
        self.call("@copy", f"ptr {self.x[0]}", "ptr %x0", "i64 12")
        if self.tangent:
            with self.loop(12) as i:
                column = self.line(f"load i64, ptr {self.line(f'getelementptr i64, ptr %state_columns, i64 {i}')}")
                with self.when(self.line(f"icmp sge i64 {column}, 0")):
                    row = self.row(self.x[1], self.whole("add", self.whole("mul", i, "%n_col"), column))
                    self.lines.append(f"  store {self.type} {self._splat(1.0)}, ptr {row}, align 8")
        self._columns_now(0)
        self._set_points("%inputs", 0)
        with self.when(self.line("icmp sgt i64 %n_s, 12")):
            self._program("%initial", self.x, "%inputs", self.k)
            self._copy(self.x, 12, self.k, self.whole("sub", "%n_s", 12))
        self.call("@copy", f"ptr {self.start[0]}", f"ptr {self.x[0]}", f"i64 {self.n_x}")

    def text(self, name: str, arguments: Sequence[str]) -> str:
        """The function with these arguments ("ptr f")."""
        self._print()
        return self.function(name, [f"{kind} %{name}" for kind, name in (a.split() for a in arguments)])

    def _derivative(self, vector, k) -> None:
        """k = f(vector, inputs now, c)"""
        self._program("%f", vector, self.u, k)

    def _print(self) -> None:
        substeps = self.line("sitofp i64 %substeps to double")
        step = self.line(f"fdiv double %h, {substeps}")
        half, sixth = (self.line(f"fdiv double {step}, {hexadecimal(d)}") for d in (2.0, 6.0))
        last = self.whole("sub", "%samples", 1)
        self._begin()
        with self.loop("%samples") as k:
            u = self.row("%inputs", self.whole("mul", k, "%n_u"))
            self._columns_now(k)
            self._set_points(u, k)
            self.call("@copy", f"ptr {self.row('%X', self.whole('mul', k, self.n_x))}", f"ptr {self.x[0]}", f"i64 {self.n_x}")
            y = self.row("%Y", self.whole("mul", k, "%n_y"))
            self._program("%g", self.x, u, (y, self.D))
            if self.tangent:
                self._hand_out(k)
            with self.when(self.line(f"icmp slt i64 {k}, {last}")):
                with self.loop("%substeps") as sub:
                    self._step(self.line(f"sitofp i64 {sub} to double"), substeps, u, step, half, sixth)
                self._stop_diverged(self.whole("add", k, 1))

    def _step(self, sub, substeps, u, step, half, sixth) -> None:
        """One classical Runge-Kutta step."""
        after = self.row(u, "%n_u")

        def derivative(at, vector, k):
            if at is not None:
                share = self.line(f"fdiv double {self.line(f'fadd double {sub}, {hexadecimal(at)}')}, {substeps}")
                self.call("@between", f"ptr {self.u}", f"ptr {u}", f"ptr {after}", f"double {share}", "i64 %n_u")
            self._derivative(vector, k)

        held = [self.row(p, first) for p, (first, _) in zip(self.x, self._parts("%n_s", "%n_sp"), strict=True)]
        self._copy(self.stage, "%n_s", held, "%n_sp")
        # k1 + 2 k2 + 2 k3 is summed as it comes: fewer rows stay in the nearest cache
        derivative(0.0, self.x, self.total)
        self._rowwise("moved", self.stage, self.x, self.total, half)
        for at, far in ((0.5, half), (None, step)):
            derivative(at, self.stage, self.k)
            self._rowwise("moved", self.stage, self.x, self.k, far)
            self._rowwise("added", self.total, self.total, self.k)
        derivative(1.0, self.stage, self.k)
        self._rowwise("stepped", self.x, self.x, self.total, self.k, sixth)

    def _hand_out(self, k) -> None:
        """J[lane, k, i, j] = D[rows[i], j, lane]"""
        block = self.whole("mul", "%n_rows", "%n_col")
        with self.loop("%count") as lane, self.loop("%n_rows") as i:
            row = self.line(f"load i64, ptr {self.line(f'getelementptr i64, ptr %rows, i64 {i}')}")
            source = self.row(self.D, self.whole("mul", row, "%n_col"))
            before = self.whole("add", self.whole("mul", lane, "%stride"), self.whole("mul", k, block))
            to = self.line(f"getelementptr double, ptr %J, i64 {self.whole('add', before, self.whole('mul', i, '%n_col'))}")
            with self.loop("%n_col") as j:
                value = self.line(f"load double, ptr {self.line(f'getelementptr {self.type}, ptr {source}, i64 {j}, i64 {lane}')}")
                self.lines.append(f"  store double {value}, ptr {self.line(f'getelementptr double, ptr {to}, i64 {j}')}")

    def _stop_diverged(self, k) -> None:
        """Lanes whose state left the numbers end at sample k and go back to their start, with derivatives zero."""
        t, mask, whole = self.type, f"<{self.lanes} x i1>", f"<{self.lanes} x i64>"
        gone = self.line(f"call {mask} @gone(ptr {self.x[0]}, i64 {self.n_x})")
        with self.when(self.line(f"icmp ne i{self.lanes} {self.line(f'bitcast {mask} {gone} to i{self.lanes}')}, 0")):
            first = self.line(f"insertelement {whole} poison, i64 {k}, i64 0")
            now = self.line(f"shufflevector {whole} {first}, {whole} poison, <{self.lanes} x i32> zeroinitializer")
            alive = self.line(f"load {whole}, ptr %alive, align 8")
            sooner = self.line(f"call {whole} @llvm.smin.v{self.lanes}i64({whole} {alive}, {whole} {now})")
            self.lines.append(
                f"  store {whole} {self.line(f'select {mask} {gone}, {whole} {sooner}, {whole} {alive}')}, ptr %alive, align 8"
            )
            for part, (_, rows) in enumerate(self._parts(0, self.n_x)):
                with self.loop(rows) as i:
                    here = self.row(self.x[part], i)
                    back = "zeroinitializer" if part else self.line(f"load {t}, ptr {self.row(self.start[0], i)}, align 8")
                    old = self.line(f"load {t}, ptr {here}, align 8")
                    self.lines.append(f"  store {t} {self.line(f'select {mask} {gone}, {t} {back}, {t} {old}')}, ptr {here}, align 8")


def _print_gone() -> str:
    """gone(x, n): the lanes where one of n rows is not below LIMIT, or not a number."""
    body, mask = Body(LANES), f"<{LANES} x i1>"
    total = body.line(f"alloca {mask}")
    body.lines.append(f"  store {mask} zeroinitializer, ptr {total}")
    with body.loop("%n") as i:
        value = body.line(f"load {body.type}, ptr {body.row('%x', i)}, align 8")
        size = body.line(f"call {body.type} @llvm.fabs.v{LANES}f64({body.type} {value})")
        beyond = body.line(f"fcmp uge {body.type} {size}, {body._splat(LIMIT)}")
        so_far = body.line(f"load {mask}, ptr {total}")
        body.lines.append(f"  store {mask} {body.line(f'or {mask} {so_far}, {beyond}')}, ptr {total}")
    result = body.line(f"load {mask}, ptr {total}")
    lines = "\n".join(body.lines)
    return f"define internal {mask} @gone(ptr %x, i64 %n) {{\nentry:\n{lines}\n  ret {mask} {result}\n}}\n"


_C_TYPES = {"ptr": ctypes.c_void_p, "i64": ctypes.c_int64, "double": ctypes.c_double}


@cache
def _compiled(tangent: bool) -> Callable:
    """The loop over one group of lanes, as a function of _COMMON (and _TANGENT)."""
    arguments = [*_COMMON, *(_TANGENT if tangent else ())]
    return compile_loop(_Loop(tangent).text("loop", arguments), arguments)


def compile_loop(text: str, arguments: Sequence[str]) -> Callable:
    """The function `loop` of an IR text that may call the small functions on rows which loops are made of."""
    text += _print_gone()
    text += print_rowwise("copy", lambda a: a, 1, 0, LANES)
    text += print_rowwise("between", lambda a, b, share: a + share * (b - a), 2, 1, LANES)
    text += print_rowwise("moved", lambda x, k, scale: x + scale * k, 2, 1, LANES)
    text += print_rowwise("added", lambda total, k: total + 2.0 * k, 2, 0, LANES)
    text += print_rowwise("stepped", lambda x, total, k, scale: x + scale * (total + k), 3, 1, LANES)
    t, i = f"<{LANES} x double>", f"<{LANES} x i64>"
    text += f"declare {t} @llvm.fabs.v{LANES}f64({t})\ndeclare {i} @llvm.smin.v{LANES}i64({i}, {i})\n"
    address = _compile(text).get_function_address("loop")
    return ctypes.CFUNCTYPE(None, *(_C_TYPES[a.split()[0]] for a in arguments))(address)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _each_group(work: Callable[[int], None], groups: int) -> None:
    """work(0), ..., work(groups - 1) on all cores. Threads live for one call: a pool that is kept would not survive a fork."""
    threads = min(groups, cores())
    with ThreadPoolExecutor(threads) if threads > 1 else nullcontext() as pool:
        for _ in (pool.map if pool else map)(work, range(groups)):
            pass


def _addresses(*arrays: np.ndarray) -> list[Callable[[int], int]]:
    """For each array, the address of its part of a group (the first axis)."""
    assert all(a.flags.c_contiguous and a.dtype.itemsize == 8 for a in arrays)
    return [lambda group, a=a.ctypes.data, step=a.strides[0] if a.ndim else 0: a + group * step for a in arrays]


def _zeros(rows: int) -> tuple[np.ndarray, int]:
    """(array, address of rows of lanes in it that begin on a cache line)"""
    array = np.zeros(rows * LANES + 8)
    return array, -(-array.ctypes.data // 64) * 64


def rollout(f, g, initial, law, n_s, X0, SP, U, C, h, substeps, X, Y, alive):
    """Simulate. X0 (G, 12, L); SP (G, K+1, n_sp, L); U (G, K+1, n_u, L); C (G, n_c, L); h [s] between samples.

    f, g, initial, law: addresses of `value` functions (law = 0: recorded set-points). Fills X (G, K+1, n_x, L), Y (G, K+1, n_y, L)
    and alive (G, L), the number of samples before divergence.
    """
    G, samples, n_x, _ = X.shape
    n_u, sizes = U.shape[2], (n_s, SP.shape[2], U.shape[2], Y.shape[2], samples, substeps, h)
    places, loop = _addresses(X0, SP, U, C, X, Y, alive), _compiled(False)

    def work(group):
        keep, scratch = _zeros(5 * n_x + n_u)
        loop(f, g, initial, law, *sizes, *(at(group) for at in places), scratch)

    _each_group(work, G)


def sensitivities(f, g, initial, law, n_s, X0, SP, U, C, h, substeps, state_columns, always, w_parameter, w_column, w_first, w_last,
                  n_col, rows, X, Y, J, alive):  # fmt: skip
    """`rollout`, and the exact derivative of its outputs: J (segments, K+1, len(rows), n_col) = dY[rows] / d columns.

    f, g, initial, law: addresses of `tangent` functions. state_columns (12,): column of each initial state, or -1;
    always (n_wrt,): column of each parameter over the whole segment, or -1; w_*: columns of a parameter in steps first..last-1.
    """
    G, samples, n_x, L = X.shape
    n_u, n_y = U.shape[2], Y.shape[2]
    sizes, stride = (n_s, SP.shape[2], n_u, n_y, samples, substeps, h), int(np.prod(J.shape[1:]))
    places, loop = _addresses(X0, SP, U, C, X, Y, alive), _compiled(True)
    state_columns, always, *windows = (
        np.ascontiguousarray(a, np.int64) for a in (state_columns, always, w_parameter, w_column, w_first, w_last)
    )
    rows = np.ascontiguousarray(rows, np.int64)

    def work(group):
        keep, scratch = _zeros(5 * n_x * (1 + n_col) + n_u + n_y * n_col)
        columns = np.empty(len(always), np.int64)
        loop(
            f, g, initial, law, *sizes, *(at(group) for at in places), scratch,
            n_col, state_columns.ctypes.data, len(always), always.ctypes.data, len(windows[0]), *(w.ctypes.data for w in windows),
            len(rows), rows.ctypes.data, min(L, len(J) - group * L), stride, J.ctypes.data + group * L * stride * 8, columns.ctypes.data,
        )  # fmt: skip

    _each_group(work, G)
