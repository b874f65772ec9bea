"""Exact sparse Jacobians of a tape by vertex elimination in Markowitz order (Griewank & Walther, Evaluating Derivatives, ch. 9-10).

The linearised program is a graph whose edges carry partial derivatives. Removing an inner vertex joins each of its
predecessors to each of its successors; what is left when all inner vertices are gone are the entries of the Jacobian.
Removing the vertex with the fewest such joins first keeps the number of multiplications near the least possible.
"""

import heapq
from collections.abc import Iterable, Mapping

from awescli.engine.record import Scalar, Tape


def _partials(tape: Tape, index: int) -> list[tuple[int, Scalar]]:
    """[(argument, d node / d argument)] of one node, recorded on the same tape."""
    op, *args = tape.nodes[index]
    y = Scalar(tape, index)
    one = tape.constant(1.0)
    a = [Scalar(tape, i) for i in args]
    if op == "add":
        d = [one, one]
    elif op == "sub":
        d = [one, -one]
    elif op == "mul":
        d = [a[1], a[0]]
    elif op == "div":
        inverse = one / a[1]
        d = [inverse, -(y * inverse)]
    elif op == "neg":
        d = [-one]
    elif op == "sqrt":
        d = [0.5 / y]
    elif op == "sin":
        d = [a[0].cos()]
    elif op == "cos":
        d = [-a[0].sin()]
    elif op == "exp":
        d = [y]
    elif op == "log":
        d = [one / a[0]]
    elif op == "atan2":
        inverse = one / (a[0] * a[0] + a[1] * a[1])
        d = [a[1] * inverse, -(a[0] * inverse)]
    elif op == "select":
        return list(_joined([(args[1], a[0].select(one, 0.0)), (args[2], a[0].select(0.0, one))]).items())
    else:
        raise TypeError(f"no derivative rule for '{op}'")
    return list(_joined(zip(args, d, strict=True)).items())


def _joined(pairs: Iterable[tuple[int, Scalar]]) -> dict[int, Scalar]:
    """Sum the partials of an argument that occurs twice (x * x)."""
    result: dict[int, Scalar] = {}
    for i, d in pairs:
        result[i] = result[i] + d if i in result else d
    return result


def jacobian(tape: Tape, outputs: list[int], wrt: list[int]) -> dict[tuple[int, int], int]:
    """Entries of d outputs / d wrt as nodes recorded on the tape: (row, column) -> node, structural zeros left out.

    outputs: node indices (a node may occur several times); wrt: indices of input nodes. Exact to rounding.
    """
    wrt_set = set(wrt)
    needed = _reachable_from(tape, outputs)
    active: set[int] = set(wrt_set)
    into: dict[int, dict[int, Scalar]] = {}  # vertex -> {successor: partial}
    out_of: dict[int, dict[int, Scalar]] = {}  # vertex -> {predecessor: partial}
    for index in sorted(needed):
        if tape.nodes[index][0] in ("const", "input"):
            continue
        if any(argument in active for argument in tape.nodes[index][1:]):
            active.add(index)
            for argument, partial in _partials(tape, index):
                if argument in active and not _is_zero(partial):
                    out_of.setdefault(index, {})[argument] = partial
                    into.setdefault(argument, {})[index] = partial
    kept = wrt_set | set(outputs)
    cost = {v: len(out_of.get(v, ())) * len(into.get(v, ())) for v in active if v not in kept}
    queue = [(c, v) for v, c in cost.items()]
    heapq.heapify(queue)
    while queue:
        c, v = heapq.heappop(queue)
        if v not in cost or cost[v] != c:
            continue
        del cost[v]
        before, after = out_of.pop(v, {}), into.pop(v, {})
        for successor, down in after.items():
            edges = out_of[successor]
            del edges[v]
            for predecessor, up in before.items():
                product = down * up
                edges[predecessor] = edges[predecessor] + product if predecessor in edges else product
                into[predecessor][successor] = edges[predecessor]
        for predecessor in before:
            del into[predecessor][v]
        for neighbour in (*before, *after):
            if neighbour in cost:
                cost[neighbour] = len(out_of.get(neighbour, ())) * len(into.get(neighbour, ()))
                heapq.heappush(queue, (cost[neighbour], neighbour))
    columns = {node: j for j, node in enumerate(wrt)}
    entries: dict[tuple[int, int], int] = {}
    for i, output in enumerate(outputs):
        if output in columns:
            entries[i, columns[output]] = tape.constant(1.0).index
            continue
        for node, partial in _resolve(output, out_of, wrt_set).items():
            if not _is_zero(partial):
                entries[i, columns[node]] = partial.index
    return entries


def _resolve(output: int, out_of: Mapping[int, Mapping[int, Scalar]], wrt: set[int]) -> dict[int, Scalar]:
    """Partials of an output with respect to inputs, following edges through outputs that feed other outputs."""
    total: dict[int, Scalar] = {}
    for predecessor, partial in out_of.get(output, {}).items():
        through = {predecessor: None} if predecessor in wrt else _resolve(predecessor, out_of, wrt)
        for node, inner in through.items():
            term = partial if inner is None else partial * inner
            total[node] = total[node] + term if node in total else term
    return total


def _reachable_from(tape: Tape, outputs: Iterable[int]) -> set[int]:
    """All nodes that the outputs depend on."""
    seen: set[int] = set()
    stack = list(outputs)
    while stack:
        index = stack.pop()
        if index not in seen:
            seen.add(index)
            if tape.nodes[index][0] not in ("const", "input"):
                stack.extend(tape.nodes[index][1:])
    return seen


def _is_zero(scalar: Scalar) -> bool:
    return scalar.tape.nodes[scalar.index] == ("const", 0.0)
