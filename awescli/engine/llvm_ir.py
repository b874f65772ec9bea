"""Print a tape as LLVM IR that works on `lanes` independent evaluations at once.

Arrays that the printed functions see are (size, lanes) float64, lanes contiguous. From a tape is printed

    value(x, u, c, y)      y = f(x, u, c)

No FMA is formed outside sin, cos, exp, atan2, so a term that is null changes nothing to the last bit. Derivatives: `linearised`, `adjoint`.
"""

import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from awescli.engine.record import Tape, record

_BINARY = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_CALLS = {"sqrt": 1, "sin": 1, "cos": 1, "exp": 1, "log": 1, "atan2": 2, "round": 1}


class Printer:
    """Prints the nodes of one tape into the body of one function, each node once, on demand. fused: FMA may be formed of them."""

    def __init__(self, tape: Tape, lanes: int):
        self.tape, self.lanes = tape, lanes
        self.type = f"<{lanes} x double>"
        self.lines: list[str] = []
        self._names: dict[int, str] = {}
        self._count = 0
        self.fused = False

    def fresh(self) -> str:
        self._count += 1
        return f"%v{self._count}"

    def line(self, text: str) -> str:
        name = self.fresh()
        self.lines.append(f"  {name} = {text}")
        return name

    def node(self, index: int) -> str:
        """The SSA name that holds a node, printing what it needs first (iteratively: tapes are deep)."""
        stack = [index]
        while stack:
            top = stack[-1]
            if top in self._names:
                stack.pop()
                continue
            if name := self.known(top):
                self._names[top] = name
                continue
            node = self.tape.nodes[top]
            waiting = [] if node[0] in ("const", "input") else [a for a in node[1:] if a not in self._names]
            if waiting:
                stack.extend(waiting)
                continue
            self._names[top] = self._print(node)
            stack.pop()
        return self._names[index]

    def known(self, index: int) -> str | None:
        """The name of a node that need not be computed; None where it must be."""
        return None

    def _print(self, node: tuple) -> str:
        op, *args = node
        t = self.type
        if op == "const":
            return self._splat(args[0])
        if op == "input":
            return self.load(args[0], str(args[1]))
        names = [self._names[a] for a in args]
        if op in _BINARY:
            return self.line(f"{_BINARY[op]}{' contract' if self.fused else ''} {t} {names[0]}, {names[1]}")
        if op == "neg":
            return self.line(f"fneg {t} {names[0]}")
        if op == "select":
            positive = self.line(f"fcmp ogt {t} {names[0]}, zeroinitializer")
            return self.line(f"select <{self.lanes} x i1> {positive}, {t} {names[1]}, {t} {names[2]}")
        return self.line(f"call {t} @{op}_({', '.join(f'{t} {n}' for n in names)})")

    def _splat(self, value: float) -> str:
        return f"<{', '.join([f'double {hexadecimal(value)}'] * self.lanes)}>"

    def load(self, block: str, row: str) -> str:
        pointer = self.line(f"getelementptr {self.type}, ptr %{block}, i64 {row}")
        return self.line(f"load {self.type}, ptr {pointer}, align 8")

    def store(self, value: str, block: str, row: str) -> None:
        pointer = self.line(f"getelementptr {self.type}, ptr %{block}, i64 {row}")
        self.lines.append(f"  store {self.type} {value}, ptr {pointer}, align 8")


def hexadecimal(value: float) -> str:
    """A double as LLVM writes it exactly."""
    return f"0x{struct.unpack('>Q', struct.pack('>d', value))[0]:016X}"


def print_value(tape: Tape, outputs: Sequence[int], lanes: int) -> str:
    """The function `value`."""
    body = Printer(tape, lanes)
    for i, output in enumerate(outputs):
        body.store(body.node(output), "y", str(i))
    lines = "\n".join(body.lines)
    return f"define void @value(ptr noalias %x, ptr noalias %u, ptr noalias %c, ptr noalias %y) {{\nentry:\n{lines}\n  ret void\n}}\n"


def print_functions(used: set[str], lanes: int) -> str:
    """Definitions of sin_, cos_, ... on `lanes` numbers: printed from the approximations, or calls of libm."""
    from awescli.engine.approximations import APPROXIMATIONS

    t = f"<{lanes} x double>"
    text, declared = [], set()
    pending = sorted(used)
    while pending:
        op = pending.pop()
        if op in declared:
            continue
        declared.add(op)
        arguments = ", ".join(f"{t} %a{i}" for i in range(_CALLS.get(op, 1)))
        if op in APPROXIMATIONS:
            tape, output = APPROXIMATIONS[op]()
            body = _ArgumentPrinter(tape, lanes)
            body.fused = True
            result = body.node(output)
            lines = "\n".join(body.lines)
            text.append(f"define internal {t} @{op}_({arguments}) alwaysinline {{\n{lines}\n  ret {t} {result}\n}}\n")
            pending += [n[0] for n in tape.nodes if n[0] in _CALLS or n[0] == "power_of_two"]
        elif op == "power_of_two":
            i = f"<{lanes} x i64>"
            bias, shift = (f"<{', '.join([f'i64 {k}'] * lanes)}>" for k in (1023, 52))
            text.append(
                f"define internal {t} @power_of_two_({arguments}) alwaysinline {{\n  %n = fptosi {t} %a0 to {i}\n"
                f"  %b = add {i} %n, {bias}\n  %s = shl {i} %b, {shift}\n  %r = bitcast {i} %s to {t}\n  ret {t} %r\n}}\n"
            )
        else:
            intrinsic = {"round": "roundeven"}.get(op, op)
            text.append(
                f"declare {t} @llvm.{intrinsic}.v{lanes}f64({t})\n"
                f"define internal {t} @{op}_({arguments}) alwaysinline {{\n"
                f"  %r = call {t} @llvm.{intrinsic}.v{lanes}f64({t} %a0)\n  ret {t} %r\n}}\n"
            )
    return "".join(text)


class _ArgumentPrinter(Printer):
    """Prints a tape whose inputs are the arguments %a0, %a1 of a function."""

    def load(self, block: str, row: str) -> str:
        return f"%a{row}"


def calls_of(tape: Tape) -> set[str]:
    return {n[0] for n in tape.nodes if n[0] in _CALLS}


class Body(Printer):
    """The lines of a function with loops and branches, which calls printed functions by their address.

    Vectors are addresses of rows of `lanes` numbers; whole numbers are i64, as names or as digits.
    """

    def __init__(self, lanes: int):
        super().__init__(Tape(), lanes)
        self.block = "entry"

    def whole(self, op: str, a: int | str, b: int | str) -> str:
        """add, mul, sub ... of two whole numbers"""
        return self.line(f"{op} i64 {a}, {b}")

    def row(self, pointer: str, index: int | str) -> str:
        """Address of row `index` behind an address."""
        return self.line(f"getelementptr {self.type}, ptr {pointer}, i64 {index}")

    def call(self, function: str, *arguments: str) -> None:
        """Call a function that returns nothing; arguments with their types: "ptr %x"."""
        self.lines.append(f"  call void {function}({', '.join(arguments)})")

    def label(self, name: str) -> None:
        self.lines.append(f"{name}:")
        self.block = name

    @contextmanager
    def loop(self, count: int | str) -> Iterator[str]:
        """for i in range(count): the index is what `as` names."""
        i, number = self.fresh(), self._count
        before, place = self.block, len(self.lines) + 2
        self.lines.append(f"  br label %head{number}")
        self.label(f"head{number}")
        self.lines.append("")  # the phi node, known when the body is
        more = self.line(f"icmp slt i64 {i}, {count}")
        self.lines.append(f"  br i1 {more}, label %body{number}, label %end{number}")
        self.label(f"body{number}")
        yield i
        after = self.whole("add", i, 1)
        self.lines.append(f"  br label %head{number}")
        self.lines[place] = f"  {i} = phi i64 [ 0, %{before} ], [ {after}, %{self.block} ]"
        self.label(f"end{number}")

    @contextmanager
    def when(self, condition: str) -> Iterator[None]:
        """if condition: an i1."""
        self._count += 1
        number = self._count
        self.lines.append(f"  br i1 {condition}, label %then{number}, label %after{number}")
        self.label(f"then{number}")
        yield
        self.lines.append(f"  br label %after{number}")
        self.label(f"after{number}")

    def function(self, name: str, arguments: Sequence[str], linkage: str = "") -> str:
        """The finished definition; arguments with their types."""
        lines = "\n".join(self.lines)
        return f"define {linkage} void @{name}({', '.join(arguments)}) {{\nentry:\n{lines}\n  ret void\n}}\n"


class _RowPrinter(Body):
    """Prints a tape whose input block "v" are rows of the vectors %p0, %p1, ..., and block "s" numbers %s0, ... on all lanes."""

    index = ""

    def load(self, block: str, row: str) -> str:
        if block == "v":
            return self.line(f"load {self.type}, ptr {self.row(f'%p{row}', self.index)}, align 8")
        first = self.line(f"insertelement {self.type} poison, double %s{row}, i64 0")
        return self.line(f"shufflevector {self.type} {first}, {self.type} poison, <{self.lanes} x i32> zeroinitializer")


def print_rowwise(name: str, function: Callable, vectors: int, scalars: int, lanes: int) -> str:
    """The function name(out, p0, p1, ..., s0, ..., n): out[i] = function(v, s) for n rows; out may be one of the vectors.

    Where function has several results, there are as many `out`.
    """

    def listed(v, s):
        found = function(*v, *s)
        return found if isinstance(found, tuple) else (found,)

    tape, outputs = record(listed, v=vectors, s=scalars)
    body = _RowPrinter(lanes)
    body.tape = tape
    with body.loop("%n") as body.index:
        for i, result in enumerate([body.node(output) for output in outputs]):
            body.lines.append(f"  store {body.type} {result}, ptr {body.row(f'%out{i}', body.index)}, align 8")
    pointers = [*(f"ptr %out{i}" for i in range(len(outputs))), *(f"ptr %p{i}" for i in range(vectors))]
    return body.function(name, [*pointers, *(f"double %s{i}" for i in range(scalars)), "i64 %n"], "internal")
