"""Step compiled programs through time: classical RK4, LANES segments abreast, groups of lanes on all cores.

The loops know addresses of programs and sizes, no kite. x = [states, held set-points]; exogenous inputs run linearly between samples,
set-points are held from sample to sample (seed eq. 9e as flown: sample and hold).

They are printed as LLVM IR like the programs they call, with sizes as arguments: one compiled loop serves every kite, and costs a tenth
of a second once.
"""

import ctypes
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from awescli.engine.lanes import abreast, apart, lane_rows, print_lanes
from awescli.engine.llvm_ir import Body, hexadecimal, print_rowwise
from awescli.engine.machine import LANES, _compile
from awescli.simulation.groups import each_group, groups_of, members, parts

LIMIT = 1e6
"""A state beyond this, or not finite, has diverged; its lane stops there and is set back to its start so that it stays harmless."""

_COMMON = (
    "ptr f", "ptr g", "ptr initial", "ptr law", "i64 n_s", "i64 n_sp", "i64 n_u", "i64 n_y", "i64 samples", "i64 substeps", "double h",
    "i64 first", "i64 until", "ptr x0", "ptr sp", "ptr inputs", "ptr c", "ptr X", "ptr Y", "ptr alive", "ptr work",
)  # fmt: skip
_TANGENT = (
    "i64 n_col", "ptr state_columns", "i64 n_wrt", "ptr always", "i64 n_w", "ptr w_parameter", "ptr w_column", "ptr w_first",
    "ptr w_last", "i64 n_rows", "i64 count", "i64 stride", "ptr J", "ptr columns",
)  # fmt: skip
"""Arguments of the printed loops, for one group of lanes; see `rollout` and `sensitivities`. Samples first..until-1 are done, and the step
from the last of them: what the next call goes on from stays in `work`."""


class _Loop(Body):
    """Prints the loop over the samples of one group. tangent: sensitivities S (n_x, n_col, L) go beside every state."""

    def __init__(self, tangent: bool):
        super().__init__(LANES)
        self.tangent = tangent
        n_x = self.whole("add", "%n_s", "%n_sp")
        self.used = "%work"
        # a vector is a pair of addresses: its numbers, and their derivatives
        self.x, self.start, self.stage, self.k = (self._vector(n_x) for _ in range(4))
        self.u, self.n_x = self._rows("%n_u"), n_x
        # the first derivative of a step, to which the others are added; behind it the outputs
        self.total = (self._rows(self.whole("add", "%n_s", "%n_y")),)
        if tangent:
            self.total += (self._rows(self.whole("mul", self.whole("add", "%n_s", "%n_rows"), "%n_col")),)

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
        with self.when(self.line("icmp eq i64 %first, 0")):
            self._begin()
        with self.loop(self.whole("sub", "%until", "%first")) as done:
            k = self.whole("add", "%first", done)
            u = self.row("%inputs", self.whole("mul", k, "%n_u"))
            self._columns_now(k)
            self._set_points(u, k)
            self.call("@copy", f"ptr {self.row('%X', self.whole('mul', k, self.n_x))}", f"ptr {self.x[0]}", f"i64 {self.n_x}")
            self._sample(u, k)
            with self.when(self.line(f"icmp slt i64 {k}, {last}")):
                with self.loop("%substeps") as sub:
                    self._step(sub, substeps, u, step, half, sixth)
                self._stop_diverged(self.whole("add", k, 1))

    def _sample(self, u, k) -> None:
        """Outputs of sample k, J[lane, k, i, j] = d outputs[i, lane] / d column j, and the derivative that the step begins with."""
        self._program("%g", self.x, u, self.total)
        y = self.row("%Y", self.whole("mul", k, "%n_y"))
        self.call("@copy", f"ptr {y}", f"ptr {self.row(self.total[0], '%n_s')}", "i64 %n_y")
        if self.tangent:
            D, block = self.row(self.total[1], self.whole("mul", "%n_s", "%n_col")), self.whole("mul", "%n_rows", "%n_col")
            to = self.line(f"getelementptr double, ptr %J, i64 {self.whole('mul', k, block)}")
            self.call("@apart", f"ptr {to}", f"ptr {D}", f"i64 {block}", "i64 %stride", "i64 %count")

    def _begin_step(self, sub, derivative) -> None:
        """The first derivative of a step: at a sample it is known."""
        with self.when(self.line(f"icmp ne i64 {sub}, 0")):
            derivative(0.0, self.x, self.total)

    def _step(self, sub, substeps, u, step, half, sixth) -> None:
        """One classical Runge-Kutta step."""
        after, so_far = self.row(u, "%n_u"), self.line(f"sitofp i64 {sub} to double")

        def derivative(at, vector, k):
            if at is not None:
                share = self.line(f"fdiv double {self.line(f'fadd double {so_far}, {hexadecimal(at)}')}, {substeps}")
                self.call("@between", f"ptr {self.u}", f"ptr {u}", f"ptr {after}", f"double {share}", "i64 %n_u")
            self._derivative(vector, k)

        held = [self.row(p, first) for p, (first, _) in zip(self.x, self._parts("%n_s", "%n_sp"), strict=True)]
        self._copy(self.stage, "%n_s", held, "%n_sp")
        # k1 + 2 k2 + 2 k3 is summed as it comes: fewer rows stay in the nearest cache
        self._begin_step(sub, derivative)
        self._rowwise("moved", self.stage, self.x, self.total, half)
        for at, far in ((0.5, half), (None, step)):
            derivative(at, self.stage, self.k)
            self._rowwise("went_on", self.stage, self.total, self.x, self.total, self.k, far)
        derivative(1.0, self.stage, self.k)
        self._rowwise("stepped", self.x, self.x, self.total, self.k, sixth)

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
    text += _print_gone() + print_lanes(LANES)
    text += print_rowwise("copy", lambda a: a, 1, 0, LANES)
    text += print_rowwise("between", lambda a, b, share: a + share * (b - a), 2, 1, LANES)
    text += print_rowwise("moved", lambda x, k, scale: x + scale * k, 2, 1, LANES)
    text += print_rowwise("went_on", lambda x, total, k, scale: (x + scale * k, total + 2.0 * k), 3, 1, LANES)
    text += print_rowwise("stepped", lambda x, total, k, scale: x + scale * (total + k), 3, 1, LANES)
    t, i = f"<{LANES} x double>", f"<{LANES} x i64>"
    text += f"declare {t} @llvm.fabs.v{LANES}f64({t})\ndeclare {i} @llvm.smin.v{LANES}i64({i}, {i})\n"
    address = _compile(text).get_function_address("loop")
    return ctypes.CFUNCTYPE(None, *(_C_TYPES[a.split()[0]] for a in arguments))(address)


def passed(*arguments) -> list:
    """Arguments of a loop, arrays by their addresses."""
    arrays = [a for a in arguments if isinstance(a, np.ndarray)]
    assert all(a.flags.c_contiguous and a.dtype.itemsize == 8 for a in arrays)
    return [a.ctypes.data if isinstance(a, np.ndarray) else a for a in arguments]


def rollout(f, g, initial, law, n_s, X0, SP, U, C, h, substeps, X, Y) -> np.ndarray:
    """Simulate K segments. X0 (K, 12); SP (K, N+1, n_sp); U (K, N+1, n_u); C (K, n_c); h [s] between samples.

    f, g, initial, law: addresses of `value` functions; g: [derivative, outputs]; law = 0: recorded set-points. Fills X (K, N+1, n_x) and
    Y (K, N+1, n_y); returns (K,) the number of samples before divergence.
    """
    return _simulate((f, g, initial, law), n_s, (X0, SP, U, C), h, substeps, X, Y)


def sensitivities(f, g, initial, law, n_s, X0, SP, U, C, h, substeps, state_columns, always, windows, X, Y, J) -> np.ndarray:
    """`rollout`, and the exact derivative of some of its outputs: J (K, N+1, n_rows, n_col).

    f, g, initial, law: addresses of `tangent` functions; g's differentiates the derivative and those outputs. state_columns (12,): column
    of each initial state, or -1; always (n_wrt,): column of each parameter over the whole segment, or -1; windows (4, n): parameter,
    column, first, last of those that count in steps first..last-1.
    """
    n_rows, n_col = J.shape[2:]
    of_all = (n_col, state_columns, len(always), always, windows.shape[1], *windows, n_rows)

    def more(here: slice) -> tuple:
        return (*of_all, len(J[here]), J.strides[0] // 8, J[here], np.empty(len(always), np.int64))

    return _simulate((f, g, initial, law), n_s, (X0, SP, U, C), h, substeps, X, Y, n_rows, n_col, more)


def _simulate(programs, n_s, inputs, h, substeps, X, Y, n_rows=0, n_col=0, more=None) -> np.ndarray:
    """The loop over all groups. more: the arguments of _TANGENT for some segments."""
    K, samples, n_x = X.shape
    n_sp, n_u, n_y = (a.shape[2] for a in (*inputs[1:3], Y))
    sizes, loop = (n_s, n_sp, n_u, n_y, samples, substeps, h), _compiled(more is not None)
    alive = np.full((groups_of(K), LANES), samples)

    def work(group):
        here = members(group)
        own = [abreast(a[here]) for a in inputs]
        states, outputs = lane_rows(samples, n_x), lane_rows(samples, n_y)
        scratch = lane_rows(4 * n_x * (1 + n_col) + n_u + n_s + n_y + (n_s + n_rows) * n_col)
        own += [states, outputs, alive[group], scratch, *(more(here) if more else ())]
        for first, until in parts(samples):
            if first:
                yield
            loop(*passed(*programs, *sizes, first, until, *own))
        apart(states, X[here])
        apart(outputs, Y[here])

    each_group(work, len(alive))
    return alive.reshape(-1)[:K]
