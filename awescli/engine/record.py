"""Recording: run a plain function on symbolic scalars and keep the straight-line program that it performed.

Equal expressions are recorded once (hash-consing), constants are folded, so what stands on the tape is what must be computed.
"""

import math
from collections.abc import Callable, Sequence
from typing import NoReturn

_FOLD: dict[str, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
    "exp": math.exp,
    "log": math.log,
    "atan2": math.atan2,
    "round": round,
    "select": lambda p, a, b: a if p > 0 else b,
}
"""Every operation a tape can hold, and its meaning on floats."""


class Tape:
    """A straight-line program: nodes (op, arguments); an argument is the index of an earlier node.

    Leaves are ("const", value) and ("input", block, i): block names an input vector, i its component.
    """

    def __init__(self):
        self.nodes: list[tuple] = []
        self._known: dict[tuple, int] = {}

    def put(self, node: tuple) -> "Scalar":
        if node not in self._known:
            self._known[node] = len(self.nodes)
            self.nodes.append(node)
        return Scalar(self, self._known[node])

    def constant(self, value: float) -> "Scalar":
        # -0.0 == 0.0 hash alike: keep one of them, so that folding cannot depend on the order of recording
        return self.put(("const", float(value) + 0.0))

    def inputs(self, block: str, size: int) -> list["Scalar"]:
        return [self.put(("input", block, i)) for i in range(size)]

    def operate(self, op: str, *args: "Scalar") -> "Scalar":
        values = [self.nodes[a.index][1] if self.nodes[a.index][0] == "const" else None for a in args]
        if None not in values and op in _FOLD:
            return self.constant(_FOLD[op](*values))
        simpler = _simplify(op, args, values)
        return simpler if simpler is not None else self.put((op, *(a.index for a in args)))


def _simplify(op: str, args: Sequence["Scalar"], values: Sequence[float | None]) -> "Scalar | None":
    """x + 0, x * 1 and their like; None where there is nothing simpler. x * 0 is 0: the tape holds finite numbers."""
    if op == "add":
        return args[1] if values[0] == 0 else args[0] if values[1] == 0 else None
    if op == "sub":
        return args[0] if values[1] == 0 else -args[1] if values[0] == 0 else None
    if op == "mul":
        if 0 in values:
            return args[0].tape.constant(0.0)
        for here, other in ((0, 1), (1, 0)):
            if values[here] == 1:
                return args[other]
            if values[here] == -1:
                return -args[other]
    if op == "div":
        return args[0] if values[1] == 1 else args[0].tape.constant(0.0) if values[0] == 0 else None
    if op == "select" and args[1].index == args[2].index:
        return args[1]
    if op == "neg" and args[0].tape.nodes[args[0].index][0] == "neg":
        return Scalar(args[0].tape, args[0].tape.nodes[args[0].index][1])
    return None


class Scalar:
    """A number on a tape. Behaves as a float in arithmetic; `notation.scalars` finds its functions as methods."""

    __slots__ = ("tape", "index")

    def __init__(self, tape: Tape, index: int):
        self.tape, self.index = tape, index

    def _lift(self, other: "Scalar | float") -> "Scalar":
        return other if isinstance(other, Scalar) else self.tape.constant(other)

    def __add__(self, o: "Scalar | float") -> "Scalar":
        return self.tape.operate("add", self, self._lift(o))

    def __radd__(self, o: "Scalar | float") -> "Scalar":
        return self.tape.operate("add", self._lift(o), self)

    def __sub__(self, o: "Scalar | float") -> "Scalar":
        return self.tape.operate("sub", self, self._lift(o))

    def __rsub__(self, o: "Scalar | float") -> "Scalar":
        return self.tape.operate("sub", self._lift(o), self)

    def __mul__(self, o: "Scalar | float") -> "Scalar":
        return self.tape.operate("mul", self, self._lift(o))

    def __rmul__(self, o: "Scalar | float") -> "Scalar":
        return self.tape.operate("mul", self._lift(o), self)

    def __truediv__(self, o: "Scalar | float") -> "Scalar":
        return self.tape.operate("div", self, self._lift(o))

    def __rtruediv__(self, o: "Scalar | float") -> "Scalar":
        return self.tape.operate("div", self._lift(o), self)

    def __neg__(self) -> "Scalar":
        return self.tape.operate("neg", self)

    def __pow__(self, n: int) -> "Scalar":
        if not isinstance(n, int) or n < 0:
            raise TypeError("a recorded scalar takes whole, non-negative powers; write exp(a * log(x)) for others")
        result = self.tape.constant(1.0)
        for _ in range(n):
            result = result * self
        return result

    def __bool__(self) -> NoReturn:
        raise TypeError("a recorded scalar has no truth value; branch with notation.scalars.select")

    def sqrt(self) -> "Scalar":
        return self.tape.operate("sqrt", self)

    def sin(self) -> "Scalar":
        return self.tape.operate("sin", self)

    def cos(self) -> "Scalar":
        return self.tape.operate("cos", self)

    def tan(self) -> "Scalar":
        return self.sin() / self.cos()

    def exp(self) -> "Scalar":
        return self.tape.operate("exp", self)

    def log(self) -> "Scalar":
        return self.tape.operate("log", self)

    def tanh(self) -> "Scalar":
        # 1 - 2 / (exp(2x) + 1): saturates at +-1 without overflow trouble
        return 1.0 - 2.0 / ((2.0 * self).exp() + 1.0)

    def asin(self) -> "Scalar":
        return self.tape.operate("atan2", self, (1.0 - self * self).sqrt())

    def atan2(self, x: "Scalar | float") -> "Scalar":
        return self.tape.operate("atan2", self, self._lift(x))

    def select(self, then: "Scalar | float", otherwise: "Scalar | float") -> "Scalar":
        return self.tape.operate("select", self, self._lift(then), self._lift(otherwise))


def record(function: Callable[..., Sequence], **sizes: int) -> tuple[Tape, list[int]]:
    """Run `function` on recorded input vectors and return the tape and the indices of its outputs.

    function takes one list of scalars per keyword in `sizes` (name -> length) and returns a sequence of scalars.
    """
    tape = Tape()
    blocks = {name: tape.inputs(name, size) for name, size in sizes.items()}
    outputs = function(**blocks)
    return tape, [(o if isinstance(o, Scalar) else tape.constant(o)).index for o in outputs]


def evaluate(tape: Tape, outputs: Sequence[int], **blocks: Sequence[float]) -> list[float]:
    """Run a tape on floats, one node at a time: slow, and the oracle of the printed code."""
    values: list[float] = []
    for node in tape.nodes:
        if node[0] == "const":
            values.append(node[1])
        elif node[0] == "input":
            values.append(float(blocks[node[1]][node[2]]))
        else:
            values.append(_FOLD[node[0]](*(values[a] for a in node[1:])))
    return [values[o] for o in outputs]
