"""Step compiled programs through time: classical RK4, LANES segments abreast, groups of lanes on all cores.

The loops know addresses of programs and sizes, no kite. x = [states, held set-points]; exogenous inputs run linearly between samples,
set-points are held over a step at least (sample and hold, docs/equations.md (19); `stepping.Stepping` says where they are taken).

They are printed as LLVM IR like the programs they call, with sizes as arguments: one compiled loop serves every kite, and costs a tenth
of a second once. Loops that do more (`sensitivities`, `hybrid_kernels`) are this one with some of its parts printed otherwise.
"""

import ctypes
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from awescli.engine.lanes import abreast, apart, lane_rows
from awescli.engine.llvm_ir import Body, hexadecimal, print_rowwise
from awescli.engine.machine import LANES, _compile
from awescli.simulation.groups import each_group, groups_of, members, parts
from awescli.simulation.stepping import Stepping

LIMIT = 1e6
"""A state beyond this, or not finite, has diverged; its lane stops there and is set back to its start so that it stays harmless."""

COMMON = (
    "ptr f", "ptr g", "ptr initial", "ptr law", "i64 n_s", "i64 n_sp", "i64 n_u", "i64 n_y", "i64 samples", "i64 substeps", "double h",
    "double sp_first", "double sp_onward", "i64 first", "i64 until", "ptr x0", "ptr sp", "ptr inputs", "ptr c", "ptr X", "ptr Y",
    "ptr alive", "ptr work",
)  # fmt: skip
"""Arguments of the printed loops, for one group of lanes; see `rollout`. Samples first..until-1 are done, and the step from the last of
them: what the next call goes on from stays in `work`."""


class Loop(Body):
    """Prints the loop over the samples of one group. Vectors are addresses of rows in `work`."""

    def __init__(self):
        super().__init__(LANES)
        self.used, self.n_x = "%work", self.whole("add", "%n_s", "%n_sp")
        self.x, self.start, self.stage, self.k = (self.rows(self.n_x) for _ in range(4))
        self.u = self.rows("%n_u")
        # the first derivative of a step, to which the others are added; behind it the outputs
        self.total = self.rows(self.whole("add", "%n_s", "%n_y"))

    def rows(self, n: str) -> str:
        """Room for n rows."""
        here, self.used = self.used, self.row(self.used, n)
        return here

    def copy(self, to: str, source: str, n: int | str) -> None:
        self.call("@copy", f"ptr {to}", f"ptr {source}", f"i64 {n}")

    def text(self, name: str, arguments: Sequence[str]) -> str:
        """The function with these arguments ("ptr f")."""
        self._print()
        return self.function(name, [f"{kind} %{name}" for kind, name in (a.split() for a in arguments)])

    # what a loop that does more than a rollout does otherwise

    def evaluate(self, address: str, x: str, u: str, y: str) -> None:
        """y = program(x, u, c)"""
        self.call(address, *(f"ptr {a}" for a in (x, u, "%c", y)))

    def fill(self, program: str, u: str, first: int | str, n: str) -> None:
        """x[first : first + n] = program(x, u, c)"""
        self.evaluate(f"%{program}", self.x, u, self.k)
        self.copy(self.row(self.x, first), self.k, n)

    def begin(self) -> None:
        """Before the first sample."""

    def begin_sample(self, k: int | str) -> None:
        """Before anything else at sample k."""

    def sample(self, u: str, k: str) -> None:
        """Outputs of sample k, and the derivative that the step begins with."""
        self.evaluate("%g", self.x, u, self.total)
        self.copy(self.row("%Y", self.whole("mul", k, "%n_y")), self.row(self.total, "%n_s"), "%n_y")

    def begin_step(self, at_sample: str, derivative: Callable) -> None:
        """The first derivative of a step, which is known where the step begins as a sample was left."""
        with self.when(self.line(f"xor i1 {at_sample}, true")):
            derivative(0, 0.0, self.x, self.total)

    def derivative(self, stage: int, x: str, k: str) -> None:
        """k = f(x, inputs now, c) at a stage 0..3 of a step."""
        self.evaluate("%f", x, self.u, k)

    def end_step(self, step: str) -> None:
        """After a step of so many seconds."""

    def set_back(self, gone: str) -> None:
        """In the lanes that are gone."""
        t = self.type
        with self.loop(self.n_x) as i:
            here = self.row(self.x, i)
            back, old = (self.line(f"load {t}, ptr {p}, align 8") for p in (self.row(self.start, i), here))
            chosen = self.line(f"select <{self.lanes} x i1> {gone}, {t} {back}, {t} {old}")
            self.lines.append(f"  store {t} {chosen}, ptr {here}, align 8")

    # the loop

    def _print(self) -> None:
        substeps = self.line("sitofp i64 %substeps to double")
        step = self.line(f"fdiv double %h, {substeps}")
        half, sixth = (self.line(f"fdiv double {step}, {hexadecimal(d)}") for d in (2.0, 6.0))
        last = self.whole("sub", "%samples", 1)
        with self.when(self.line("icmp eq i64 %first, 0")):
            self._start()
        with self.loop(self.whole("sub", "%until", "%first")) as done:
            k = self.whole("add", "%first", done)
            u = self.row("%inputs", self.whole("mul", k, "%n_u"))
            self.begin_sample(k)
            self._set_points(u, k)
            self.copy(self.row("%X", self.whole("mul", k, self.n_x)), self.x, self.n_x)
            self.sample(u, k)
            with self.when(self.line(f"icmp slt i64 {k}, {last}")):
                with self.loop("%substeps") as sub:
                    self._step(k, sub, substeps, u, step, half, sixth)
                self._stop_diverged(self.whole("add", k, 1))

    def _start(self) -> None:
        """x at the first sample."""
        self.copy(self.x, "%x0", 12)
        self.begin()
        self.begin_sample(0)
        self._set_points("%inputs", 0)
        with self.when(self.line("icmp sgt i64 %n_s, 12")):
            further = self.whole("sub", "%n_s", 12)
            self.fill("initial", "%inputs", 12, further)
            self.begin()
            here = self.row(self.x, 12)
            self.call("@added", f"ptr {here}", f"ptr {here}", f"ptr {self.row('%x0', 12)}", f"i64 {further}")
        self.copy(self.start, self.x, self.n_x)

    def _set_points(self, u: str, k: int | str) -> None:
        """The set-points of sample k: what the law says, or else the recorded ones."""
        self.copy(self.row(self.x, "%n_s"), self.row("%sp", self.whole("mul", k, "%n_sp")), "%n_sp")
        with self.when(self.line("icmp ne ptr %law, null")):
            self.fill("law", u, "%n_s", "%n_sp")

    def _set_points_within(self, k: str, sub: str, share: str, u: str) -> str:
        """The set-points of step `sub` after sample k, where they are not those of the sample; whether they are.

        share: of the way to the next sample at which the step begins; a law is asked again there.
        """
        so_far = self.line(f"fmul double %sp_onward, {self.line(f'sitofp i64 {sub} to double')}")
        along = self.line(f"fadd double %sp_first, {so_far}")
        at_sample = self.line(f"fcmp oeq double {along}, {hexadecimal(0.0)}")
        with self.when(self.line(f"xor i1 {at_sample}, true")):
            held, here = self.row(self.x, "%n_s"), self.row("%sp", self.whole("mul", k, "%n_sp"))
            self.call("@between", f"ptr {held}", f"ptr {here}", f"ptr {self.row(here, '%n_sp')}", f"double {along}", "i64 %n_sp")
            with self.when(self.line("icmp ne ptr %law, null")):
                self.call("@between", f"ptr {self.u}", f"ptr {u}", f"ptr {self.row(u, '%n_u')}", f"double {share}", "i64 %n_u")
                self.fill("law", self.u, "%n_s", "%n_sp")
        return self.line(f"and i1 {at_sample}, {self.line(f'icmp eq i64 {sub}, 0')}")

    def _step(self, k: str, sub: str, substeps: str, u: str, step: str, half: str, sixth: str) -> None:
        """One classical Runge-Kutta step."""
        after, so_far = self.row(u, "%n_u"), self.line(f"sitofp i64 {sub} to double")
        at_sample = self._set_points_within(k, sub, self.line(f"fdiv double {so_far}, {substeps}"), u)

        def derivative(stage, at, x, k):
            share = self.line(f"fdiv double {self.line(f'fadd double {so_far}, {hexadecimal(at)}')}, {substeps}")
            self.call("@between", f"ptr {self.u}", f"ptr {u}", f"ptr {after}", f"double {share}", "i64 %n_u")
            self.derivative(stage, x, k)

        def rowwise(name, *arguments):
            """A printed formula on the stepped components; arguments: vectors, and a number at the end."""
            self.call(f"@{name}", *(f"ptr {a}" for a in arguments[:-1]), f"double {arguments[-1]}", "i64 %n_s")

        x, stage, total, rates = self.x, self.stage, self.total, self.k
        self.copy(self.row(stage, "%n_s"), self.row(x, "%n_s"), "%n_sp")
        # k1 + 2 k2 + 2 k3 is summed as it comes
        self.begin_step(at_sample, derivative)
        rowwise("moved", stage, x, total, half)
        for number, far in ((1, half), (2, step)):
            derivative(number, 0.5, stage, rates)
            rowwise("went_on", stage, total, x, total, rates, far)
        derivative(3, 1.0, stage, rates)
        rowwise("stepped", x, x, total, rates, sixth)
        self.end_step(step)

    def _stop_diverged(self, k: str) -> None:
        """Lanes whose state left the numbers end at sample k and go back to their start."""
        mask, whole = f"<{self.lanes} x i1>", f"<{self.lanes} x i64>"
        gone = self.line(f"call {mask} @gone(ptr {self.x}, i64 {self.n_x})")
        with self.when(self.line(f"icmp ne i{self.lanes} {self.line(f'bitcast {mask} {gone} to i{self.lanes}')}, 0")):
            first = self.line(f"insertelement {whole} poison, i64 {k}, i64 0")
            now = self.line(f"shufflevector {whole} {first}, {whole} poison, <{self.lanes} x i32> zeroinitializer")
            alive = self.line(f"load {whole}, ptr %alive, align 8")
            sooner = self.line(f"call {whole} @llvm.smin.v{self.lanes}i64({whole} {alive}, {whole} {now})")
            ended = self.line(f"select {mask} {gone}, {whole} {sooner}, {whole} {alive}")
            self.lines.append(f"  store {whole} {ended}, ptr %alive, align 8")
            self.set_back(gone)


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
def rollout_loop() -> Callable:
    """The loop of a rollout, with arguments COMMON; one that ends before the last sample goes on from what it left in `work`: first the
    rows of x."""
    return compile_loop(Loop().text("loop", COMMON), COMMON)


def compile_loop(text: str, arguments: Sequence[str]) -> Callable:
    """The function `loop` of an IR text that may call the small functions on rows which loops are made of."""
    text += _print_gone()
    text += print_rowwise("copy", lambda a: a, 1, 0, LANES)
    text += print_rowwise("added", lambda a, b: a + b, 2, 0, LANES)
    text += print_rowwise("between", lambda a, b, share: a + share * (b - a), 2, 1, LANES)
    text += print_rowwise("moved", lambda x, k, scale: x + scale * k, 2, 1, LANES)
    text += print_rowwise("went_on", lambda x, total, k, scale: (x + scale * k, total + 2.0 * k), 3, 1, LANES)
    text += print_rowwise("stepped", lambda x, total, k, scale: x + scale * (total + k), 3, 1, LANES)
    t, i = f"<{LANES} x double>", f"<{LANES} x i64>"
    text += f"declare {t} @llvm.fabs.v{LANES}f64({t})\ndeclare {i} @llvm.smin.v{LANES}i64({i}, {i})\n"
    address = _compile(text).get_function_address("loop")
    return ctypes.CFUNCTYPE(None, *(_C_TYPES[a.split()[0]] for a in arguments))(address)


def rollout(
    f: int, g: int, initial: int, law: int, n_s: int, X0: np.ndarray, SP: np.ndarray, U: np.ndarray, C: np.ndarray, h: float,
    stepping: Stepping, X: np.ndarray, Y: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Simulate K segments. X0 (K, n_s): states, and behind them what the effects' own states differ from `initial`; SP (K, N+1, n_sp); U
    (K, N+1, n_u); C (K, n_c); h [s] between samples.

    f, g, initial, law: addresses of `value` functions; g: [derivative, outputs]; law = 0: recorded set-points. Fills X (K, N+1, n_x) and
    Y (K, N+1, n_y); returns (K,) the number of samples before divergence.
    """
    return on_segments(rollout_loop(), (f, g, initial, law), n_s, (X0, SP, U, C), h, stepping, X, Y)


def on_segments(
    loop: Callable, programs: tuple[int, int, int, int], n_s: int, inputs: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], h: float,
    stepping: Stepping, X: np.ndarray, Y: np.ndarray, more_rows: int = 0, more: Callable[[slice], tuple] | None = None,
) -> np.ndarray:  # fmt: skip
    """Run a loop over all groups of segments; more_rows: of `work`, behind those of a rollout; more: arguments behind COMMON for some
    segments. Returns (K,) the number of samples before divergence."""
    K, samples, n_x = X.shape
    n_sp, n_u, n_y = (a.shape[2] for a in (*inputs[1:3], Y))
    sizes = (n_s, n_sp, n_u, n_y, samples, stepping.substeps, h, stepping.first, stepping.onward)
    alive = np.full((groups_of(K), LANES), samples)

    def work(group):
        here = members(group)
        states, outputs = lane_rows(samples, n_x), lane_rows(samples, n_y)
        scratch = lane_rows(rows_of_loop(n_x, n_s, n_u, n_y) + more_rows)
        own = (*(abreast(a[here]) for a in inputs), states, outputs, alive[group], scratch, *(more(here) if more else ()))
        for first, until in parts(samples):
            if first:
                yield
            loop(*passed(*programs, *sizes, first, until, *own))
        apart(states, X[here])
        apart(outputs, Y[here])

    each_group(work, len(alive))
    return alive.reshape(-1)[:K]


def rows_of_loop(n_x: int, n_s: int, n_u: int, n_y: int) -> int:
    """Rows of `work` that a `Loop` uses."""
    return 4 * n_x + n_u + n_s + n_y


def passed(*arguments: np.ndarray | float | None) -> list:
    """Arguments of a loop, arrays by their addresses."""
    arrays = [a for a in arguments if isinstance(a, np.ndarray)]
    assert all(a.flags.c_contiguous and a.dtype.itemsize == 8 for a in arrays)
    return [a.ctypes.data if isinstance(a, np.ndarray) else a for a in arguments]
