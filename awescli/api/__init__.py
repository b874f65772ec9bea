"""Floor 8: awes from Python, beside the command line: the same stages, with results that a notebook shows.

    from awescli import read_flight, read_kite, identify, trace, train, predict, simulate, report

    found = identify(read_flight("data/km1_demo"), read_kite("data/kites/km1_initial.yaml"))
    traced = trace(found)
    print(traced.verdict, traced.effects)

What this room exports is the public interface, kept by semantic versioning; all below it may change with any version.
"""

from awescli.api.figures import Picture
from awescli.api.inputs import Flight, Kite, read_flight, read_kite
from awescli.api.models import Controller, Hybrid, Identification, Tracing
from awescli.api.proofs import Prediction, Report, Simulation
from awescli.api.values import Effect, Errors, Estimate
from awescli.api.verbs import fit_controller, identify, predict, report, simulate, trace, train

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
