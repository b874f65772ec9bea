"""Compile printed IR with LLVM and hand out addresses of the functions.

A compiled object is kept on disk under the hash of what it was made from, the processor and LLVM's version (object_cache.py).
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import llvmlite.binding as llvm
import numpy as np

from awescli.engine import object_cache
from awescli.engine.linearised import print_linearised
from awescli.engine.llvm_ir import calls_of, print_functions, print_value
from awescli.engine.record import record

LANES = 8 if llvm.get_host_cpu_features().get("avx512f") else 4
"""Independent evaluations per call: one register of the widest kind. Sensitivities of more would not stay in the caches next to the core,
and two threads of one core would drive each other's out."""

_KEPT: list = []  # LLVM frees code with its engine: keep every engine for the life of the process
_target_machine = None


@dataclass(frozen=True)
class Program:
    """A compiled function y = f(x, u, c) of three vectors, on LANES lanes.

    value: address of the function of `llvm_ir`; linearised, columns, rates, step: of those of `linearised`, 0 where there is none;
    wrt: indices of the parameters that they differentiate with respect to.
    """

    n_x: int
    n_u: int
    n_c: int
    n_y: int
    wrt: tuple[int, ...]
    value: int
    linearised: int = 0
    columns: int = 0
    rates: int = 0
    step: int = 0
    operations: int = field(compare=False, default=0)


def compile_program(
    function: Callable[..., Sequence],
    n_x: int,
    n_u: int,
    n_c: int,
    wrt: Sequence[int] = (),
    *,
    linearised: bool = True,
    rows: Sequence[int] | None = None,
    rates: int = 0,
) -> Program:
    """Record `function(x, u, c)` (lists of scalars in, sequence of scalars out), differentiate, compile.

    wrt: indices of the components of c to differentiate with respect to (all of x always); rows: indices of the components of the function
    that are differentiated (default: all); rates: how many of them, the first, are rates of change of the first components of x.
    """
    tape, outputs = record(function, x=n_x, u=n_u, c=n_c)
    operations = len(tape.nodes)
    rows = tuple(range(len(outputs)) if rows is None else rows)

    def text():
        text = print_value(tape, outputs, LANES)
        if linearised:
            text += print_linearised(tape, outputs, n_x, wrt, LANES, rows, rates)
        return text + print_functions(calls_of(tape), LANES)

    # what was recorded, and who prints it, decide what would be printed: a program in the cache is not derived and printed again
    engine = _compile(text, f"{tape.nodes}{outputs}{n_x}{tuple(wrt)}{linearised}{rows}{rates}{_engine_source()}")
    names = ["value", *(["linearised", "columns"] if linearised else []), *(["rates", "step"] if rates else [])]
    addresses = {name: engine.get_function_address(name) for name in names}
    return Program(n_x, n_u, n_c, len(outputs), tuple(wrt), operations=operations, **addresses)


@cache
def _engine_source() -> str:
    """Hash of the files that turn a recorded function into machine code."""
    here = Path(__file__).parent
    names = ("record.py", "derive.py", "approximations.py", "llvm_ir.py", "linearised.py", "machine.py")
    return hashlib.sha256(b"".join((here / name).read_bytes() for name in names)).hexdigest()


def _machine() -> llvm.TargetMachine:
    global _target_machine
    if _target_machine is None:
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        target = llvm.Target.from_default_triple()
        features = llvm.get_host_cpu_features().flatten()
        # straight lines of ten thousands of instructions: LLVM's schedulers take a time that grows with their square, and the processor
        # finds an order of its own; opt=1 has the one that comes after the registers are given out no more
        llvm.set_option("awes", "--enable-misched=false")
        _target_machine = target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=1, jit=True)
    return _target_machine


def _made_for() -> str:
    """What an object is made by, and the machine that it is made for."""
    features = llvm.get_host_cpu_features().flatten()
    return f"{llvm.llvm_version_info}{llvm.get_default_triple()}{llvm.get_host_cpu_name()}{features}"


def _compile(text: str | Callable[[], str], key: str = "") -> llvm.ExecutionEngine:
    """The engine that holds the functions of an IR text. key: what decides the text, where it is known without printing it."""
    machine = _machine()
    key = hashlib.sha256(f"{key or text}{_made_for()}".encode()).hexdigest()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    code = object_cache.load(key)
    if code is None:
        code = _emit(text if isinstance(text, str) else text(), machine)
        object_cache.store(key, code)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _KEPT.append(engine)
    return engine


def _emit(text: str, machine: llvm.TargetMachine) -> bytes:
    """Optimised machine code of an IR text, as an object file."""
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    options = llvm.create_pipeline_tuning_options(speed_level=1)
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module)


def evaluate(program: Program, x: np.ndarray, u: np.ndarray, c: np.ndarray) -> np.ndarray:
    """y (n_y, LANES) for x (n_x, LANES), u (n_u, LANES), c (n_c, LANES): one call from Python, for tests and single points."""
    import ctypes

    x, u, c = (np.ascontiguousarray(a, dtype=float) for a in (x, u, c))
    y = np.empty((program.n_y, LANES))
    function = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)(program.value)
    function(*(a.ctypes.data for a in (x, u, c, y)))
    return y
