"""A recorded program -> components of a JSBSim flight control: a property for each value that is used more than once."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from awescli.export.programs import Program, needed

LONGEST = 60
"""Operations in one function."""
_ELEMENTS = {
    "add": "sum", "sub": "difference", "mul": "product", "div": "quotient", "sqrt": "sqrt", "sin": "sin", "cos": "cos", "exp": "exp",
    "log": "ln", "atan2": "atan2",
}  # fmt: skip


def value(number: float) -> str:
    """A number as JSBSim reads it back to the last bit."""
    return f"<value>{float(number)!r}</value>"


def read(name: str) -> str:
    """The value of a property."""
    return f"<property>{name}</property>"


def element(tag: str, *parts: str) -> str:
    return f"<{tag}>{''.join(parts)}</{tag}>"


def component(name: str, function: str) -> str:
    """A flight-control component that computes a property."""
    return f'<fcs_function name="{name}"><function>{function}</function></fcs_function>'


def components(program: Program, leaves: Mapping[str, Sequence[str]], folder: str, results: Sequence[str]) -> Iterator[str]:
    """A program. leaves: input block -> elements of its components; folder: of the properties in between; results: properties of the
    outputs."""
    nodes, text, size = program.tape.nodes, {}, {}
    wanted = sorted(needed(program))
    uses = Counter(a for i in wanted for a in (nodes[i][1:] if nodes[i][0] not in ("const", "input") else ()))
    uses.update(program.outputs)
    for index in wanted:
        op, *args = nodes[index]
        if op in ("const", "input"):
            text[index], size[index] = value(args[0]) if op == "const" else leaves[args[0]][args[1]], 0
            continue
        text[index], size[index] = _operation(op, [text[a] for a in args]), 1 + sum(size[a] for a in args)
        if uses[index] > 1 or index in program.names or size[index] >= LONGEST:
            name = f"{folder}/{program.names.get(index, f'v{index}')}"
            yield component(name, text[index])
            text[index], size[index] = read(name), 0
    for name, index in zip(results, program.outputs, strict=True):
        yield component(name, text[index])


def _operation(op: str, args: Sequence[str]) -> str:
    if op == "neg":
        return element("product", value(-1.0), *args)
    if op == "select":
        positive, then, otherwise = args
        return element("ifthen", element("gt", positive, value(0.0)), then, otherwise)
    return element(_ELEMENTS[op], *args)
