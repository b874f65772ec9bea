"""A model as an FMI 3.0 source FMU: Co-Simulation and Model Exchange, compiled by whoever imports it, no Python in it.

The model itself is `c_code`'s file; `fmi3.c` is the standard's interface around it, the same for all models.
"""

import hashlib
import io
import re
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from xml.sax.saxutils import quoteattr

from awescli.export.c_code import c_files
from awescli.export.model import ExportedModel
from awescli.export.words import Signal

INTERFACE = tuple(Path(__file__).with_name(name) for name in ("fmi3.h", "fmi3.c", "fmi3_absent.c"))
BASE_UNITS: dict[str, Mapping[str, float]] = {
    "m": {"m": 1}, "m2": {"m": 2}, "m/s": {"m": 1, "s": -1}, "m/s2": {"m": 1, "s": -2}, "s": {"s": 1}, "1/s": {"s": -1}, "kg": {"kg": 1},
    "kg m2": {"kg": 1, "m": 2}, "kg/m": {"kg": 1, "m": -1}, "kg/m3": {"kg": 1, "m": -3}, "N": {"kg": 1, "m": 1, "s": -2},
    "N/s": {"kg": 1, "m": 1, "s": -3}, "N/m": {"kg": 1, "s": -2}, "N s/m": {"kg": 1, "s": -1}, "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1}, "rad/s2": {"rad": 1, "s": -2}, "1/rad": {"rad": -1}, "1/rad2": {"rad": -2},
    "rad/m": {"rad": 1, "m": -1}, "1/Pa": {"kg": -1, "m": 1, "s": 2}, "-": {}, "": {},
}  # fmt: skip
"""Unit -> exponents of the SI units; of any other unit the FMU gives the name only."""


def fmu_files(model: ExportedModel) -> dict[str, bytes]:
    """`NAME.fmu`."""
    return {f"{model.identifier}.fmu": fmu(model)}


def fmu(model: ExportedModel) -> bytes:
    """The FMU: the same bytes for the same model."""
    sources = c_files(model) | {p.name: p.read_text() for p in INTERFACE} | {"fmu.h": _names(model)}
    files = {"modelDescription.xml": description(model), "sources/buildDescription.xml": _build(model, sources)}
    files |= {f"sources/{name}": text for name, text in sources.items()}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0)), text, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def token(model: ExportedModel) -> str:
    """What tells this model from any other: a hash of its source."""
    digest = hashlib.sha256("".join(c_files(model).values()).encode()).hexdigest()
    return "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"


def description(model: ExportedModel) -> str:
    """modelDescription.xml."""
    variables = list(_variables(model))
    units = sorted({"s", *(unit for _, unit in variables)})
    n_s, n_y = len(model.states), len(model.outputs)
    first = _references(model)
    outputs = [f'<Output valueReference="{first["outputs"] + i}"/>' for i in range(n_y)]
    derivatives = [f'<ContinuousStateDerivative valueReference="{first["derivatives"] + i}"/>' for i in range(n_s)]
    unknown = [*range(first["outputs"], first["outputs"] + n_y), *range(first["derivatives"], first["derivatives"] + n_s),
               *range(first["states"] + 12, first["states"] + n_s)]  # fmt: skip
    surfaces = "the fitted flight controller moves its surfaces" if model.programs.law else "set-points are inputs"
    what = f"{model.label} model of {model.declaration.name}; {surfaces}; SI units and radians, NED axes from the winch, FRD body axes"
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName={_attribute(model.declaration.name)} instantiationToken="{token(model)}"
    description={_attribute(what)} generationTool="awes {model.provenance.get("awes", "")}" variableNamingConvention="structured">
  <ModelExchange modelIdentifier="{model.identifier}" canGetAndSetFMUState="true" canSerializeFMUState="true"
      needsCompletedIntegratorStep="false"/>
  <CoSimulation modelIdentifier="{model.identifier}" canGetAndSetFMUState="true" canSerializeFMUState="true"
      canHandleVariableCommunicationStepSize="true"/>
  <UnitDefinitions>
    {_lines(_unit(unit) for unit in units)}
  </UnitDefinitions>
  <DefaultExperiment startTime="0" stopTime="10" stepSize="{model.dt!r}"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous" unit="s" description="time"/>
    {_lines(text for text, _ in variables)}
  </ModelVariables>
  <ModelStructure>
    {_lines(chain(outputs, derivatives, (f'<InitialUnknown valueReference="{r}"/>' for r in unknown)))}
  </ModelStructure>
</fmiModelDescription>
"""


def variable_name(kind: str, name: str, derivative: bool = False) -> str:
    """The name in the FMU: `state.p_n`, `der(input.tether_length)`, `parameter.'actuator_lag:rudder'.tau`."""
    parts = [part if re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", part) else f"'{part.replace(chr(39), '_')}'" for part in name.split(".")]
    full = ".".join((kind, *parts))
    return f"der({full})" if derivative else full


def _references(model: ExportedModel) -> dict[str, int]:
    """The first value reference of each kind, as `fmi3.c` counts them."""
    n_s, n_sp, n_u, n_c = (len(signals) for signals in (model.states, model.set_points, model.inputs, model.parameters))
    kinds = {
        "states": n_s, "held": n_sp, "set_points": n_sp, "inputs": n_u, "slopes": n_u, "parameters": n_c, "derivatives": n_s, "outputs": 0,
    }  # fmt: skip
    first, at = {}, 1
    for kind, count in kinds.items():
        first[kind] = at
        at += count
    return first


def _variables(model: ExportedModel) -> Iterator[tuple[str, str]]:
    """(element, unit) of every variable but time."""
    first = _references(model)

    def element(kind: str, i: int, name: str, s: Signal, unit: str, more: str, words: str = ""):
        attributes = f'name={_attribute(name)} valueReference="{first[kind] + i}" {more} unit={_attribute(unit)}'
        return f"<Float64 {attributes} description={_attribute(words or s.words or s.source)}/>", unit

    for i, s in enumerate(model.states):
        start = f'initial="exact" start="{s.value or 0.0!r}"' if i < 12 else 'initial="calculated"'
        yield element("states", i, variable_name("state", s.name), s, s.unit, f'causality="local" variability="continuous" {start}')
    driven = set(model.controller.surfaces) | set(model.controller.constants) if model.controller else set()
    for i, s in enumerate(model.set_points):
        words = f"{s.words}; not used: the flight controller moves it" if s.name in driven else s.words
        more = f'causality="input" variability="discrete" start="{s.value or 0.0!r}"'
        yield element("set_points", i, variable_name("set_point", s.name), s, s.unit, more, words)
    for i, s in enumerate(model.inputs):
        more = f'causality="input" variability="continuous" start="{s.value or 0.0!r}"'
        yield element("inputs", i, variable_name("input", s.name), s, s.unit, more)
    for i, s in enumerate(model.inputs):
        more = f'causality="input" variability="continuous" start="0.0" derivative="{first["inputs"] + i}"'
        words = f"rate at which input {s.name} runs on within a communication step"
        yield element("slopes", i, variable_name("input", s.name, True), s, _per_second(s.unit), more, words)
    for i, s in enumerate(model.parameters):
        more = f'causality="parameter" variability="tunable" start="{s.value!r}"'
        yield element("parameters", i, variable_name("parameter", s.name), s, s.unit, more)
    for i, s in enumerate(model.states):
        more = f'causality="local" variability="continuous" initial="calculated" derivative="{first["states"] + i}"'
        yield element("derivatives", i, variable_name("state", s.name, True), s, _per_second(s.unit), more, f"rate of change of {s.name}")
    for i, s in enumerate(model.outputs):
        more = 'causality="output" variability="continuous" initial="calculated"'
        yield element("outputs", i, variable_name("sensor", s.name), s, s.unit, more)


def _per_second(unit: str) -> str:
    """The unit of a rate of change."""
    if unit.endswith("/s"):
        return f"{unit}2"
    return f"{unit}/s" if unit not in ("-", "") else "1/s"


def _unit(unit: str) -> str:
    if unit not in BASE_UNITS:
        return f"<Unit name={_attribute(unit)}/>"
    base = " ".join(f'{name}="{exponent}"' for name, exponent in BASE_UNITS[unit].items())
    return f"<Unit name={_attribute(unit)}><BaseUnit {base}/></Unit>"


def _build(model: ExportedModel, sources: Mapping[str, str]) -> str:
    files = "".join(f'<SourceFile name="{name}"/>' for name in sources if name.endswith(".c"))
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="{model.identifier}">
    <SourceFileSet language="C99">{files}</SourceFileSet>
    <Library name="m"/>
  </BuildConfiguration>
</fmiBuildDescription>
"""


def _names(model: ExportedModel) -> str:
    """fmu.h: what `fmi3.c` calls the model."""
    name, upper = model.identifier, model.identifier.upper()
    functions = ("hold", "initial", "derivative", "outputs", "step", "parameters", "start_states", "start_set_points", "start_inputs")
    sizes = ("STATES", "SET_POINTS", "INPUTS", "PARAMETERS", "OUTPUTS", "SET_POINT_RATE")
    lines = [f"#define MODEL_{f} {name}_{f}" for f in functions] + [f"#define {s} {upper}_{s}" for s in sizes]
    lines += [f"#define HAS_LAW {int(bool(model.programs.law))}", f'#define TOKEN "{token(model)}"']
    return "\n".join([f'#include "{name}.h"', *lines, ""])


def _attribute(text: str) -> str:
    return quoteattr(" ".join(text.split()))


def _lines(elements: Iterable[str]) -> str:
    return "\n    ".join(elements)
