"""A model as C99: one file and its header, no allocation, nothing but math.h.

Printed from the recorded programs; a network's layers are loops over a table of its weights, stepping is the template `stepping.c`.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from awescli.export.c_expressions import body, constant
from awescli.export.c_network import network
from awescli.export.model import ExportedModel
from awescli.export.programs import Program, used_blocks
from awescli.export.words import Signal
from awescli.notation.quantities import OUTPUTS, SURFACES

TEMPLATE = Path(__file__).with_name("stepping.c")
_LAW = """    {
        double found[MODEL_SET_POINTS];
        MODEL_law(x, u, c, found);
        for (i = 0; i < MODEL_SET_POINTS; i++)
            x[MODEL_STATES + i] = found[i];
    }"""


def c_files(model: ExportedModel) -> dict[str, str]:
    """`NAME.c` and `NAME.h`."""
    return {f"{model.identifier}.c": _source(model), f"{model.identifier}.h": _header(model)}


def comment(text: str) -> str:
    """A line of text that a comment may hold, pure ASCII."""
    plain = text.replace("*/", "* /").replace("/*", "/ *").replace("\\", "/")
    return " ".join(plain.encode("ascii", "replace").decode().split())


def _header(model: ExportedModel) -> str:
    name, upper, programs = model.identifier, model.identifier.upper(), model.programs
    sizes = {
        "STATES": len(model.states), "SET_POINTS": len(SURFACES), "INPUTS": len(programs.inputs),
        "PARAMETERS": len(programs.parameters), "OUTPUTS": len(OUTPUTS),
    }  # fmt: skip
    law = f"""
/* The flight controller: set-points sp (SET_POINTS) at the state x. */
void {name}_law(const double *x, const double *u, const double *c, double *sp);
""" if programs.law else ""  # fmt: skip
    how = "the fitted flight controller moves its surfaces" if programs.law else "set-points are inputs"
    return f"""/* {comment(model.declaration.name)}: the {model.label} model, {how}.

   {comment(model.declaration.description) or "-"}
   Made by awes {model.provenance.get("awes", "")}. SI units and radians; NED axes from the winch, FRD body axes.

   x: STATES numbers, then the SET_POINTS that are held now;  u: INPUTS;  c: PARAMETERS;  sp: SET_POINTS.
   A flight:   fill x[0..11] and hold;  initial;  then for every sample: outputs, step.
   Nothing here allocates, and every function may be called from several threads at once. */
#ifndef {upper}_H
#define {upper}_H

{"".join(f"#define {upper}_{size} {value}" + chr(10) for size, value in sizes.items())}
/* [s] longest Runge-Kutta step */
#ifndef {upper}_LONGEST_STEP
#define {upper}_LONGEST_STEP {constant(model.longest)}
#endif
/* [Hz] rate at which the flight controller sets the surfaces, and holds them */
#ifndef {upper}_SET_POINT_RATE
#define {upper}_SET_POINT_RATE {constant(model.declaration.set_point_rate)}
#endif

/* dx (STATES): rates of change. */
void {name}_derivative(const double *x, const double *u, const double *c, double *dx);

/* y (OUTPUTS): what the sensors report, then the set-points that are flown. */
void {name}_outputs(const double *x, const double *u, const double *c, double *y);

/* Fills the effects' own states, x[12] onward, from the 12 states and the held set-points at the start. */
void {name}_initial(double *x, const double *u, const double *c);
{law}
/* Puts the set-points of a sample into x: sp, or what the flight controller says. */
void {name}_hold(double *x, const double *u, const double *sp, const double *c);

/* From a sample to the next one, dt [s] later; u, sp: at the sample, u_next, sp_next: at the next one. x holds the set-points of the old
   sample afterwards, until the next hold or step. */
void {name}_step(double *x, const double *u, const double *u_next, const double *sp, const double *sp_next,
{" " * len(f"void {name}_step(")}const double *c, double dt);

/* Names and units; values of the parameters; an instant at which the model is alive
   ({comment(model.start.origin)}). */
{"".join(_declared(name, kind) for kind in ("state", "set_point", "input", "parameter", "output"))}extern const double {name}_parameters[];
extern const double {name}_start_states[], {name}_start_set_points[], {name}_start_inputs[];

#endif
"""


def _declared(name: str, kind: str) -> str:
    return f"extern const char *const {name}_{kind}_names[], *const {name}_{kind}_units[];\n"


def _source(model: ExportedModel) -> str:
    name, programs = model.identifier, model.programs
    parts = [
        f"/* {comment(model.declaration.name)}, {model.label}. What the functions do stands in {name}.h.\n\n{_provenance(model)} */\n"
        f'#include "{name}.h"\n\n#include <math.h>\n',
        _tables(model),
        network(model.correction) if model.correction else "",
        _function(programs.derivative, f"void {name}_derivative(const double *x, const double *u, const double *c, double *dx)", "dx"),
        _function(programs.outputs, f"void {name}_outputs(const double *x, const double *u, const double *c, double *y)", "y"),
        _function(programs.initial, f"void {name}_initial(double *x, const double *u, const double *c)", "x", first=12),
    ]
    if programs.law:
        parts.append(_function(programs.law, f"void {name}_law(const double *x, const double *u, const double *c, double *sp)", "sp"))
    return "\n".join(p for p in parts if p) + "\n" + _stepping(model)


def _provenance(model: ExportedModel) -> str:
    """What the model was made from, line by line."""
    return "\n".join(f"   {comment(f'{key}: {value}')}" for key, value in model.provenance.items() if not isinstance(value, Mapping))


def _stepping(model: ExportedModel) -> str:
    """The template in the model's name. A model without inputs or a law does not use all arguments of `hold`."""
    law = _LAW if model.programs.law else "    (void)u;\n    (void)c;"
    text = TEMPLATE.read_text().replace("MODEL_LAW", law)
    for function in ("hold", "step", "derivative", "law"):
        text = text.replace(f"MODEL_{function}", f"{model.identifier}_{function}")
    return text.replace("MODEL_", f"{model.identifier.upper()}_")


def _function(program: Program, head: str, result: str, first: int = 0) -> str:
    """One program; arguments that it does not read are said to be unused."""
    leaves = {"x": "x", "u": "u", "c": "c", "n": "n"}
    results = [f"{result}[{first + i}]" for i in range(len(program.outputs))]
    text = body(program, leaves, results, network="network")
    read = used_blocks(program) | ({result} if program.outputs else set())
    unused = "".join(f"    (void){a};\n" for a in ("x", "u", "c") if a not in read)
    return f"{head}\n{{\n{unused}{text}{chr(10) if text else ''}}}\n"


def _tables(model: ExportedModel) -> str:
    """Names, units, values; every row says in a comment what it is."""
    name = model.identifier
    kinds = {
        "state": model.states, "set_point": model.set_points, "input": model.inputs, "parameter": model.parameters, "output": model.outputs,
    }  # fmt: skip
    parts = [_names(name, kind, signals) for kind, signals in kinds.items()]
    parts.append(_values(f"{name}_parameters", model.parameters, _origin))
    parts.append(_values(f"{name}_start_states", model.states[:12], lambda s: s.words))
    parts.append(_values(f"{name}_start_set_points", model.set_points, lambda s: s.words))
    parts.append(_values(f"{name}_start_inputs", model.inputs, lambda s: s.words))
    return "\n".join(parts)


def _origin(s: Signal) -> str:
    """Where a parameter's value comes from."""
    interval = f"; 95 % in [{s.interval[0]:.6g}, {s.interval[1]:.6g}]" if s.interval else ""
    return f"{s.source or 'no source given'}{interval}"


def _names(name: str, kind: str, signals: Sequence[Signal]) -> str:
    rows = "".join(f'    "{_literal(s.name)}", /* {i}: {comment(f"[{s.unit}] {s.words}")} */\n' for i, s in enumerate(signals)) or "    0\n"
    units = "".join(f'    "{_literal(s.unit)}", /* {i} */\n' for i, s in enumerate(signals)) or "    0\n"
    return f"const char *const {name}_{kind}_names[] = {{\n{rows}}};\nconst char *const {name}_{kind}_units[] = {{\n{units}}};\n"


def _literal(text: str) -> str:
    """Text inside a string of C."""
    return comment(text).replace('"', "'")


def _values(name: str, signals: Sequence[Signal], describe: Callable[[Signal], str]) -> str:
    said = [comment(f"{i}: {s.name} [{s.unit}] {describe(s)}") for i, s in enumerate(signals)]
    rows = "".join(f"    {constant(s.value or 0.0)}, /* {text} */\n" for s, text in zip(signals, said, strict=True))
    return f"const double {name}[] = {{\n{rows or '    0.0' + chr(10)}}};\n"
