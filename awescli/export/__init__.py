"""Floor 6: models in the languages of other programs. EXPORTERS is the table: each prints the recorded equations, or their values."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from awescli.export.awebox import awebox_files
from awescli.export.c_code import c_files
from awescli.export.casadi_functions import casadi_files
from awescli.export.fmu import fmu_files
from awescli.export.jsbsim_aircraft import jsbsim_files
from awescli.export.json_tables import json_files
from awescli.export.kitemodels import kitemodels_files
from awescli.export.model import ExportedModel
from awescli.export.readme import readme

Files = Mapping[str, str | bytes]


@dataclass(frozen=True)
class Exporter:
    """One form. doc: what it is, a few words; files: model -> relative path -> content, BadInput where the form cannot hold the model."""

    doc: str
    files: Callable[[ExportedModel], Files]


EXPORTERS: dict[str, Exporter] = {
    "c": Exporter("C99, one file, no allocation", c_files),
    "fmu": Exporter("FMI 3.0 source FMU, Co-Simulation and Model Exchange", fmu_files),
    "casadi": Exporter("casadi.Function (extra `casadi`)", casadi_files),
    "jsbsim": Exporter("aircraft of JSBSim", jsbsim_files),
    "awebox": Exporter("parameters of awebox", awebox_files),
    "kitemodels": Exporter("settings of KiteModels.jl", kitemodels_files),
    "json": Exporter("tables with units, intervals and provenance", json_files),
}


def exported(model: ExportedModel, form: str) -> Files:
    """All files of one form, README.md among them: relative path -> content. Raises BadInput where the form cannot hold the model."""
    return {**EXPORTERS[form].files(model), "README.md": readme(model, form)}
