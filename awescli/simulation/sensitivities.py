"""The loop of `kernels` with exact sensitivities S (n_x, n_col, L) of the state beside it.

What a program computes is linearised as it is evaluated; S then goes through a whole step at once (`engine.linearised`).
"""

from collections.abc import Callable
from functools import cache

import numpy as np

from awescli.engine.lanes import print_lanes
from awescli.engine.machine import LANES, Program
from awescli.simulation.kernels import COMMON, Loop, compile_loop, on_segments
from awescli.simulation.stepping import Stepping

_ARGUMENTS = (
    *COMMON, "ptr step", "ptr g_columns", "ptr initial_columns", "ptr law_columns", "i64 n_col", "i64 n_wrt", "ptr column_state",
    "ptr column_parameter", "ptr column_first", "ptr column_last", "ptr column_restarts", "ptr restart", "i64 n_rows", "i64 count",
    "i64 stride", "ptr J", "i64 ends_stride", "ptr ends", "ptr parameter_of",
)  # fmt: skip


class _Differentiated(Loop):
    """E: Jacobians as `engine.linearised` lays them out, of which what is always zero is never written."""

    def __init__(self):
        super().__init__()
        width = self.whole("add", self.whole("add", self.n_x, "%n_wrt"), 1)
        area = lambda a, b: self.rows(self.whole("mul", a, b))  # noqa: E731
        self.S, self.D = area(self.n_x, "%n_col"), area("%n_rows", "%n_col")
        self.E_filled = {"law": area("%n_sp", width), "initial": area("%n_s", width)}
        later = [area("%n_s", width) for _ in range(3)]
        # the first stage of a step is a sample: behind its rates are its outputs
        self.stages, self.E_outputs = [area("%n_s", width), *later], area("%n_rows", width)

    def number(self, block: str, i: str) -> str:
        """Whole number i of a block."""
        return self.line(f"load i64, ptr {self.line(f'getelementptr i64, ptr {block}, i64 {i}')}")

    def linearise(self, address: str, x: str, u: str, y: str, E: str) -> None:
        self.call(address, *(f"ptr {a}" for a in (x, u, "%c", y, E)))

    def columns(self, address: str, E: str, dS: str) -> None:
        """dS = E S"""
        self.call(address, f"ptr {E}", f"ptr {self.S}", f"ptr {dS}", "i64 %n_col", "ptr %parameter_of")

    def fill(self, program: str, u: str, first: int | str, n: str) -> None:
        E = self.E_filled[program]
        self.linearise(f"%{program}", self.x, u, self.k, E)
        self.copy(self.row(self.x, first), self.k, n)
        # in place: a column is read before it is written
        self.columns(f"%{program}_columns", E, self.row(self.S, self.whole("mul", first, "%n_col")))

    def begin(self) -> None:
        """S of the initial state."""
        with self.loop("%n_col") as j:
            self._seed(j)

    def _seed(self, j: str) -> None:
        """A one where column j of S, zero so far, differentiates with respect to a state."""
        state = self.number("%column_state", j)
        with self.when(self.line(f"icmp sge i64 {state}, 0")):
            place = self.row(self.S, self.whole("add", self.whole("mul", state, "%n_col"), j))
            self.lines.append(f"  store {self.type} {self._splat(1.0)}, ptr {place}, align 8")

    def begin_sample(self, k: int | str) -> None:
        """Where columns start again: S so far goes to the ends. And the parameter of each column that counts in this step."""
        number, size = self.number("%restart", str(k)), self.whole("mul", self.n_x, "%n_col")
        with self.when(self.line(f"icmp sge i64 {number}, 0")):
            to = self.line(f"getelementptr double, ptr %ends, i64 {self.whole('mul', number, size)}")
            self.call("@apart", f"ptr {to}", f"ptr {self.S}", f"i64 {size}", "i64 %ends_stride", "i64 %count")
            with self.loop("%n_col") as j:
                with self.when(self.line(f"icmp ne i64 {self.number('%column_restarts', j)}, 0")):
                    with self.loop(self.n_x) as i:
                        place = self.row(self.S, self.whole("add", self.whole("mul", i, "%n_col"), j))
                        self.lines.append(f"  store {self.type} zeroinitializer, ptr {place}, align 8")
                    self._seed(j)
        with self.loop("%n_col") as j:
            begun = self.line(f"icmp sle i64 {self.number('%column_first', j)}, {k}")
            on = self.line(f"icmp slt i64 {k}, {self.number('%column_last', j)}")
            now = self.line(f"select i1 {self.line(f'and i1 {begun}, {on}')}, i64 {self.number('%column_parameter', j)}, i64 %n_wrt")
            self.lines.append(f"  store i64 {now}, ptr {self.line(f'getelementptr i64, ptr %parameter_of, i64 {j}')}")

    def sample(self, u: str, k: str) -> None:
        """And J[lane, k, i, j] = d outputs[i, lane] / d column j."""
        self.linearise("%g", self.x, u, self.total, self.stages[0])
        self.copy(self.row("%Y", self.whole("mul", k, "%n_y")), self.row(self.total, "%n_s"), "%n_y")
        self.columns("%g_columns", self.E_outputs, self.D)
        block = self.whole("mul", "%n_rows", "%n_col")
        to = self.line(f"getelementptr double, ptr %J, i64 {self.whole('mul', k, block)}")
        self.call("@apart", f"ptr {to}", f"ptr {self.D}", f"i64 {block}", "i64 %stride", "i64 %count")

    def derivative(self, stage: int, x: str, k: str) -> None:
        self.linearise("%f", x, self.u, k, self.stages[stage])

    def end_step(self, step: str) -> None:
        pointers = (f"ptr {a}" for a in (*self.stages, self.S))
        self.call("%step", *pointers, "i64 %n_col", "ptr %parameter_of", f"double {step}")

    def set_back(self, gone: str) -> None:
        """Also S, to zero."""
        super().set_back(gone)
        with self.loop(self.whole("mul", self.n_x, "%n_col")) as i:
            here = self.row(self.S, i)
            old = self.line(f"load {self.type}, ptr {here}, align 8")
            kept = self.line(f"select <{self.lanes} x i1> {gone}, {self.type} zeroinitializer, {self.type} {old}")
            self.lines.append(f"  store {self.type} {kept}, ptr {here}, align 8")


@cache
def differentiated_loop() -> Callable:
    """`rollout_loop` with sensitivities."""
    return compile_loop(_Differentiated().text("loop", _ARGUMENTS) + print_lanes(LANES), _ARGUMENTS)


def sensitivities(
    g: Program, initial: Program, law: Program | None, n_s: int, X0: np.ndarray, SP: np.ndarray, U: np.ndarray, C: np.ndarray,
    h: float, stepping: Stepping, columns: np.ndarray, restart: np.ndarray, X: np.ndarray, Y: np.ndarray, J: np.ndarray,
    ends: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """`kernels.rollout`, and the exact derivative of those of its outputs that g differentiates: J (K, N+1, n_rows, n_col).

    g: [derivative, outputs], its `rates` the derivative; columns (5, n_col): the state that a column differentiates with respect to at the
    start, or -1; the parameter, or len(g.wrt); first, last: it counts in steps first..last-1; 1 where it starts again at every restart, as
    it did at the first sample. restart (N+1,): number of the restart at a sample, or -1. ends (K, restarts, n_x, n_col): the derivative of
    the state there, before it.
    """
    n_x, n_sp, n_wrt, n_rows, n_col = X.shape[2], SP.shape[2], len(g.wrt), *J.shape[2:]
    width = n_x + n_wrt + 1
    rows = (n_x + n_rows) * n_col + (n_sp + 5 * n_s + n_rows) * width
    programs = (g.rates, g.linearised, initial.linearised, law.linearised if law else 0)
    more_programs = (g.step, g.columns, initial.columns, law.columns if law else 0)

    def more(here: slice) -> tuple:
        to = (len(J[here]), J.strides[0] // 8, J[here], ends.strides[0] // 8, ends[here])
        return (*more_programs, n_col, n_wrt, *columns, restart, n_rows, *to, np.empty(n_col, np.int64))

    return on_segments(differentiated_loop(), programs, n_s, (X0, SP, U, C), h, stepping, X, Y, rows, more)
