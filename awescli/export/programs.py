"""The equations of a model, recorded once for every printer: derivative, outputs, initial, law.

    x = states, then the held set-points (SURFACES);  u = exogenous inputs;  c = parameters;  n = what the network adds, where there is one

Inputs are those that some program reads. Nuisance parameters, which an estimator integrates out, are null and no longer there; a network
is not recorded but left open: its inputs are `seen`, its outputs come in as block `n`.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from awescli.engine.record import Scalar, Tape, evaluate, record
from awescli.learning.correction import CORRECTED, HybridKite
from awescli.notation.present import present
from awescli.physics.disturbances import PHASE
from awescli.physics.disturbances import parameters as nuisance_parameters
from awescli.physics.flight_model import FlightModel
from awescli.physics.instant import Instant
from awescli.physics.kite import Kite


@dataclass(frozen=True)
class Program:
    """A recorded function. outputs: its nodes; seen: nodes that the network sees, none where it is not asked; names: what a node is called
    by people (`V_a`)."""

    name: str
    tape: Tape
    outputs: tuple[int, ...]
    seen: tuple[int, ...]
    names: Mapping[int, str]


@dataclass(frozen=True)
class Programs:
    """inputs, parameters: names in the order of u and c; law: None where set-points are inputs."""

    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    derivative: Program
    outputs: Program
    initial: Program
    law: Program | None

    @property
    def all(self) -> tuple[Program, ...]:
        return tuple(p for p in (self.derivative, self.outputs, self.initial, self.law) if p is not None)


def record_programs(kite: Kite | HybridKite, law: Callable | None) -> Programs:
    """Record a kite, and the law that drives it."""
    every = tuple(name for name in kite.input_names if name != PHASE)
    read = used_inputs(_record_all(kite, law, every).all)
    return _record_all(kite, law, tuple(name for i, name in enumerate(every) if i in read))


def values_of(tape: Tape, outputs: Sequence[int], **blocks: Sequence[float]) -> list[float]:
    """Some nodes of a tape on floats; the others may not be defined there."""
    part, where = Tape(), {}
    for i in sorted(needed(Program("part", tape, tuple(outputs), (), {}))):
        node = tape.nodes[i]
        where[i] = part.put(node if node[0] in ("const", "input") else (node[0], *(where[a] for a in node[1:]))).index
    return evaluate(part, [where[o] for o in outputs], **blocks)


def used_inputs(programs: Iterable[Program], block: str = "u") -> set[int]:
    """Components of an input block that some program needs."""
    return {p.tape.nodes[i][2] for p in programs for i in needed(p) if p.tape.nodes[i][:2] == ("input", block)}


def used_blocks(program: Program) -> set[str]:
    """Input blocks that a program reads something of."""
    return {program.tape.nodes[i][1] for i in needed(program) if program.tape.nodes[i][0] == "input"}


def needed(program: Program) -> set[int]:
    """All nodes that a program's outputs, and the network where it is asked, depend on."""
    found, stack = set(), [*program.outputs, *program.seen]
    while stack:
        index = stack.pop()
        if index not in found:
            found.add(index)
            node = program.tape.nodes[index]
            stack.extend(node[1:] if node[0] not in ("const", "input") else ())
    return found


def parameter_names(kite: Kite | HybridKite) -> tuple[str, ...]:
    """The parameters of the physics, without those that an estimator integrates out."""
    physics = kite.kite if isinstance(kite, HybridKite) else kite
    nuisance = {*(p.name for p in nuisance_parameters()), *physics.record}
    return tuple(name for name in physics.parameter_names if name not in nuisance)


def _record_all(kite: Kite | HybridKite, law: Callable | None, inputs: Sequence[str]) -> Programs:
    physics = kite.kite if isinstance(kite, HybridKite) else kite
    parameters = parameter_names(kite)

    def whole(names: Sequence[str], kept: Sequence[str], values) -> list:
        known = dict(zip(kept, values, strict=True))
        return [known.get(name, 0.0) for name in names]

    def recorded(name: str, of: Callable[[FlightModel], Callable]) -> Program:
        seen: list = []
        names: dict[int, str] = {}

        def function(x, u, c, n):
            def network(sees, correction, weights):
                seen[:] = sees
                return n, 1.0

            full = whole(kite.input_names, inputs, u), whole(physics.parameter_names, parameters, c)
            if of is _initial:
                # as a rollout starts: the effects' states are null until all of them are known
                x = [*x[:12], *(0.0 for _ in kite.state_names[12:]), *x[len(kite.state_names) :]]
            if of is not _law:
                names.update(known_quantities(physics.instant(x, *full)))
            flies = HybridKite(physics, kite.correction, network) if isinstance(kite, HybridKite) else kite
            return of(flies)(x, *full)

        corrections = len(CORRECTED) if physics is not kite else 0
        tape, outputs = record(function, x=len(kite.x_names), u=len(inputs), c=len(parameters), n=corrections)
        return Program(name, tape, tuple(outputs), tuple(s.index for s in seen), names)

    def _law(_) -> Callable:
        return present(law, "the law of a closed loop")

    def _initial(k):
        return k.initial

    return Programs(
        tuple(inputs), parameters, recorded("derivative", lambda k: k.derivative), recorded("outputs", lambda k: k.outputs),
        recorded("initial", _initial), recorded("law", _law) if law else None,
    )  # fmt: skip


def known_quantities(at: Instant) -> dict[int, str]:
    """Node -> name of the quantities that people know, in an instant of recorded scalars."""
    wind, C, f, m = at.wind, at.coefficients, at.applied.force, at.applied.moment
    quantities = {
        "V_a": at.V_a, "alpha": at.alpha, "beta": at.beta, "qbar": at.dynamic_pressure, "distance": at.distance, "tension": at.tension,
        "wind_n": wind.n, "wind_e": wind.e, "wind_d": wind.d, "rho": wind.density, **C._asdict(),
        **{f"f_{axis}": value for axis, value in zip("xyz", f, strict=True)},
        **{f"m_{axis}": value for axis, value in zip("xyz", m, strict=True)},
        **{f"v_{axis}": value for axis, value in zip("ned", at.v_ned, strict=True)},
        **{f"R{i}{j}": value for i, row in enumerate(at.R, 1) for j, value in enumerate(row, 1)},
    }  # fmt: skip
    names: dict[int, str] = {}
    for name, value in quantities.items():
        if isinstance(value, Scalar) and value.tape.nodes[value.index][0] not in ("const", "input"):
            names.setdefault(value.index, name)
    return names
