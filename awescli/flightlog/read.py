"""read_flight: a folder -> FlightLog, by the reader that what is in it calls for."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from awescli.flightlog.ampyx_mat import read_ampyx
from awescli.flightlog.ardupilot_bin import read_ardupilot
from awescli.flightlog.autopilot import Autopilot
from awescli.flightlog.clocks import motor_lateness
from awescli.flightlog.faults import mark_faults
from awescli.flightlog.flight_check import read_flight_file
from awescli.flightlog.kitemill_csv import read_kitemill
from awescli.flightlog.log import FlightLog
from awescli.flightlog.mapped_csv import read_mapped
from awescli.flightlog.mat5 import variables
from awescli.flightlog.phases import phases
from awescli.flightlog.px4_ulog import read_px4
from awescli.flightlog.umn_mat import STRUCT, read_umn
from awescli.notation.errors import BadInput

NEEDED_BY_MODEL = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r")
"""What no model of a rigid wing can do without, besides a surface that moves and the wind."""

NEEDED_ON_LINE = ("tether_length", "reel_out_speed")
"""What a model on a tether needs further; a kite file says what its own kite needs (`physics.kite.needed_by`)."""


def read_flight(flight: Path, max_gap: float = 0.2) -> FlightLog:
    """The flight in the folder `flight` (or described by the YAML file `flight`), with sensor faults marked invalid.

    max_gap: longest gap that may be interpolated [s]. Raises BadInput, with its place and cure, for all that cannot be read.
    """
    flight = Path(flight)
    if not flight.exists():
        near = sorted(p.name for p in flight.parent.iterdir() if p.is_dir()) if flight.parent.is_dir() else []
        raise BadInput("there is no such flight folder", str(flight), f"Beside it: {', '.join(near[:8])}." if near else "Check the path.")
    if flight.is_file() and flight.suffix in (".yaml", ".yml"):
        return mark_faults(airborne(_declared(flight, max_gap)))
    if not flight.is_dir():
        raise BadInput("a flight is a folder, this is a file", str(flight), f"Give its folder: {flight.parent}.")
    for pattern, read in READERS:
        if found := sorted(flight.glob(pattern)):
            if len(found) > 1:
                names = ", ".join(p.name for p in found[:8])
                raise BadInput(
                    f"several logs: {names}", str(flight), "Say which one in a flight.yaml (`file: NAME`), or give each its folder."
                )
            return mark_faults(airborne(read(found[0], max_gap)))
    there = ", ".join(sorted(p.name for p in flight.iterdir())[:12]) or "nothing"
    raise BadInput(
        "no flight log that awes knows",
        str(flight),
        f"Looked for {', '.join(p for p, _ in READERS)}; there is: {there}. Map a CSV in flight.yaml.",
    )


def airborne(log: FlightLog) -> FlightLog:
    """A free flight without the time on the ground before and after it, on a clock that begins where it flies; as it is, where it does not
    fly, or flies on a line (a winch has its own phases)."""
    flown = np.array([]) if log.on_line or missing_for_model(log) else np.flatnonzero(phases(log) == "flight")
    if not flown.size:
        return log
    first, last = int(flown[0]), int(flown[-1]) + 1
    before, after = first * log.dt, (len(log) - last) * log.dt
    if max(before, after) < log.dt:
        return log
    cut = log.between(first, last)
    return replace(
        cut, time=cut.time - cut.time[0], start=log.start + float(cut.time[0]),
        wind=None if log.wind is None else replace(log.wind, time=log.wind.time - cut.time[0]),
        notes=(*log.notes, f"{before:.0f} s before the flight and {after:.0f} s after it, on the ground, were cut off."),
    )  # fmt: skip


def missing_for_model(log: FlightLog, needed: Iterable[str] | None = None) -> list[str]:
    """What a model would still need and the log does not have; empty for a complete log.

    needed: further channels that the kite needs; where no kite is known, those of a line if the log has anything of one.
    """
    further = (NEEDED_ON_LINE if log.on_line else ()) if needed is None else tuple(needed)
    missing = [name for name in (*NEEDED_BY_MODEL, *further) if name not in log]
    if not any(name in log for name in ("aileron", "elevator", "rudder")):
        missing.append("a control surface (aileron, elevator or rudder)")
    if log.wind is None:
        missing.append("wind (direction and speed)")
    if not missing and (phases(log) == "ground").all():
        speed, height = np.sqrt(log["v_n"] ** 2 + log["v_e"] ** 2).max(), -log["p_d"].min()
        missing.append(f"a flight: it never leaves the ground (at most {speed:.1f} m/s, {height:.1f} m above its origin)")
    if "motor_speed" in further and "motor_speed" in log and (late := motor_lateness(log)) is not None:
        said = f"`clocks: {{motor: {late:.1f}}}` in a flight.yaml moves it"
        missing.append(f"a motor_speed on the log's clock: it follows the throttle {late:.1f} s late ({said})")
    return missing


def _declared(path: Path, max_gap: float) -> FlightLog:
    """The log that a flight.yaml describes."""
    declared = read_flight_file(path)
    mapping = declared.file
    if mapping.format == "csv":
        return read_mapped(declared, max_gap)
    late = {group: float(value) for group, value in mapping.clocks.items() if value != "auto"}
    pattern = mapping.file or PATTERNS[mapping.format]
    found = sorted(path.parent.glob(pattern)) if mapping.file is None else [path.parent / mapping.file]
    if len(found) != 1 or not found[0].is_file():
        raise BadInput(f"there is no single {pattern} for format {mapping.format}", f"{path}: file", "Name the log: `file: NAME`.")
    if mapping.format == "ampyx":
        return read_ampyx(found[0], max_gap, late)
    if mapping.format in OF_AUTOPILOTS:
        how = Autopilot(mapping.mix, mapping.navigation, str(path), late)
        return OF_AUTOPILOTS[mapping.format](found[0], max_gap, how)
    return read_kitemill(found[0].parent, max_gap, mapping.units, mapping.station_height, found[0].name, late)


def _matlab(path: Path, max_gap: float) -> FlightLog:
    """A .mat file of either layout, by the struct that it holds."""
    return (read_umn if STRUCT in variables(path) else read_ampyx)(path, max_gap)


OF_AUTOPILOTS = {"umn": read_umn, "px4": read_px4, "ardupilot": read_ardupilot}
"""Formats of logs that an autopilot writes, whose channels flight.yaml may mix and choose from."""

PATTERNS = {"kitemill": "kite.csv", "ampyx": "*.mat", "umn": "*.mat", "px4": "*.ulg", "ardupilot": "*.[bB][iI][nN]"}
"""Format -> the file that is looked for where flight.yaml names none."""

READERS: tuple[tuple[str, Callable[[Path, float], FlightLog]], ...] = (
    ("flight.yaml", _declared),
    ("*.mat", _matlab),
    ("kite.csv", lambda path, max_gap: read_kitemill(path.parent, max_gap)),
    ("*.ulg", read_px4),
    (PATTERNS["ardupilot"], read_ardupilot),
)
"""What to look for in a folder, in this order, and who reads it."""
