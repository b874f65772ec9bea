"""The C file flies what the simulator flies."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest
from export.models import CASES, Flown, compared, with_one
from kites import every_key

from awescli.export.c_code import c_files

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc on this machine")


def compiled(files: dict, folder) -> ctypes.CDLL:
    for name, text in files.items():
        (folder / name).write_text(text)
    sources = [str(folder / name) for name in files if name.endswith(".c")]
    command = ["gcc", *FLAGS, "-O2", "-shared", "-fPIC", *sources, "-o", str(folder / "model.so"), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(folder / "model.so"))


def fly(library: ctypes.CDLL, flown: Flown) -> np.ndarray:
    """(N+1, 24) outputs of a flight, stepped from sample to sample."""
    name, n_s = flown.model.identifier, len(flown.model.states)
    address = lambda a: a.ctypes.data_as(ctypes.POINTER(ctypes.c_double))  # noqa: E731
    call = lambda f, *a: getattr(library, f"{name}_{f}")(*(address(v) if isinstance(v, np.ndarray) else ctypes.c_double(v) for v in a))  # noqa: E731
    U, SP = np.ascontiguousarray(flown.inputs), np.ascontiguousarray(flown.set_points)
    c = np.array([s.value for s in flown.model.parameters])
    x, found = np.zeros(n_s + SP.shape[1]), np.empty_like(flown.outputs)
    x[:12] = flown.segments.starts[0]
    call("hold", x, U[0], SP[0], c)
    call("initial", x, U[0], c)
    for k in range(len(U)):
        call("hold", x, U[k], SP[k], c)
        call("outputs", x, U[k], c, found[k])
        if k + 1 < len(U):
            call("step", x, U[k], U[k + 1], SP[k], SP[k + 1], c, flown.segments.dt)
    return found


@pytest.mark.parametrize("case", CASES)
def test_c_flies_the_same_ten_seconds(case, tmp_path):
    flown = CASES[case]()
    files = c_files(flown.model)
    assert sum(map(len, files.values())) < 200_000
    assert compared(flown, fly(compiled(files, tmp_path), flown)) < 1e-9


@pytest.mark.parametrize("key", every_key())
def test_every_effect_flies_in_c(key, tmp_path):
    """A second with one effect at a plausible size."""
    flown = with_one(key)
    assert compared(flown, fly(compiled(c_files(flown.model), tmp_path), flown)) < 1e-9
