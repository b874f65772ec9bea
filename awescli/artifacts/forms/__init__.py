"""What each artifact must hold for its readers: one form a file, each with a version; more than that is allowed in any of them."""

from collections.abc import Mapping
from dataclasses import dataclass

from pydantic import BaseModel

from awescli.artifacts.forms.arrays import ARRAYS
from awescli.artifacts.forms.controllers import Controller, ControllerFit
from awescli.artifacts.forms.effects import Effects, Traced
from awescli.artifacts.forms.evaluated import Scores
from awescli.artifacts.forms.hybrids import Network, Training
from awescli.artifacts.forms.parameters import Fit, Params
from awescli.artifacts.forms.provenance import Provenance
from awescli.artifacts.forms.simulated import Flown
from awescli.artifacts.forms.words import Metrics

__all__ = ["ARRAYS", "FORMS", "Form"]


@dataclass(frozen=True)
class Form:
    """How one file looks today. unversioned: awes 0.1 wrote the same form, without a version."""

    model: type[BaseModel]
    version: int = 2
    unversioned: bool = False


FORMS: Mapping[str, Form] = {
    "provenance.json": Form(Provenance, unversioned=True),
    "params.json": Form(Params),
    "effects.json": Form(Effects),
    "network.json": Form(Network),
    "controller.json": Form(Controller),
    "metrics.json": Form(Metrics),
    "fit-controller/metrics.json": Form(ControllerFit),
    "identify/metrics.json": Form(Fit),
    "trace-residual/metrics.json": Form(Traced),
    "train-hybrid/metrics.json": Form(Training),
    "simulate/metrics.json": Form(Flown),
    "evaluate/metrics.json": Form(Scores),
}
"""File, with its stage where stages differ -> its form."""
