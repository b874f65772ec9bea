"""read_flight: a folder -> FlightLog, by the reader that what is in it calls for."""

from collections.abc import Callable
from pathlib import Path

from awescli.flightlog.ampyx_mat import read_ampyx
from awescli.flightlog.faults import mark_faults
from awescli.flightlog.flight_check import read_flight_file
from awescli.flightlog.kitemill_csv import read_kitemill
from awescli.flightlog.log import FlightLog
from awescli.flightlog.mapped_csv import read_mapped
from awescli.notation.errors import BadInput

NEEDED_BY_MODEL = (
    "p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r", "tether_length", "reel_out_speed",
)  # fmt: skip
"""What a model of a rigid kite on a tether cannot do without, besides a surface that moves and the wind."""


def read_flight(flight: Path, max_gap: float = 0.2) -> FlightLog:
    """The flight in the folder `flight` (or described by the YAML file `flight`), with sensor faults marked invalid.

    max_gap: longest gap that may be interpolated [s]. Raises BadInput, with its place and cure, for all that cannot be read.
    """
    flight = Path(flight)
    if not flight.exists():
        near = sorted(p.name for p in flight.parent.iterdir() if p.is_dir()) if flight.parent.is_dir() else []
        raise BadInput("there is no such flight folder", str(flight), f"Beside it: {', '.join(near[:8])}." if near else "Check the path.")
    if flight.is_file() and flight.suffix in (".yaml", ".yml"):
        return mark_faults(_declared(flight, max_gap))
    if not flight.is_dir():
        raise BadInput("a flight is a folder, this is a file", str(flight), f"Give its folder: {flight.parent}.")
    for pattern, read in READERS:
        if found := sorted(flight.glob(pattern)):
            if len(found) > 1:
                names = ", ".join(p.name for p in found[:8])
                raise BadInput(
                    f"several logs: {names}", str(flight), "Say which one in a flight.yaml (`file: NAME`), or give each its folder."
                )
            return mark_faults(read(found[0], max_gap))
    there = ", ".join(sorted(p.name for p in flight.iterdir())[:12]) or "nothing"
    raise BadInput(
        "no flight log that awes knows",
        str(flight),
        f"Looked for {', '.join(p for p, _ in READERS)}; there is: {there}. Map a CSV in flight.yaml.",
    )


def missing_for_model(log: FlightLog) -> list[str]:
    """What a model would still need and the log does not have; empty for a complete log."""
    missing = [name for name in NEEDED_BY_MODEL if name not in log]
    if not any(name in log for name in ("aileron", "elevator", "rudder")):
        missing.append("a control surface (aileron, elevator or rudder)")
    if log.wind is None:
        missing.append("wind (direction and speed)")
    return missing


def _declared(path: Path, max_gap: float) -> FlightLog:
    """The log that a flight.yaml describes."""
    declared = read_flight_file(path)
    mapping = declared.file
    if mapping.format == "csv":
        return read_mapped(declared, max_gap)
    late = {group: float(value) for group, value in mapping.clocks.items() if value != "auto"}
    pattern = mapping.file or ("kite.csv" if mapping.format == "kitemill" else "*.mat")
    found = sorted(path.parent.glob(pattern)) if mapping.file is None else [path.parent / mapping.file]
    if len(found) != 1 or not found[0].is_file():
        raise BadInput(f"there is no single {pattern} for format {mapping.format}", f"{path}: file", "Name the log: `file: NAME`.")
    if mapping.format == "ampyx":
        return read_ampyx(found[0], max_gap, late)
    return read_kitemill(found[0].parent, max_gap, mapping.units, mapping.station_height, found[0].name, late)


READERS: tuple[tuple[str, Callable[[Path, float], FlightLog]], ...] = (
    ("flight.yaml", _declared),
    ("*.mat", read_ampyx),
    ("kite.csv", lambda path, max_gap: read_kitemill(path.parent, max_gap)),
)
"""What to look for in a folder, in this order, and who reads it."""
