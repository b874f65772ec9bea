"""awes: close the loop between an airborne wind energy model and its measured flights.

    from awescli import read_flight, read_kite, identify, trace, train, predict, simulate, report

What `__all__` names is the public interface, for scripts and notebooks (`awescli.api`); the version is semantic with respect to it, to the
command line and to the files that both write.
"""

import os
from typing import TYPE_CHECKING, Any

# Segments run in parallel here, and the matrices of one segment are small: a second pool of BLAS threads only makes both pools
# wait for each other, several times over on busy cores. Set before numpy is first imported; a user's own choice stands, but not while a
# stage runs (stages/blas.py): its numbers would depend on it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

if TYPE_CHECKING:
    from awescli.api import (
        Controller,
        Effect,
        Errors,
        Estimate,
        Flight,
        Hybrid,
        Identification,
        Kite,
        Picture,
        Prediction,
        Report,
        Simulation,
        Tracing,
        fit_controller,
        identify,
        predict,
        read_flight,
        read_kite,
        report,
        simulate,
        trace,
        train,
    )

__version__ = "0.1.0"

__all__ = [
    "Controller",
    "Effect",
    "Errors",
    "Estimate",
    "Flight",
    "Hybrid",
    "Identification",
    "Kite",
    "Picture",
    "Prediction",
    "Report",
    "Simulation",
    "Tracing",
    "fit_controller",
    "identify",
    "predict",
    "read_flight",
    "read_kite",
    "report",
    "simulate",
    "trace",
    "train",
]


def __getattr__(name: str) -> Any:
    """The public interface is loaded when it is first asked for: the command line answers `--help` without it."""
    if name not in __all__:
        raise AttributeError(f"module 'awescli' has no attribute '{name}'")
    from awescli import api

    globals()[name] = found = getattr(api, name)
    return found


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
