"""Print the reverse of a tape: adjoint(x, u, c, w, v) with v = (df/dx)^T w, on `lanes` evaluations at once.

One backward sweep (Griewank & Walther, Evaluating Derivatives, ch. 3) costs about three evaluations of f, whatever the number of
states: what a gradient of one scalar cost through many steps needs. `linearised` is for many columns.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from awescli.engine.derive import _is_zero, _partials, _reachable_from
from awescli.engine.llvm_ir import Printer, calls_of, print_functions, print_value
from awescli.engine.machine import LANES, _compile
from awescli.engine.record import Scalar, Tape, record


@dataclass(frozen=True)
class Reversible:
    """A compiled function y = f(x, u, c) and its reverse. value, adjoint: addresses of value(x, u, c, y) and
    adjoint(x, u, c, w, v)."""

    n_x: int
    n_y: int
    value: int
    adjoint: int


def compile_reversible(function: Callable[..., Sequence], n_x: int, n_u: int, n_c: int) -> Reversible:
    """Record `function(x, u, c)` (lists of scalars in, sequence of scalars out), reverse it, compile both."""
    tape, outputs = record(function, x=n_x, u=n_u, c=n_c)
    text = print_value(tape, outputs, LANES) + print_adjoint(tape, outputs, n_x, LANES)
    engine = _compile(text + print_functions(calls_of(tape), LANES))
    return Reversible(n_x, len(outputs), engine.get_function_address("value"), engine.get_function_address("adjoint"))


def reverse(tape: Tape, outputs: Sequence[int], n_x: int) -> list[int]:
    """Record (df/dx)^T w on the same tape, w its new input block: the node of each component of the result."""
    x = [tape.put(("input", "x", i)).index for i in range(n_x)]
    active = set(x)
    order = sorted(_reachable_from(tape, outputs))
    for index in order:
        if tape.nodes[index][0] not in ("const", "input") and any(a in active for a in tape.nodes[index][1:]):
            active.add(index)
    bar: dict[int, Scalar] = {}
    for i, output in enumerate(outputs):
        if output in active:
            w = tape.put(("input", "w", i))
            bar[output] = bar[output] + w if output in bar else w
    for index in reversed(order):
        if index in bar and tape.nodes[index][0] not in ("const", "input"):
            for argument, partial in _partials(tape, index):
                if argument in active and not _is_zero(partial):
                    term = bar[index] * partial
                    bar[argument] = bar[argument] + term if argument in bar else term
    zero = tape.constant(0.0)
    return [bar.get(i, zero).index for i in x]


def print_adjoint(tape: Tape, outputs: Sequence[int], n_x: int, lanes: int) -> str:
    """The function `adjoint`."""
    body = Printer(tape, lanes)
    body.fused = True
    for i, node in enumerate(reverse(tape, outputs, n_x)):
        body.store(body.node(node), "v", str(i))
    lines = "\n".join(body.lines)
    signature = "ptr noalias %x, ptr noalias %u, ptr noalias %c, ptr noalias %w, ptr noalias %v"
    return f"define void @adjoint({signature}) {{\nentry:\n{lines}\n  ret void\n}}\n"
