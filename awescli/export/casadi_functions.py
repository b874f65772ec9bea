"""A model as casadi.Function: the recorded programs replayed on casadi.SX, for awebox, acados, do-mpc.

    derivative(x, u, c) -> dx     outputs(x, u, c) -> y     initial(x, u, c) -> x     hold(x, u, sp, c) -> x     law(x, u, c) -> sp
    step(x, u, u_next, sp, sp_next, c) -> x      one interval between two samples, as the simulator steps it

x = states, then the held set-points. CasADi differentiates them; `select` is if_else on the sign of its first argument.
"""

from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

from awescli.engine.record import record
from awescli.export.json_tables import json_files
from awescli.export.model import ExportedModel
from awescli.export.programs import Program
from awescli.learning.correction import evaluate
from awescli.notation.errors import BadInput
from awescli.notation.quantities import OUTPUTS, SURFACES
from awescli.simulation.stepping import Stepping

Symbol = Any
"""A casadi.SX; the module is loaded where it is asked for."""


def casadi_files(model: ExportedModel) -> dict[str, str]:
    """`derivative.casadi`, ..., and the tables of names and values."""
    functions = casadi_functions(model)
    files = {f"{name}.casadi": _text(f) for name, f in functions.items()}
    return files | json_files(model)


def _text(function: Any) -> str:
    """What `casadi.Function.load` reads."""
    import casadi as ca

    serializer = ca.StringSerializer()
    serializer.pack(function)
    return serializer.encode()


def casadi_functions(model: ExportedModel) -> Mapping[str, object]:
    """Name -> casadi.Function. Raises BadInput where casadi is not installed."""
    try:
        import casadi as ca
    except ImportError:
        raise BadInput("casadi is not installed", "--to casadi", "Install it: pip install 'awes[casadi]'.") from None
    n_s, n_sp = len(model.states), len(SURFACES)
    x, u, c = ca.SX.sym("x", n_s + n_sp), ca.SX.sym("u", len(model.inputs)), ca.SX.sym("c", len(model.parameters))
    sp, u_next, sp_next = ca.SX.sym("sp", n_sp), ca.SX.sym("u_next", u.numel()), ca.SX.sym("sp_next", n_sp)
    programs, network = model.programs, _network(ca, model)

    def function(program: Program, out: str, rows: int):
        values = ca.vertcat(*_replayed(ca, program, network, x=x, u=u, c=c)) if rows else ca.SX(0, 1)
        return ca.Function(program.name, [x, u, c], [values], ["x", "u", "c"], [out])

    f, y = function(programs.derivative, "dx", n_s), function(programs.outputs, "y", len(OUTPUTS))
    own = function(programs.initial, "own", n_s - 12)
    law = function(programs.law, "sp", n_sp) if programs.law else None
    initial = ca.Function("initial", [x, u, c], [ca.vertcat(x[:12], own(x, u, c), x[n_s:])], ["x", "u", "c"], ["x_initial"])
    given = ca.vertcat(x[:n_s], sp)
    held = ca.vertcat(x[:n_s], law(given, u, c)) if law else given
    hold = ca.Function("hold", [x, u, sp, c], [held], ["x", "u", "sp", "c"], ["x_held"])
    names = ["x", "u", "u_next", "sp", "sp_next", "c"]
    after = _stepped(ca, model, f, hold, x, u, u_next, sp, sp_next, c)
    step = ca.Function("step", [x, u, u_next, sp, sp_next, c], [after], names, ["x_next"])
    functions = {"derivative": f, "outputs": y, "initial": initial, "hold": hold, "step": step}
    return functions | ({"law": law} if law else {})


def _stepped(
    ca: ModuleType, model: ExportedModel, f: Callable, hold: Callable, x: Symbol, u: Symbol, u_next: Symbol, sp: Symbol, sp_next: Symbol,
    c: Symbol,
) -> Symbol:  # fmt: skip
    """x one sample later: classical Runge-Kutta steps, inputs linear, set-points held as `Stepping` says."""
    n_s, stepping = len(model.states), Stepping.between(model.dt, model.longest, model.declaration.set_point_rate)
    h = model.dt / stepping.substeps
    x = hold(x, u, sp, c)

    def at(share: float):
        return u + share * (u_next - u)

    for i in range(stepping.substeps):
        begin, middle, end = (at((i + share) / stepping.substeps) for share in (0.0, 0.5, 1.0))
        if (along := stepping.first + i * stepping.onward) != 0.0:
            x = hold(x, begin, sp + along * (sp_next - sp), c)
        moved = lambda k, far, x=x: ca.vertcat(x[:n_s] + far * k, x[n_s:])  # noqa: E731
        k1 = f(x, begin, c)
        k2 = f(moved(k1, h / 2), middle, c)
        k3 = f(moved(k2, h / 2), middle, c)
        k4 = f(moved(k3, h), end, c)
        x = moved(k1 + 2 * k2 + 2 * k3 + k4, h / 6)
    return x


def _network(ca: ModuleType, model: ExportedModel) -> Callable | None:
    """The network as a function of what it sees: what `learning.correction` says, recorded."""
    correction = model.correction
    if correction is None:
        return None
    tape, outputs = record(lambda s: evaluate(s, correction)[0], s=len(correction.inputs))
    s = ca.SX.sym("s", len(correction.inputs))
    program = Program("network", tape, tuple(outputs), (), {})
    return ca.Function("network", [s], [ca.vertcat(*_replayed(ca, program, None, s=s))], ["s"], ["n"])


def _replayed(ca: ModuleType, program: Program, network: Callable | None, **blocks: Symbol) -> list:
    """The outputs of a program whose input vectors are expressions."""
    of = {
        "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b, "neg": lambda a: -a,
        "sqrt": ca.sqrt, "sin": ca.sin, "cos": ca.cos, "exp": ca.exp, "log": ca.log, "atan2": ca.atan2,
        "select": lambda p, a, b: ca.if_else(p > 0, a, b),
    }  # fmt: skip
    values: list = []
    for index, (op, *args) in enumerate(program.tape.nodes):
        if op == "const":
            values.append(ca.SX(args[0]))
        elif op == "input":
            # the network's outputs are inputs of the tape; they are known once what it sees has been computed
            values.append(blocks[args[0]][args[1]] if args[0] in blocks else None)
        else:
            if network is not None and program.seen and index == max(program.seen) + 1:
                _open(program, values, network)
            values.append(of[op](*(values[a] for a in args)))
    return [values[o] for o in program.outputs]


def _open(program: Program, values: list, network: Callable) -> None:
    """Put the network's outputs in their places."""
    import casadi as ca

    corrections = network(ca.vertcat(*(values[i] for i in program.seen)))
    for index, node in enumerate(program.tape.nodes):
        if node[:2] == ("input", "n"):
            values[index] = corrections[node[2]]
