"""Loops of the corrected kite, printed as those of `kernels`: a rollout that keeps what its gradient needs, and the exact reverse of it.

The rollout is the loop of `kernels` with a network added to the derivative: with null weights both give the same bits. The reverse is
the discrete adjoint: lambda_k = (d x_{k+1} / d x_k)^T lambda_{k+1} + d cost / d x_k, with the step's own Jacobian.
"""

from collections.abc import Callable
from functools import cache

import numpy as np

from awescli.engine.dense import DenseProgram
from awescli.engine.lanes import lane_rows
from awescli.engine.llvm_ir import Body, hexadecimal, print_rowwise
from awescli.engine.machine import LANES
from awescli.simulation.groups import each_group, parts
from awescli.simulation.kernels import COMMON, Loop, compile_loop, passed, rows_of_loop
from awescli.simulation.stepping import Stepping

_NETWORK = ("ptr network", "i64 n_in", "i64 n_rows", "ptr rows", "ptr constants", "ptr weights", "ptr stages", "ptr kept", "i64 n_kept")
_REVERSE = (
    "ptr f", "ptr g", "ptr initial", "ptr law", "i64 n_s", "i64 n_sp", "i64 n_u", "i64 n_y", "i64 samples", "i64 substeps", "double h",
    "double sp_first", "double sp_onward", "ptr sp", "ptr inputs", "ptr c", "ptr X", "ptr Ybar", "ptr alive", "ptr x0bar", "ptr total",
    "ptr work", "ptr accumulate", "ptr turned", "i64 n_delta", *_NETWORK,
)  # fmt: skip
"""Arguments of the printed loops, for one group of lanes; see `rollout` and `gradient`."""


def _add_rows(body: Body, target: str, index: str | None, source: str, i: str) -> None:
    """target[index] += source[i]; index None: i."""
    place = body.row(target, i if index is None else index)
    values = (body.line(f"load {body.type}, ptr {p}, align 8") for p in (place, body.row(source, i)))
    body.lines.append(f"  store {body.type} {body.line(f'fadd {body.type} ' + ', '.join(values))}, ptr {place}, align 8")


def _row_of(body: Body, i: str) -> str:
    """rows[i]: which component of the derivative output i of the network corrects."""
    return body.line(f"load i64, ptr {body.line(f'getelementptr i64, ptr %rows, i64 {i}')}")


class _Keeping(Loop):
    """The loop over the samples of one group, the network in its derivative; every stage and its activations are kept, in order."""

    def __init__(self):
        super().__init__()
        self.wide, self.correction = self.rows(self.whole("add", "%n_s", "%n_in")), self.rows("%n_rows")
        self.stages_so_far = self.line("alloca i64")
        before = self.whole("mul", self.whole("mul", "%first", "%substeps"), 4)
        self.lines.append(f"  store i64 {before}, ptr {self.stages_so_far}")

    def sample(self, u: str, k: str) -> None:
        self.evaluate("%g", self.x, u, self.row("%Y", self.whole("mul", k, "%n_y")))

    def begin_step(self, at_sample: str, derivative: Callable) -> None:
        derivative(0, 0.0, self.x, self.total)

    def derivative(self, stage: int, x: str, k: str) -> None:
        place = self.line(f"load i64, ptr {self.stages_so_far}")
        self.lines.append(f"  store i64 {self.whole('add', place, 1)}, ptr {self.stages_so_far}")
        kept = self.row("%kept", self.whole("mul", place, "%n_kept"))
        self.copy(self.row("%stages", self.whole("mul", place, self.n_x)), x, self.n_x)
        self.evaluate("%f", x, self.u, self.wide)
        seen = self.row(self.wide, "%n_s")
        self.call("%network", f"ptr {seen}", "ptr %constants", "ptr %weights", f"ptr {self.correction}", f"ptr {kept}")
        self.copy(k, self.wide, "%n_s")
        with self.loop("%n_rows") as i:
            _add_rows(self, k, _row_of(self, i), self.correction, i)


class _Reverse(Body):
    """Prints the reverse of `_Keeping` over the samples of one group. Barred names are derivatives of the cost."""

    def __init__(self):
        super().__init__(LANES)
        self.used, self.n_x = "%work", self.whole("add", "%n_s", "%n_sp")
        self.u, self.v, self.seen = self._rows("%n_u"), self._rows(self.n_x), self._rows(self.n_x)
        self.w, self.ybar = self._rows(self.whole("add", "%n_s", "%n_in")), self._rows("%n_rows")
        self.delta, self.xbar, self.before, self.kbar = (self._rows(n) for n in ("%n_delta", "%n_s", "%n_s", "%n_s"))
        self.setpointbar, self.interpolated = self._rows("%n_sp"), self._rows("%n_sp")
        self._print()

    def _rows(self, n: str) -> str:
        here, self.used = self.used, self.row(self.used, n)
        return here

    def _copy(self, to: str, source: str, n: int | str) -> None:
        self.call("@copy", f"ptr {to}", f"ptr {source}", f"i64 {n}")

    def _adjoint(self, address: str, x: str, u: str, w: str) -> None:
        """v = (d program / d x)^T w"""
        self.call(address, *(f"ptr {a}" for a in (x, u, "%c", w, self.v)))

    def _only(self, rows: str, n: str, k: str) -> None:
        """Zero the lanes that ended at sample k or before: what follows a divergence does not count, and may not be a number."""
        self.call("@only", f"ptr {rows}", f"i64 {n}", "ptr %alive", f"i64 {k}")

    def _gather(self) -> None:
        """Add v to the derivatives at the state and at the held set-points."""
        with self.loop("%n_s") as i:
            _add_rows(self, self.xbar, None, self.v, i)
        held = self.row(self.v, "%n_s")
        with self.loop("%n_sp") as i:
            _add_rows(self, self.setpointbar, None, held, i)

    def _at(self, k: int | str) -> tuple[str, str, str]:
        """Rows of the state, the recorded set-points and the inputs of sample k."""
        x, recorded, u = (self.row(p, self.whole("mul", k, n)) for p, n in (("%X", self.n_x), ("%sp", "%n_sp"), ("%inputs", "%n_u")))
        return x, recorded, u

    def _through_law(self, x: str, recorded: str, u: str) -> None:
        """v = (d law / d x)^T setpointbar where the law saw the state and the recorded set-points."""
        self._copy(self.seen, x, "%n_s")
        self._copy(self.row(self.seen, "%n_s"), recorded, "%n_sp")
        self._adjoint("%law", self.seen, u, self.setpointbar)

    def _print(self) -> None:
        substeps = self.line("sitofp i64 %substeps to double")
        step = self.line(f"fdiv double %h, {substeps}")
        half, third, sixth = (self.line(f"fdiv double {step}, {hexadecimal(d)}") for d in (2.0, 3.0, 6.0))
        last = self.whole("sub", "%samples", 1)
        with self.loop("%samples") as done:
            k = self.whole("sub", last, done)
            x, recorded, u = self._at(k)
            self.call("@zero", f"ptr {self.setpointbar}", "i64 %n_sp")
            with self.when(self.line(f"icmp slt i64 {k}, {last}")), self.loop("%substeps") as further:
                sub = self.whole("sub", self.whole("sub", "%substeps", 1), further)
                first = self.whole("mul", self.whole("add", self.whole("mul", k, "%substeps"), sub), 4)
                self._copy(self.before, self.xbar, "%n_s")
                for j, at, share, onward in ((3, 1.0, sixth, None), (2, 0.5, third, step), (1, 0.5, third, half), (0, 0.0, sixth, half)):
                    along = self.line(f"fadd double {self.line(f'sitofp i64 {sub} to double')}, {hexadecimal(at)}")
                    part = self.line(f"fdiv double {along}, {substeps}")
                    self.call("@between", f"ptr {self.u}", f"ptr {u}", f"ptr {self.row(u, '%n_u')}", f"double {part}", "i64 %n_u")
                    if onward is None:
                        self.call("@scaled", f"ptr {self.kbar}", f"ptr {self.before}", f"double {share}", "i64 %n_s")
                    else:
                        vectors = (f"ptr {a}" for a in (self.kbar, self.before, self.v))
                        self.call("@combined", *vectors, f"double {share}", f"double {onward}", "i64 %n_s")
                    self._stage(self.whole("add", first, j), self.whole("add", k, 1))
                self._set_points_within(k, sub, self.row("%stages", self.whole("mul", first, self.n_x)), recorded)
            self._adjoint("%g", x, u, self.row("%Ybar", self.whole("mul", k, "%n_y")))
            self._only(self.v, self.n_x, k)
            self._gather()
            with self.when(self.line("icmp ne ptr %law, null")):
                self._through_law(x, recorded, u)
                with self.loop("%n_s") as i:
                    _add_rows(self, self.xbar, None, self.v, i)
        self._start()

    def _set_points_within(self, k: str, sub: str, x: str, recorded: str) -> None:
        """Where a step has set-points of its own: through the law that was asked at its begin, with the state x and the inputs there (those
        of the first stage, which was the last to be reversed), or else they are recorded ones."""
        along = self.line(f"fmul double %sp_onward, {self.line(f'sitofp i64 {sub} to double')}")
        share = self.line(f"fadd double %sp_first, {along}")
        with self.when(self.line(f"fcmp one double {share}, {hexadecimal(0.0)}")):
            with self.when(self.line("icmp ne ptr %law, null")):
                vectors = (f"ptr {a}" for a in (self.interpolated, recorded, self.row(recorded, "%n_sp")))
                self.call("@between", *vectors, f"double {share}", "i64 %n_sp")
                self._through_law(x, self.interpolated, self.u)
                self._only(self.v, self.n_x, self.whole("add", k, 1))
                with self.loop("%n_s") as i:
                    _add_rows(self, self.xbar, None, self.v, i)
            self.call("@zero", f"ptr {self.setpointbar}", "i64 %n_sp")

    def _stage(self, place: str, after: str) -> None:
        """v = (d corrected derivative / d x)^T kbar at a kept stage, and the weights' share; `after`: the sample that the step leads to."""
        x, kept = self.row("%stages", self.whole("mul", place, self.n_x)), self.row("%kept", self.whole("mul", place, "%n_kept"))
        with self.loop("%n_rows") as i:
            self._copy(self.row(self.ybar, i), self.row(self.kbar, _row_of(self, i)), 1)
        self._copy(self.w, self.kbar, "%n_s")
        arguments = ("%constants", "%weights", kept, self.ybar, self.delta, self.row(self.w, "%n_s"))
        self.call("%network", *(f"ptr {a}" for a in arguments))
        self._adjoint("%f", x, self.u, self.w)
        for rows, n in ((self.v, self.n_x), (self.delta, "%n_delta"), (kept, "%n_kept")):
            self._only(rows, n, after)
        self.call("%accumulate", *(f"ptr {a}" for a in (kept, self.delta, "%turned", "%total")))
        self._gather()

    def _start(self) -> None:
        """Through the effects' own states at the first sample, and what the law said there, to the start."""
        x, recorded, u = self._at(0)
        self._adjoint("%initial", x, u, self.row(self.xbar, 12))
        self._copy("%x0bar", self.xbar, 12)
        with self.loop(12) as i:
            _add_rows(self, "%x0bar", None, self.v, i)
        own = self.whole("sub", "%n_s", 12)
        with_own = self.line(f"icmp sgt i64 {own}, 0")
        with self.when(self.line(f"and i1 {with_own}, {self.line('icmp ne ptr %law, null')}")):
            self._copy(self.setpointbar, self.row(self.v, "%n_s"), "%n_sp")
            # the law spoke before the effects' states were known
            self._copy(self.w, x, 12)
            self.call("@zero", f"ptr {self.row(self.w, 12)}", f"i64 {own}")
            self._through_law(self.w, recorded, u)
            with self.loop(12) as i:
                _add_rows(self, "%x0bar", None, self.v, i)


def _print_only() -> str:
    """only(a, n, alive, k): zero n rows in the lanes where alive <= k."""
    body, whole = Body(LANES), f"<{LANES} x i64>"
    first = body.line(f"insertelement {whole} poison, i64 %k, i64 0")
    limit = body.line(f"shufflevector {whole} {first}, {whole} poison, <{LANES} x i32> zeroinitializer")
    on = body.line(f"icmp sgt {whole} {body.line(f'load {whole}, ptr %alive, align 8')}, {limit}")
    with body.loop("%n") as i:
        place = body.row("%a", i)
        value = body.line(f"load {body.type}, ptr {place}, align 8")
        kept = body.line(f"select <{LANES} x i1> {on}, {body.type} {value}, {body.type} zeroinitializer")
        body.lines.append(f"  store {body.type} {kept}, ptr {place}, align 8")
    return body.function("only", ("ptr %a", "i64 %n", "ptr %alive", "i64 %k"), "internal")


@cache
def _rollout() -> Callable:
    arguments = (*COMMON, *_NETWORK)
    return compile_loop(_Keeping().text("loop", arguments), arguments)


@cache
def _gradient() -> Callable:
    text = _Reverse().function("loop", [f"{kind} %{name}" for kind, name in (a.split() for a in _REVERSE)]) + _print_only()
    text += _print_zero()
    text += print_rowwise("scaled", lambda a, s: s * a, 1, 1, LANES)
    text += print_rowwise("combined", lambda a, b, s, t: s * a + t * b, 2, 2, LANES)
    return compile_loop(text, _REVERSE)


def _print_zero() -> str:
    body = Body(LANES)
    with body.loop("%n") as i:
        body.lines.append(f"  store {body.type} zeroinitializer, ptr {body.row('%a', i)}, align 8")
    return body.function("zero", ("ptr %a", "i64 %n"), "internal")


def rollout(
    f: int, g: int, initial: int, law: int | None, network: DenseProgram, n_s: int, rows: np.ndarray, constants: np.ndarray,
    weights: np.ndarray, X0: np.ndarray, SP: np.ndarray, U: np.ndarray, C: np.ndarray, h: float, stepping: Stepping, X: np.ndarray,
    Y: np.ndarray, stages: np.ndarray, kept: np.ndarray, alive: np.ndarray,
) -> None:  # fmt: skip
    """Simulate, and keep. f: [derivative, network inputs]; network: a `DenseProgram`; rows: which derivatives it corrects; others as
    `kernels.rollout`. Fills also stages (G, K*substeps, 4, n_x, L) and kept (G, K*substeps, 4, n_kept, L)."""
    G, samples, n_x, _ = X.shape
    n_u, n_y, loop = U.shape[2], Y.shape[2], _rollout()
    sizes = (n_s, SP.shape[2], n_u, n_y, samples, stepping.substeps, h, stepping.first, stepping.onward)
    rows, constants, weights = _plain(rows, constants, weights)
    of_network = (network.value, network.sizes[0], len(rows), rows, constants, weights)

    def work(group):
        scratch = lane_rows(rows_of_loop(n_x, n_s, n_u, n_y) + n_s + network.sizes[0] + len(rows))
        own = (*(a[group] for a in (X0, SP, U, C, X, Y, alive)), scratch, *of_network, stages[group], kept[group], network.kept)
        for first, until in parts(samples):
            if first:
                yield
            loop(*passed(f, g, initial, law, *sizes, first, until, *own))

    each_group(work, G)


def gradient(
    f: int, g: int, initial: int, law: int | None, network: DenseProgram, n_s: int, rows: np.ndarray, constants: np.ndarray,
    weights: np.ndarray, SP: np.ndarray, U: np.ndarray, C: np.ndarray, h: float, stepping: Stepping, X: np.ndarray, Ybar: np.ndarray,
    stages: np.ndarray, kept: np.ndarray, alive: np.ndarray, X0bar: np.ndarray, Wbar: np.ndarray,
) -> None:  # fmt: skip
    """Reverse of `rollout` for d cost / d Y = Ybar (G, K+1, n_y, L). f, g, initial, law: `adjoint` addresses; network: a `DenseProgram`.

    Fills X0bar (G, 12, L) = d cost / d starts and Wbar (G, n_weights), each group's d cost / d weights. Uses up kept.
    """
    G, samples, n_x, _ = X.shape
    n_u, loop = U.shape[2], _gradient()
    sizes = (n_s, SP.shape[2], n_u, Ybar.shape[2], samples, stepping.substeps, h, stepping.first, stepping.onward)
    rows, constants, weights = _plain(rows, constants, weights)
    of_network = (network.deltas, network.backward, network.sizes[0], len(rows), rows, constants, weights)

    def work(group):
        scratch = lane_rows(n_u + 4 * n_x + 3 * n_s + network.sizes[0] + len(rows) + network.deltas)
        total, turned = np.zeros(network.padded), np.zeros(network.turned)
        own = (*(a[group] for a in (SP, U, C, X, Ybar, alive, X0bar)), total, scratch, network.accumulate, turned)
        loop(*passed(f, g, initial, law, *sizes, *own, *of_network, stages[group], kept[group], network.kept))
        Wbar[group] = total[network.where]
        yield

    each_group(work, G)


def _plain(rows: np.ndarray, constants: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The arrays in one piece each, of the kinds that the loops read."""
    return np.ascontiguousarray(rows, np.int64), np.ascontiguousarray(constants, float), np.ascontiguousarray(weights, float)
