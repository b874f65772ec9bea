"""read_flight: a folder -> FlightLog, by the reader that what is in it calls for."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from awescli.flightlog.ampyx_mat import read_ampyx
from awescli.flightlog.ardupilot_bin import read_ardupilot
from awescli.flightlog.autopilot import Autopilot
from awescli.flightlog.clocks import motor_lateness
from awescli.flightlog.faults import mark_faults
from awescli.flightlog.files import MATLAB, FlightFiles, find_flight
from awescli.flightlog.kitemill_csv import read_kitemill
from awescli.flightlog.log import FlightLog
from awescli.flightlog.mapped_csv import read_mapped
from awescli.flightlog.mat5 import variables
from awescli.flightlog.phases import phases
from awescli.flightlog.px4_ulog import read_px4
from awescli.flightlog.surface_noise import with_smooth_surfaces
from awescli.flightlog.thinning import thinned
from awescli.flightlog.umn_mat import STRUCT, read_umn
from awescli.flightlog.winch_motion import with_smooth_winch

NEEDED_BY_MODEL = ("p_n", "p_e", "p_d", "v_n", "v_e", "v_d", "phi", "theta", "psi", "p", "q", "r")
"""What no model of a rigid wing can do without, besides a surface that moves and the wind."""

NEEDED_ON_LINE = ("tether_length", "reel_out_speed")
"""What a model on a tether needs further; a kite file says what its own kite needs (`physics.kite.needed_by`)."""


def read_flight(flight: Path, max_gap: float = 0.2) -> FlightLog:
    """The flight in the folder `flight` (or described by the YAML file `flight`), with sensor faults marked invalid, the winch's motion
    and that of noisy surfaces smooth (`winch_motion`, `surface_noise`), at 50 Hz or a little more where it was logged faster (`thinning`).

    max_gap: longest gap that may be interpolated [s]. Raises BadInput, with its place and cure, for all that cannot be read.
    """
    found = find_flight(Path(flight))
    return thinned(with_smooth_surfaces(with_smooth_winch(mark_faults(airborne(READERS[found.format](found, max_gap))))))


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


def _late(found: FlightFiles) -> dict[str, float]:
    """Clock group -> s by which it records late, as the flight.yaml says."""
    clocks = found.declared.file.clocks if found.declared else {}
    return {group: float(value) for group, value in clocks.items() if value != "auto"}


def _kitemill(found: FlightFiles, max_gap: float) -> FlightLog:
    if found.declared is None:
        return read_kitemill(found.log, found.weather, max_gap)
    mapping = found.declared.file
    return read_kitemill(found.log, found.weather, max_gap, mapping.units, mapping.station_height, _late(found))


def _matlab(found: FlightFiles, max_gap: float) -> FlightLog:
    """A .mat file of either layout, by the struct that it holds."""
    return (read_umn if STRUCT in variables(found.log) else read_ampyx)(found.log, max_gap)


def _autopilot(read: Callable[[Path, float, Autopilot | None], FlightLog]) -> Callable[[FlightFiles, float], FlightLog]:
    """The reader of logs that an autopilot writes, whose channels a flight.yaml may mix and choose from."""

    def reader(found: FlightFiles, max_gap: float) -> FlightLog:
        how = None
        if found.declared is not None:
            mapping = found.declared.file
            how = Autopilot(mapping.mix, mapping.navigation, str(found.declared.path), _late(found))
        return read(found.log, max_gap, how)

    return reader


READERS: Mapping[str, Callable[[FlightFiles, float], FlightLog]] = {
    "csv": read_mapped,
    "ampyx": lambda found, max_gap: read_ampyx(found.log, max_gap, _late(found)),
    MATLAB: _matlab,
    "kitemill": _kitemill,
    "umn": _autopilot(read_umn),
    "px4": _autopilot(read_px4),
    "ardupilot": _autopilot(read_ardupilot),
}
"""Format -> its reader."""
