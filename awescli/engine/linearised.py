"""Print a linearised program, and what is done with its Jacobian, on `lanes` evaluations at once.

    linearised(x, u, c, y, E)                          y = f(x, u, c) and E = [df/dx, df/dc, 0] of some components of f
    columns(E, S, dS, n_col, parameter_of)             dS = df/dx S + df/dc

and where the first components of f are the rates of change of the first ones of x

    rates(x, u, c, y, E)                               `linearised` of the rates alone, with which `linearised` begins: what both need is
                                                       computed, and printed, once. `columns` is of the others, whose E is behind theirs
    step(E1, E2, E3, E4, S, n_col, parameter_of, h)    S after a classical Runge-Kutta step of dS/dt = df/dx S + df/dc, E at its four stages

with E (components, n_x + n_wrt + 1, lanes), S (n_x, n_col, lanes), dS (components, n_col, lanes). Column j of S differentiates with respect
to parameter number parameter_of[j], or to none of them where that is n_wrt. What is always zero is not written: E must be zero at first.

A step takes one column after the other through all its stages, in registers, past Jacobians that stay in the nearest cache. Derivatives
form FMA; y does not (see `llvm_ir`).
"""

from collections.abc import Sequence

from awescli.engine.derive import jacobian
from awescli.engine.llvm_ir import Body, Printer, hexadecimal
from awescli.engine.record import Tape


def print_linearised(tape: Tape, outputs: Sequence[int], n_x: int, wrt: Sequence[int], lanes: int, rows: Sequence[int], rates: int) -> str:
    """The functions above; rows: the components of f that are differentiated, its `rates` first; wrt: the parameters."""
    inputs = [tape.put(("input", "x", i)).index for i in range(n_x)] + [tape.put(("input", "c", j)).index for j in wrt]
    entries = jacobian(tape, [outputs[i] for i in rows], inputs)
    width = n_x + len(wrt) + 1
    text = _print_columns([_of_state(entries, i, n_x) for i in range(rates, len(rows))], n_x, width, lanes)
    if not rates:
        return text + _printed(_Entries(tape, outputs, entries, width, lanes), "linearised", "xucyE")
    text += _print_step([_of_state(entries, i, n_x) for i in range(rates)], n_x, width, lanes)
    return text + _print_in_two(tape, outputs, entries, rates, width, lanes)


def _of_state(entries: dict[tuple[int, int], int], row: int, n_x: int) -> list[int]:
    """The components of x that a component of f depends on."""
    return sorted(j for i, j in entries if i == row and j < n_x)


def _print_in_two(tape: Tape, outputs: Sequence[int], entries: dict[tuple[int, int], int], rates: int, width: int, lanes: int) -> str:
    """`rates` and `linearised`, of which the first leaves in rows of w what the rest needs of it."""
    own = {place: node for place, node in entries.items() if place[0] < rates}
    others = {place: node for place, node in entries.items() if place[0] >= rates}
    first = _Entries(tape, outputs[:rates], own, width, lanes)
    rest = _Entries(tape, outputs, others, width, lanes, first)
    for node, row in rest.taken.items():
        first.store(first.node(node), "w", str(row))
    text = _printed(first, "begun", "xucyEw", "internal") + _printed(rest, "went_on", "xucyEw", "internal")
    for name, parts in (("rates", ("begun",)), ("linearised", ("begun", "went_on"))):
        body = Body(lanes)
        body.lines.append(f"  %w = alloca [{len(rest.taken) + 1} x {body.type}], align 64")
        for part in parts:
            body.call(f"@{part}", *(f"ptr %{block}" for block in "xucyEw"))
        text += body.function(name, [f"ptr %{block}" for block in "xucyE"])
    return text


class _Entries(Printer):
    """Prints y = f(x, u, c), then the entries of E, but for what another one, `before`, has printed: its y are not computed again, and what
    it had to compute is read from w. taken: node -> its row there. What formed FMA there is not taken for y."""

    def __init__(
        self, tape: Tape, outputs: Sequence[int], entries: dict[tuple[int, int], int], width: int, lanes: int,
        before: "_Entries | None" = None,
    ):  # fmt: skip
        super().__init__(tape, lanes)
        self.taken: dict[int, int] = {}
        self._there: set[int] = before.plain if before else set()
        for i, output in enumerate(outputs):
            if not before or i >= before.count:
                self.store(self.node(output), "y", str(i))
        self.count, self.plain, self.fused = len(outputs), set(self._names), True
        self._there = set(before._names) if before else set()
        for (i, j), node in entries.items():
            self.store(self.node(node), "E", str(i * width + j))

    def known(self, index: int) -> str | None:
        if index not in self._there or self.tape.nodes[index][0] in ("const", "input"):
            return None
        return self.load("w", str(self.taken.setdefault(index, len(self.taken))))


def _printed(body: Printer, name: str, blocks: str, linkage: str = "") -> str:
    """A function of blocks that do not overlap."""
    lines, arguments = "\n".join(body.lines), ", ".join(f"ptr noalias %{block}" for block in blocks)
    return f"define {linkage} void @{name}({arguments}) noinline {{\nentry:\n{lines}\n  ret void\n}}\n"


class _Columns(Body):
    """Columns of S, one at a time."""

    def __init__(self, lanes: int, n_x: int, width: int):
        super().__init__(lanes)
        self.n_x, self.width = n_x, width

    def at(self, block: str, row: int, column: str) -> str:
        """Address of S or dS at a row and column."""
        return self.row(block, self.whole("add", self.whole("mul", "%n_col", row), column))

    def read(self, place: str) -> str:
        return self.line(f"load {self.type}, ptr {place}, align 8")

    def write(self, value: str, place: str) -> None:
        self.lines.append(f"  store {self.type} {value}, ptr {place}, align 8")

    def parameter(self, column: str) -> str:
        """Where in a row of E the derivative with respect to the parameter of a column stands."""
        number = self.line(f"load i64, ptr {self.line(f'getelementptr i64, ptr %parameter_of, i64 {column}')}")
        return self.whole("add", number, self.n_x)

    def derivative(self, E: str, row: int, parameter: str, s: dict[int, str]) -> str:
        """E[row, parameter] + sum_j E[row, j] s_j"""
        total = self.read(self.row(E, self.whole("add", row * self.width, parameter)))
        for j, value in s.items():
            total = self.plus(total, self.read(self.row(E, row * self.width + j)), value)
        return total

    def plus(self, a: str, b: str, c: str) -> str:
        """a + b c"""
        return self.line(f"fadd contract {self.type} {a}, {self.line(f'fmul contract {self.type} {b}, {c}')}")

    def splat(self, number: str) -> str:
        first = self.line(f"insertelement {self.type} poison, double {number}, i64 0")
        return self.line(f"shufflevector {self.type} {first}, {self.type} poison, <{self.lanes} x i32> zeroinitializer")


def _print_columns(rows: list[list[int]], n_x: int, width: int, lanes: int) -> str:
    body = _Columns(lanes, n_x, width)
    with body.loop("%n_col") as column:
        parameter = body.parameter(column)
        s = {j: body.read(body.at("%S", j, column)) for j in sorted({j for used in rows for j in used})}
        for i, used in enumerate(rows):
            body.write(body.derivative("%E", i, parameter, {j: s[j] for j in used}), body.at("%dS", i, column))
    return body.function("columns", ("ptr %E", "ptr %S", "ptr %dS", "i64 %n_col", "ptr %parameter_of"))


def _print_step(rows: list[list[int]], n_x: int, width: int, lanes: int) -> str:
    body = _Columns(lanes, n_x, width)
    half, sixth = (body.splat(body.line(f"fdiv double %h, {hexadecimal(d)}")) for d in (2.0, 6.0))
    whole, two = body.splat("%h"), body.splat(hexadecimal(2.0))
    with body.loop("%n_col") as column:
        parameter = body.parameter(column)
        start = {j: body.read(body.at("%S", j, column)) for j in range(n_x)}
        now, total = dict(start), []
        for stage, far in enumerate((half, half, whole, sixth), 1):
            k = [body.derivative(f"%E{stage}", i, parameter, {j: now[j] for j in used}) for i, used in enumerate(rows)]
            if stage < 4:
                total = [body.plus(t, two, d) for t, d in zip(total, k, strict=True)] if total else k
            else:
                k = [body.line(f"fadd {body.type} {t}, {d}") for t, d in zip(total, k, strict=True)]
            now |= {i: body.plus(start[i], far, d) for i, d in enumerate(k)}
        for i in range(len(rows)):
            body.write(now[i], body.at("%S", i, column))
    stages = [f"ptr %E{stage}" for stage in range(1, 5)]
    return body.function("step", (*stages, "ptr %S", "i64 %n_col", "ptr %parameter_of", "double %h"))
