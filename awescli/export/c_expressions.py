"""A recorded program -> lines of C: one constant for each value that is used more than once, everything else inside its user's expression.

The order of operations is the tape's: where C would associate otherwise, parentheses stand.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from textwrap import wrap

from awescli.export.programs import Program, needed

WIDTH = 116
LONGEST = 60
"""Operations in one expression: C99 promises 63 nested parentheses."""
_ATOM, _SIGN, _PRODUCT, _SUM = 4, 3, 2, 1
_BINARY = {"add": ("+", _SUM), "sub": ("-", _SUM), "mul": ("*", _PRODUCT), "div": ("/", _PRODUCT)}


def body(program: Program, leaves: Mapping[str, str], results: Sequence[str], network: str = "") -> str:
    """The statements that compute a program. leaves: input block -> name of its vector; results: what the outputs are written to
    (`dx[0]`); network: the function that fills `n` from what the network sees."""
    return "\n".join(f"    {line}" for line in _Statements(program, leaves, network).lines(results))


def constant(value: float) -> str:
    """A number as C reads it back to the last bit."""
    return repr(float(value))


def wrapped(text: str, indent: str = "    ") -> list[str]:
    """A statement in lines that fit; breaks stand at spaces only."""
    return wrap(text, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


class _Statements:
    """Expressions of nodes, and the constants that they are cut into."""

    def __init__(self, program: Program, leaves: Mapping[str, str], network: str):
        self.program, self.tape, self.leaves, self.network = program, program.tape, leaves, network
        self.needed = sorted(needed(program))
        self.uses = Counter(a for i in self.needed for a in self._arguments(i))
        self.uses.update((*program.outputs, *program.seen))
        self.text: dict[int, tuple[str, int, int]] = {}  # node -> (expression, its level, operations in it)

    def _arguments(self, index: int) -> tuple:
        node = self.tape.nodes[index]
        return node[1:] if node[0] not in ("const", "input") else ()

    def lines(self, results: Sequence[str]) -> Iterator[str]:
        """Constants in the order of the tape, the network between what it sees and what needs it, then the results."""
        ends = max(self.program.seen, default=-1)
        asked = not self.program.seen
        for index in self.needed:
            if not asked and index > ends:
                yield from self._ask_network()
                asked = True
            self.text[index] = self._expression(index)
            if self._stands_alone(index):
                name = self.program.names.get(index, f"v{index}")
                yield from wrapped(f"const double {name} = {self.text[index][0]};")
                self.text[index] = (name, _ATOM, 0)
        for result, index in zip(results, self.program.outputs, strict=True):
            yield from wrapped(f"{result} = {self.text[index][0]};")

    def _ask_network(self) -> Iterator[str]:
        sees = ", ".join(self.text[i][0] for i in self.program.seen)
        yield from wrapped(f"const double s[] = {{{sees}}};")
        yield f"double n[{1 + max(node[2] for node in self.tape.nodes if node[:2] == ('input', 'n'))}];"
        yield f"{self.network}(s, n);"

    def _stands_alone(self, index: int) -> bool:
        if self.tape.nodes[index][0] in ("const", "input"):
            return False
        return self.uses[index] > 1 or index in self.program.names or self.text[index][2] >= LONGEST

    def _expression(self, index: int) -> tuple[str, int, int]:
        op, *args = self.tape.nodes[index]
        if op == "const":
            return (constant(args[0]), _ATOM, 0) if args[0] >= 0 else (f"({constant(args[0])})", _ATOM, 0)
        if op == "input":
            return f"{self.leaves[args[0]]}[{args[1]}]", _ATOM, 0
        size = 1 + sum(self.text[a][2] for a in args)
        if op in _BINARY:
            sign, level = _BINARY[op]
            return f"{self._at(args[0], level)} {sign} {self._at(args[1], level + 1)}", level, size
        if op == "neg":
            return f"-{self._at(args[0], _ATOM)}", _SIGN, size
        if op == "select":
            positive, then, otherwise = (self._at(a, _SUM) for a in args)
            return f"({positive} > 0.0 ? {then} : {otherwise})", _ATOM, size
        return f"{op}({', '.join(self.text[a][0] for a in args)})", _ATOM, size

    def _at(self, index: int, level: int) -> str:
        """An argument where at least this level is needed, in parentheses where it has less."""
        text, own, _ = self.text[index]
        return text if own >= level else f"({text})"
