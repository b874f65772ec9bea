"""Exported files, flown by those who read them: a C compiler, an importer of FMUs, CasADi, JSBSim. None of them knows awes.

Each takes the folder of one form, the tables of the model's JSON and a ride, and gives (N+1, 24) outputs.
"""

import ctypes
import os
import re
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from awescli.export.fmu import variable_name
from awescli.export.jsbsim_aircraft import FRAMES, FT, SLUG, property_name
from awescli.notation.quantities import OUTPUTS, SURFACES

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
ADAMS_BASHFORTH_3 = 4
PERIODIC = [OUTPUTS.index(name) for name in ("phi", "psi")]


@dataclass(frozen=True)
class Ride:
    """What is flown. start: (12,) states; inputs (N+1, n) in the order of the tables; set_points (N+1, 5); dt: sample interval [s]."""

    start: np.ndarray
    inputs: np.ndarray
    set_points: np.ndarray
    dt: float

    def __len__(self) -> int:
        return len(self.inputs)

    def until(self, samples: int) -> "Ride":
        """The first samples."""
        return Ride(self.start, self.inputs[:samples], self.set_points[:samples], self.dt)


def put(folder: Path, files: Mapping[str, str | bytes]) -> Path:
    """Exported files, in a folder."""
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return folder


def names(tables: Mapping, kind: str) -> list[str]:
    return [signal["name"] for signal in tables[kind]]


def relative(found: np.ndarray, wanted: np.ndarray, span: np.ndarray) -> np.ndarray:
    """(24,) largest difference of outputs, in shares of `span`; angles modulo a turn."""
    error = found - wanted
    error[:, PERIODIC] = (error[:, PERIODIC] + np.pi) % (2 * np.pi) - np.pi
    return np.abs(error).max(axis=0) / span


def compiled(folder: Path) -> ctypes.CDLL:
    """Every .c of a folder, without a warning."""
    sources = sorted(str(p) for p in folder.glob("*.c"))
    done = subprocess.run(
        ["gcc", *FLAGS, "-O2", "-shared", "-fPIC", *sources, "-o", str(folder / "model.so"), "-lm"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(folder / "model.so"))


def in_c(folder: Path, tables: Mapping, ride: Ride) -> np.ndarray:
    """Stepped from sample to sample, with the file's own parameters."""
    library, name = compiled(folder), tables["identifier"]
    address = lambda a: a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) if isinstance(a, np.ndarray) else a  # noqa: E731
    call = lambda f, *a: getattr(library, f"{name}_{f}")(*map(address, a))  # noqa: E731
    U, SP = np.ascontiguousarray(ride.inputs), np.ascontiguousarray(ride.set_points)
    c = ctypes.byref(ctypes.c_double.in_dll(library, f"{name}_parameters"))
    x, found = np.zeros(len(tables["states"]) + SP.shape[1]), np.empty((len(U), len(OUTPUTS)))
    x[:12] = ride.start
    call("hold", x, U[0], SP[0], c)
    call("initial", x, U[0], c)
    for k in range(len(U)):
        call("hold", x, U[k], SP[k], c)
        call("outputs", x, U[k], c, found[k])
        if k + 1 < len(U):
            call("step", x, U[k], U[k + 1], SP[k], SP[k + 1], c, ctypes.c_double(ride.dt))
    return found


class Importer:
    """An instance of an unpacked and compiled FMU whose variables are set and read by name."""

    def __init__(self, kind, unzipped: str, identifier: str):
        import fmpy

        description = fmpy.read_model_description(unzipped)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.fmu = kind(guid=description.guid, unzipDirectory=unzipped, modelIdentifier=identifier, instanceName="one")
        self.fmu.instantiate()

    def set(self, kind: str, names, values, derivative: bool = False) -> None:
        self.fmu.setFloat64([self.references[variable_name(kind, n, derivative)] for n in names], [float(v) for v in values])

    def get(self, kind: str, names) -> list[float]:
        return self.fmu.getFloat64([self.references[variable_name(kind, n)] for n in names])

    def at_sample(self, tables: Mapping, ride: Ride, k: int) -> None:
        """Set-points and inputs of a sample, and how these run to the next one."""
        ahead = ride.inputs[min(k + 1, len(ride) - 1)]
        self.set("input", names(tables, "inputs"), ride.inputs[k])
        self.set("input", names(tables, "inputs"), (ahead - ride.inputs[k]) / ride.dt, derivative=True)
        self.set("set_point", names(tables, "set_points"), ride.set_points[k])


def unpacked(folder: Path) -> str:
    """The one FMU of a folder, unpacked and compiled by fmpy itself."""
    import fmpy
    from fmpy.build import build_platform_binary

    (file,) = folder.glob("*.fmu")
    unzipped = fmpy.extract(str(file), unzipdir=str(folder / "unpacked"))
    build_platform_binary(unzipped, all_warnings=True)
    return unzipped


def in_fmu(unzipped: str, tables: Mapping, ride: Ride) -> np.ndarray:
    """Co-Simulation whose communication points are the samples, from the start that the FMU carries."""
    import fmpy.fmi3

    one = Importer(fmpy.fmi3.FMU3Slave, unzipped, tables["identifier"])
    one.set("state", names(tables, "states")[:12], ride.start)
    one.at_sample(tables, ride, 0)
    one.fmu.enterInitializationMode(startTime=0.0)
    one.fmu.exitInitializationMode()
    found = np.empty((len(ride), len(OUTPUTS)))
    for k in range(len(ride)):
        one.at_sample(tables, ride, k)
        found[k] = one.get("sensor", names(tables, "outputs"))
        if k + 1 < len(ride):
            one.fmu.doStep(k * ride.dt, ride.dt)
    one.fmu.terminate()
    one.fmu.freeInstance()
    return found


def in_casadi(folder: Path, tables: Mapping, ride: Ride) -> np.ndarray:
    """The functions, loaded from their files."""
    import casadi as ca

    f = {p.stem: ca.Function.load(str(p)) for p in folder.glob("*.casadi")}
    c, U, SP = np.array([p["value"] for p in tables["parameters"]]), ride.inputs, ride.set_points
    x = ca.DM([*ride.start, *np.zeros(len(tables["states"]) - 12), *SP[0]])
    x = f["initial"](f["hold"](x, U[0], SP[0], c), U[0], c)
    found = np.empty((len(ride), len(OUTPUTS)))
    for k in range(len(ride)):
        found[k] = np.array(f["outputs"](f["hold"](x, U[k], SP[k], c), U[k], c)).ravel()
        if k + 1 < len(ride):
            x = f["step"](x, U[k], U[k + 1], SP[k], SP[k + 1], c)
    return found


def in_jsbsim(folder: Path, tables: Mapping, ride: Ride, frames_per_second: int = FRAMES) -> np.ndarray:
    """The aircraft from its own file of initial conditions; inputs linear between samples, set-points held."""
    jsbsim = pytest.importorskip("jsbsim", reason="jsbsim is not installed (extra `test`)")
    os.environ.setdefault("JSBSIM_DEBUG", "0")
    machine = jsbsim.FGFDMExec(str(folder))
    machine.set_debug_level(0)
    machine.set_aircraft_path("aircraft")
    machine.set_dt(1 / frames_per_second)
    assert machine.load_planet(str(folder / "planet.xml"), False) and machine.load_model(tables["identifier"])
    machine["simulation/gravity-model"] = 0
    for integrator in ("rate/rotational", "rate/translational", "position/rotational", "position/translational"):
        machine[f"simulation/integrator/{integrator}"] = ADAMS_BASHFORTH_3
    assert machine.load_ic("start.xml", True)
    U, frames = ride.inputs, round(ride.dt * frames_per_second)
    given = [(i, n) for i, n in enumerate(names(tables, "inputs")) if not re.match("gust|force|moment", n)]

    def give(k: int, share: float) -> None:
        u = U[k] + share * (U[min(k + 1, len(U) - 1)] - U[k])
        for i, name in given:
            density = name == "density"
            machine["atmosphere/override/density" if density else property_name("input", name)] = u[i] / (SLUG * FT**3 if density else 1.0)
        for name, x in zip(SURFACES, ride.set_points[k], strict=True):
            machine[property_name("set_point", name)] = float(x)

    give(0, 0.0)
    machine.run_ic()
    found = []
    for k in range(len(U)):
        for i in range(1, frames + 1) if k else ():
            give(*((k - 1, i / frames) if i < frames else (k, 0.0)))
            machine.run()
        found.append([machine[property_name("sensor", name)] for name in names(tables, "outputs")])
    return np.array(found)
