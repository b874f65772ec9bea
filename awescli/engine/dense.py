"""Print a small tanh network, with its fading outside a box, as LLVM IR on `lanes` evaluations at once.

Weights are plain numbers shared by all lanes: one is broadcast as it is used, so 1,800 of them stay in the nearest cache (lane by
lane they would fill the second). The network is `n` inputs -> tanh layers -> `m` linear outputs, times fade and scale:

    z_i = (s_i - mean_i) / deviation_i
    fade = exp(-sum_i e_i^2),  e_i = max(0, |z_i - middle_i| / half_i - 1) / width
    y_k = scale_k fade (W z + b)_k                                          of the last layer; tanh before

    value(s, constants, weights, y, kept)            kept: z, activations of the hidden layers, outputs, fade (rows of lanes)
    backward(constants, weights, kept, ybar, delta, sbar)    delta: derivatives at the layers' sums, hidden ones first; sbar: at s
    accumulate(kept, delta, rows, total)             total += delta x activations, all lanes: the derivative at the weights

weights: per layer W (out, in) by rows, then b (out). constants: mean, 1/deviation, middle, 1/half (n each), scale (m), 1/width.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from awescli.engine.llvm_ir import Body, Printer, hexadecimal, print_functions
from awescli.engine.machine import LANES, _compile
from awescli.engine.record import Tape

TOGETHER = 8
"""Sums accumulated side by side: enough to hide the latency of a multiply-add, few enough for the registers."""


@dataclass(frozen=True)
class DenseProgram:
    """A compiled network of layer widths `sizes`. value, backward, accumulate: addresses; kept, deltas: rows that they store;
    padded: numbers in `total`; where: (n,) of them the weights are; turned: numbers that `rows` must hold, all zero at first."""

    sizes: tuple[int, ...]
    value: int
    backward: int
    accumulate: int
    padded: int
    turned: int
    where: np.ndarray = field(repr=False, compare=False)

    @property
    def kept(self) -> int:
        return sum(self.sizes) + 1

    @property
    def deltas(self) -> int:
        return sum(self.sizes[1:])


def weight_count(sizes: Sequence[int]) -> int:
    """Number of weights and biases of a network with these layer widths."""
    return sum((a + 1) * b for a, b in zip(sizes, sizes[1:], strict=False))


def layer_slices(sizes: Sequence[int]) -> list[tuple[slice, slice]]:
    """Where W and b of each layer stand in the weights."""
    places, at = [], 0
    for a, b in zip(sizes, sizes[1:], strict=False):
        places.append((slice(at, at + a * b), slice(at + a * b, at + (a + 1) * b)))
        at += (a + 1) * b
    return places


def compile_network(sizes: Sequence[int]) -> DenseProgram:
    """Print and compile a network of these widths (inputs, hidden layers, outputs)."""
    sizes = tuple(int(n) for n in sizes)
    text = print_network(sizes, LANES) + print_backward(sizes, LANES) + print_accumulate(sizes, LANES)
    engine = _compile(text + print_functions({"exp"}, LANES))
    value, backward, accumulate = (engine.get_function_address(name) for name in ("value", "backward", "accumulate"))
    where, padded = _padded(sizes, LANES)
    turned = LANES * max(_whole_rows(n, LANES) for n in sizes[:-1])
    return DenseProgram(sizes, value, backward, accumulate, padded, turned, where)


FARTHEST = 100.0
"""The exponent of the fade is kept below this: exp(-100) is nothing, and products with it are no slow denormal numbers."""


class _Writer(Printer):
    """Lines of vector arithmetic without a tape. inverse_width: the name of 1/width once it is loaded."""

    def __init__(self, lanes: int, sizes: Sequence[int]):
        super().__init__(Tape(), lanes)
        self.inverse_width = self.broadcast("constants", 4 * sizes[0] + sizes[-1])

    def op(self, name: str, a: str, b: str) -> str:
        return self.line(f"{name} contract {self.type} {a}, {b}")

    def number(self, value: float) -> str:
        return f"<{', '.join([f'double {hexadecimal(value)}'] * self.lanes)}>"

    def broadcast(self, block: str, at: int) -> str:
        """Number `at` of a block of plain doubles, on all lanes."""
        pointer = self.line(f"getelementptr double, ptr %{block}, i64 {at}")
        scalar = self.line(f"load double, ptr {pointer}, align 8")
        first = self.line(f"insertelement {self.type} poison, double {scalar}, i64 0")
        return self.line(f"shufflevector {self.type} {first}, {self.type} poison, <{self.lanes} x i32> zeroinitializer")

    def exp(self, a: str) -> str:
        return self.line(f"call {self.type} @exp_({self.type} {a})")

    def tanh(self, a: str) -> str:
        """1 - 2 / (exp(2 a) + 1)"""
        e = self.op("fadd", self.exp(self.op("fmul", a, self.number(2.0))), self.number(1.0))
        return self.op("fsub", self.number(1.0), self.op("fdiv", self.number(2.0), e))

    def sums(self, inputs: list[str], count: int, weight_at: Callable[[int, int], int], start: Callable[[int], str]) -> list[str]:
        """[start(i) + sum_j weight(i, j) inputs[j] for i], a few i side by side."""
        out = []
        for first in range(0, count, TOGETHER):
            rows = range(first, min(first + TOGETHER, count))
            totals = {i: start(i) for i in rows}
            for j, a in enumerate(inputs):
                for i in rows:
                    totals[i] = self.op("fadd", totals[i], self.op("fmul", self.broadcast("weights", weight_at(i, j)), a))
            out += totals.values()
        return out

    def excess(self, z: str, i: int, n: int) -> tuple[str, str]:
        """(how far input i is outside the box, its derivative with respect to z_i)"""
        t = self.type
        inverse_half, inverse_width = self.broadcast("constants", 3 * n + i), self.inverse_width
        d = self.op("fsub", z, self.broadcast("constants", 2 * n + i))
        positive = self.line(f"fcmp ogt {t} {d}, zeroinitializer")
        slope = self.op("fmul", inverse_half, inverse_width)
        signed = self.line(f"select <{self.lanes} x i1> {positive}, {t} {slope}, {t} {self.op('fsub', 'zeroinitializer', slope)}")
        e = self.op("fsub", self.op("fmul", d, signed), inverse_width)
        outside = self.line(f"fcmp ogt {t} {e}, zeroinitializer")
        keep = lambda v: self.line(f"select <{self.lanes} x i1> {outside}, {t} {v}, {t} zeroinitializer")  # noqa: E731
        return keep(e), keep(signed)


def print_network(sizes: Sequence[int], lanes: int) -> str:
    """The function `value`."""
    w, n = _Writer(lanes, sizes), sizes[0]
    layer, row = [], 0
    fading = "zeroinitializer"
    for i in range(n):
        centred = w.op("fsub", w.load("s", str(i)), w.broadcast("constants", i))
        layer.append(w.op("fmul", centred, w.broadcast("constants", n + i)))
        w.store(layer[-1], "kept", str(row))
        row += 1
        e, _ = w.excess(layer[-1], i, n)
        fading = w.op("fadd", fading, w.op("fmul", e, e))
    far = w.line(f"fcmp ogt {w.type} {fading}, {w.number(FARTHEST)}")
    fading = w.line(f"select <{lanes} x i1> {far}, {w.type} {w.number(FARTHEST)}, {w.type} {fading}")
    fade = w.exp(w.op("fsub", "zeroinitializer", fading))
    for number, (W, b) in enumerate(layer_slices(sizes)):
        a = len(layer)
        bias = lambda i, b=b: w.broadcast("weights", b.start + i)  # noqa: E731
        layer = w.sums(layer, sizes[number + 1], lambda i, j, W=W, a=a: W.start + i * a + j, bias)
        if number < len(sizes) - 2:
            layer = [w.tanh(s) for s in layer]
        for value in layer:
            w.store(value, "kept", str(row))
            row += 1
    w.store(fade, "kept", str(row))
    for k, out in enumerate(layer):
        w.store(w.op("fmul", w.op("fmul", w.broadcast("constants", 4 * n + k), fade), out), "y", str(k))
    return _function("value", ("s", "constants", "weights", "y", "kept"), w)


def print_backward(sizes: Sequence[int], lanes: int) -> str:
    """The function `backward`."""
    w, n, m = _Writer(lanes, sizes), sizes[0], sizes[-1]
    starts = [sum(sizes[:k]) for k in range(len(sizes) + 1)]  # rows of `kept` where each layer begins, then fade
    fade = w.load("kept", str(starts[-1]))
    delta, fadebar = [], "zeroinitializer"
    for k in range(m):
        scaled = w.op("fmul", w.load("ybar", str(k)), w.broadcast("constants", 4 * n + k))
        delta.append(w.op("fmul", scaled, fade))
        fadebar = w.op("fadd", fadebar, w.op("fmul", scaled, w.load("kept", str(starts[-2] + k))))
    places, back = layer_slices(sizes), []
    for number in range(len(places) - 1, -1, -1):
        for i, d in enumerate(delta):
            w.store(d, "delta", str(starts[number + 1] - n + i))
        W, a = places[number][0], sizes[number]
        back = w.sums(delta, a, lambda i, j, W=W, a=a: W.start + j * a + i, lambda i: "zeroinitializer")
        if number == 0:
            break
        delta = []
        for i, abar in enumerate(back):
            h = w.load("kept", str(starts[number] + i))
            delta.append(w.op("fmul", abar, w.op("fsub", w.number(1.0), w.op("fmul", h, h))))
    steep = w.op("fmul", w.op("fmul", fadebar, fade), w.number(-2.0))
    for i, zbar in enumerate(back):
        e, slope = w.excess(w.load("kept", str(i)), i, n)
        total = w.op("fadd", zbar, w.op("fmul", steep, w.op("fmul", e, slope)))
        w.store(w.op("fmul", total, w.broadcast("constants", n + i)), "sbar", str(i))
    return _function("backward", ("constants", "weights", "kept", "ybar", "delta", "sbar"), w)


def _whole_rows(n: int, lanes: int) -> int:
    """n numbers, filled up to whole vectors."""
    return -(-n // lanes) * lanes


def _padded(sizes: Sequence[int], lanes: int) -> tuple[np.ndarray, int]:
    """(where each weight stands in `total`, its length): rows of W are filled up to whole vectors, biases follow."""
    where, at = [], 0
    for n, m in zip(sizes, sizes[1:], strict=False):
        wide = _whole_rows(n, lanes)
        where += [at + i * wide + j for i in range(m) for j in range(n)]
        where += [at + m * wide + i for i in range(m)]
        at += m * wide + m
    return np.array(where), at


def print_accumulate(sizes: Sequence[int], lanes: int) -> str:
    """The function `accumulate`.

    Activations are turned first, so that a vector runs along a row of W: the rows stay in the nearest cache, where one product over a
    whole rollout would fetch everything from memory again.
    """
    w, t = Body(lanes), f"<{lanes} x double>"

    def number(block: str, index) -> str:
        return w.line(f"getelementptr double, ptr %{block}, i64 {index}")

    def vector(pointer: str) -> str:
        return w.line(f"load {t}, ptr {pointer}, align 8")

    def add_to(pointer: str, value: str, kind: str) -> None:
        total = w.line(f"fadd contract {kind} {w.line(f'load {kind}, ptr {pointer}, align 8')}, {value}")
        w.lines.append(f"  store {kind} {total}, ptr {pointer}, align 8")

    place = first_a = first_d = 0
    for n, m in zip(sizes, sizes[1:], strict=False):
        wide = _whole_rows(n, lanes)
        with w.loop(n) as i:
            a = vector(w.row("%kept", w.whole("add", i, first_a)))
            for lane in range(lanes):
                one = w.line(f"extractelement {t} {a}, i64 {lane}")
                w.lines.append(f"  store double {one}, ptr {number('rows', w.whole('add', i, lane * wide))}, align 8")
        with w.loop(m) as i:
            e = vector(w.row("%delta", w.whole("add", i, first_d)))
            each = [
                w.line(f"shufflevector {t} {e}, {t} poison, <{lanes} x i32> <{', '.join([f'i32 {lane}'] * lanes)}>")
                for lane in range(lanes)
            ]
            row = w.whole("add", w.whole("mul", i, wide), place)
            with w.loop(wide // lanes) as q:
                j = w.whole("mul", q, lanes)
                sums = ["zeroinitializer", "zeroinitializer"]
                for lane, spread in enumerate(each):
                    product = w.line(f"fmul contract {t} {spread}, {vector(number('rows', w.whole('add', j, lane * wide)))}")
                    sums[lane % 2] = w.line(f"fadd contract {t} {sums[lane % 2]}, {product}")
                add_to(number("total", w.whole("add", row, j)), w.line(f"fadd contract {t} {sums[0]}, {sums[1]}"), t)
            over_lanes = w.line(f"call double @llvm.vector.reduce.fadd.v{lanes}f64(double -0.0, {t} {e})")
            add_to(number("total", w.whole("add", i, place + m * wide)), over_lanes, "double")
        place, first_a, first_d = place + m * wide + m, first_a + n, first_d + m
    text = w.function("accumulate", [f"ptr noalias %{a}" for a in ("kept", "delta", "rows", "total")])
    return text + f"declare double @llvm.vector.reduce.fadd.v{lanes}f64(double, {t})\n"


def _function(name: str, arguments: Sequence[str], w: Printer) -> str:
    lines = "\n".join(w.lines)
    return f"define void @{name}({', '.join(f'ptr noalias %{a}' for a in arguments)}) {{\nentry:\n{lines}\n  ret void\n}}\n"
