"""README.md of an exported folder: what it holds and how to use it. The texts stand in readmes/; their examples run as they stand there."""

from collections.abc import Mapping
from pathlib import Path
from string import Template

from awescli.export.jsbsim_aircraft import FRAMES
from awescli.export.model import ExportedModel
from awescli.notation.quantities import SURFACES

TEXTS = Path(__file__).with_name("readmes")


def readme(model: ExportedModel, form: str) -> str:
    """The text of one form, in the names of this model."""
    law = model.programs.law is not None
    words = {
        "name": model.identifier,
        "upper": model.identifier.upper(),
        "dt": repr(model.dt),
        "density": repr(model.start.inputs.get("density", 1.225)),
        "set_points": str(len(SURFACES)),
        "frames": str(FRAMES),
        "asked_at_points": ", a flight controller is asked at every communication point" if law else "",
        "law_function": "`law(x, u, c)` (set-points of the flight controller), " if law else "",
    }
    return _head(model) + "\n" + Template((TEXTS / f"{form}.md").read_text()).substitute(words)


def _head(model: ExportedModel) -> str:
    """Which model it is, and what it was made from."""
    surfaces = "the fitted flight controller moves its surfaces" if model.programs.law else "set-points of the surfaces are inputs"
    network = "; a network adds to its rates of change" if model.correction is not None else ""
    counts = f"{len(model.states)} states, {len(model.inputs)} inputs, {len(model.parameters)} parameters; {surfaces}{network}"
    rates = ", ".join(f"`{s.name}`" for s in model.inputs if s.name.removesuffix("_rate") in SURFACES)
    lines = [
        f"# {model.declaration.name}: the {model.label} model",
        *([model.declaration.description] if model.declaration.description else []),
        f"{counts}. SI units and radians, NED axes from the winch, FRD body axes.",
        f"The state vector holds the states, then the {len(SURFACES)} set-points ({', '.join(SURFACES)}) that are held now.",
        f"The start that is given: {model.start.origin}.",
        *([f"Rates of commands, with which lags begin: {rates}; null is what `awes simulate` flies."] if rates else []),
        "\n".join(f"- {key}: {value}" for key, value in model.provenance.items() if not isinstance(value, Mapping)),
    ]
    return "\n\n".join(lines) + "\n"
