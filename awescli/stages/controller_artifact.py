"""controller.json and controller.safetensors: how a control law lies on disk."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from awescli.control.law import Law
    from awescli.flightlog.log import FlightLog


def write_controller(folder: Path, law: "Law") -> None:
    """Write a law's description and its numbers."""
    from awescli.artifacts import write_json, write_tensors
    from awescli.control.laws import to_artifact

    document, arrays = to_artifact(law)
    write_json(folder / "controller.json", document)
    write_tensors(folder / "controller.safetensors", arrays)


def read_controller(folder: Path) -> "Law":
    """The law that `write_controller` wrote. Raises BadInput for a folder that is not whole, or holds something else."""
    from awescli.artifacts import read_json, read_tensors
    from awescli.control.laws import from_artifact
    from awescli.notation.errors import BadInput

    file, again = folder / "controller.json", "Make it again: awes fit-controller --force."
    document, arrays = read_json(file), read_tensors(folder / "controller.safetensors")
    try:
        return from_artifact(document, arrays)
    except (KeyError, TypeError, ValueError, AttributeError) as e:
        raise BadInput(f"not a controller that awes wrote ({type(e).__name__}: {e})", str(file), again) from None
    except BadInput as e:
        raise BadInput(f"not a controller that awes wrote ({e.what})", str(file), again) from None


def wind_direction(log: "FlightLog") -> float:
    """Mean direction the wind comes from over a flight [rad]."""
    from awescli.notation.angles import mean_direction

    if log.wind is None:
        return 0.0
    return mean_direction(log.wind.direction)
