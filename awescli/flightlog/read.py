"""read_flight: a folder -> FlightLog, by the reader that what is in it calls for."""

from collections.abc import Callable, Mapping
from pathlib import Path

from awescli.flightlog.ampyx_mat import read_ampyx
from awescli.flightlog.faults import mark_faults
from awescli.flightlog.files import FlightFiles, find_flight
from awescli.flightlog.kitemill_csv import read_kitemill
from awescli.flightlog.log import FlightLog
from awescli.flightlog.mapped_csv import read_mapped

NEEDED_BY_MODEL = (
    "p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r", "tether_length", "reel_out_speed",
)  # fmt: skip
"""What a model of a rigid kite on a tether cannot do without, besides a surface that moves and the wind."""


def read_flight(flight: Path, max_gap: float = 0.2) -> FlightLog:
    """The flight in the folder `flight` (or described by the YAML file `flight`), with sensor faults marked invalid.

    max_gap: longest gap that may be interpolated [s]. Raises BadInput, with its place and cure, for all that cannot be read.
    """
    found = find_flight(Path(flight))
    return mark_faults(READERS[found.format](found, max_gap))


def missing_for_model(log: FlightLog) -> list[str]:
    """What a model would still need and the log does not have; empty for a complete log."""
    missing = [name for name in NEEDED_BY_MODEL if name not in log]
    if not any(name in log for name in ("aileron", "elevator", "rudder")):
        missing.append("a control surface (aileron, elevator or rudder)")
    if log.wind is None:
        missing.append("wind (direction and speed)")
    return missing


def _late(found: FlightFiles) -> dict[str, float]:
    """Clock group -> s by which it records late, as the flight.yaml says."""
    clocks = found.mapping.clocks if found.mapping else {}
    return {group: float(value) for group, value in clocks.items() if value != "auto"}


def _kitemill(found: FlightFiles, max_gap: float) -> FlightLog:
    if found.mapping is None:
        return read_kitemill(found.log, found.weather, max_gap)
    return read_kitemill(found.log, found.weather, max_gap, found.mapping.units, found.mapping.station_height, _late(found))


READERS: Mapping[str, Callable[[FlightFiles, float], FlightLog]] = {
    "csv": lambda found, max_gap: read_mapped(found.declaration, found.log, found.mapping, max_gap),
    "ampyx": lambda found, max_gap: read_ampyx(found.log, max_gap, _late(found)),
    "kitemill": _kitemill,
}
"""Format -> its reader."""
