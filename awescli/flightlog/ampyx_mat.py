"""Ampyx Power's published MATLAB file -> FlightLog.

A file holds one struct `validationData`: NED, SI, radians, `R` body to NED. Its winch signals run on their own clock and
are moved onto the onboard clock where the reeling motion shows by how much (clocks.py).
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from awescli.flightlog.clocks import clock_offset
from awescli.flightlog.log import FlightLog, WindRecord
from awescli.flightlog.mat5 import read_mat
from awescli.flightlog.resample import RawFlight, uniform_log, usable_stamps
from awescli.flightlog.spikes import without_spikes
from awescli.flightlog.table import ABSURD
from awescli.notation.errors import BadInput, did_you_mean

STRUCT = "validationData"

FIELDS = {
    "phi": None, "theta": None, "psi": None,
    "V_a": "airspeed", "alpha": "angleOfAttack", "beta": "sideSlip", "tension": "tetherTension", "reel_out_speed": "tetherSpeed",
}  # fmt: skip
"""Quantity -> scalar field of `response` (None: from R)."""

TAUT = 0.5
"""Share of the largest tension above which the line is taken to be straight, and its length to be the range."""


def read_ampyx(path: Path, max_gap: float = 0.2, late: Mapping[str, float] | None = None) -> FlightLog:
    """An Ampyx .mat file as a flight log.

    late: clock group -> s by which it records late; without "winch" it is estimated. Raises BadInput for files that are
    damaged, hold MATLAB objects, or lack a field.
    """
    top = _load(path)
    response, controls = _member(path, top, "response"), _member(path, top, "controls")
    seconds = _field(path, controls, "controls", "times")
    count = seconds.size
    vectors = {name: _field(path, response, "response", name, (3, count)) for name in ("p", "v", "w")}
    rotation = _field(path, response, "response", "R", (3, 3, count))
    if not np.allclose(np.einsum("ijk,ljk->kil", rotation, rotation), np.eye(3), atol=1e-3):
        raise BadInput("response.R does not hold rotation matrices", str(path), "Expected 3x3xN, body to NED.")
    signals = {name: vectors["p"][i] for i, name in enumerate(("p_n", "p_e", "p_d"))}
    signals |= {name: vectors["v"][i] for i, name in enumerate(("v_n", "v_e", "v_d"))}
    signals |= dict(zip(("phi", "theta", "psi"), euler_angles(rotation), strict=True))
    signals |= {name: vectors["w"][i] for i, name in enumerate("pqr")}
    signals |= {q: _field(path, response, "response", field, (count,)) for q, field in FIELDS.items() if field}
    signals |= {s: _field(path, controls, "controls", s, (count,)) for s in ("aileron", "elevator", "rudder")}
    air = _field(path, controls, "controls", "wind", (3, count))
    start = float(_field(path, top, STRUCT, "times")[0])
    rows, notes = usable_stamps(seconds)[0], []
    if rows.size < max(count, 3):
        if rows.size < 3 or not np.isfinite(start):
            raise BadInput("controls.times is no clock that runs forward", str(path), "Is the file complete?")
        notes.append(f"{count - rows.size} samples whose time stamps are missing or do not run forward were removed.")
        seconds, air, signals = seconds[rows], air[:, rows], {name: signal[rows] for name, signal in signals.items()}
    signals, spikes = without_spikes(signals, np.arange(seconds.size))
    whole = {name: _bridged(seconds, signal) for name, signal in signals.items()}
    heights = -signals["p_d"][np.isfinite(signals["p_d"])]
    if heights.size == 0:
        raise BadInput("response.p holds no height", str(path), "Is the file complete?")
    wind, dropped = wind_record(seconds, air, float(heights.mean()))
    if dropped:
        notes.append(f"{dropped} samples of the wind are no numbers and were left out.")
    notes += [
        "tension is measured at the winch, not at the kite.",
        "alpha, beta and V_a come from the air data boom.",
        f"The wind is the aircraft's own estimate; its height is taken to be the mean height of flight, {heights.mean():.0f} m.",
        "The log has no accelerations and no flaps.",
    ]
    late = dict(late or {})
    if "winch" not in late:
        position, velocity = (np.array([whole[f"{letter}_{axis}"] for axis in "ned"]) for letter in "pv")
        range_rate = (position * velocity).sum(0) / np.maximum(np.sqrt((position**2).sum(0)), 1.0)
        seen = clock_offset(range_rate, whole["reel_out_speed"], float(np.median(np.diff(seconds))))
        late["winch"] = round(seen.late, 2) if seen is not None and seen.clear else 0.0
        if seen is not None and late["winch"]:
            notes.append(
                f"Winch signals come {late['winch']:.2f} s late against the range rate (correlation {seen.correlation:.3f}, without "
                f"moving {seen.unshifted:.3f}); they were moved. `clocks: {{winch: 0}}` in flight.yaml leaves them."
            )
    signals["tether_length"] = _tether_length(seconds, whole, late["winch"])
    notes.append("tether_length is the integrated winch speed; its start makes it the range where the line is taut, on average.")
    groups = {name: "winch" if name in ("tension", "reel_out_speed", "tether_length") else "onboard" for name in signals} | {
        "wind": "weather"
    }
    name = path.resolve().parent.name
    raw = RawFlight(name, start, seconds - seconds[0], signals, str(path), groups, late, wind, tuple(notes), spikes)
    return uniform_log(raw, max_gap)


def euler_angles(rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(phi, theta, psi), each (N,) rad, ZYX, of body-to-NED matrices (3, 3, N)."""
    return (
        np.arctan2(rotation[2, 1], rotation[2, 2]),
        np.arcsin(np.clip(-rotation[2, 0], -1.0, 1.0)),
        np.arctan2(rotation[1, 0], rotation[0, 0]),
    )


def wind_record(seconds: np.ndarray, air: np.ndarray, height: float) -> tuple[WindRecord | None, int]:
    """(WindRecord, how many samples were left out) at one height [m] from wind vectors (3, N), NED [m/s].

    Only the samples at which they change are kept, and those that are finite; without any there is no record.
    """
    finite = np.isfinite(air).all(0)
    air, seconds = air[:, finite], seconds[finite]
    if not finite.any():
        return None, finite.size
    new = np.ones(seconds.size, bool)
    new[1:] = (np.diff(air, axis=1) != 0).any(0)
    air, seconds = air[:, new], seconds[new]
    speed = np.hypot(air[0], air[1])[:, None]
    direction = np.unwrap(np.arctan2(-air[1], -air[0]))[:, None]
    return WindRecord(seconds - 0.0, np.array([height]), speed, direction, air[2][:, None].copy()), int((~finite).sum())


def _bridged(seconds: np.ndarray, signal: np.ndarray) -> np.ndarray:
    """(N,) the signal with straight lines over what is missing: a sum over it must not end there."""
    known = np.isfinite(signal)
    return signal if known.all() or not known.any() else np.interp(seconds, seconds[known], signal[known])


def _tether_length(seconds: np.ndarray, signals: Mapping[str, np.ndarray], late: float) -> np.ndarray:
    """Integrated winch speed (N,), on the winch's own stamps, with the constant that makes it the range where tension is high."""
    speed = signals["reel_out_speed"]
    run = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(seconds))])
    distance = np.sqrt(signals["p_n"] ** 2 + signals["p_e"] ** 2 + signals["p_d"] ** 2)
    distance_then = np.interp(seconds - late, seconds, distance)
    taut = (signals["tension"] > TAUT * signals["tension"].max()) & (seconds - late >= seconds[0]) & (seconds - late <= seconds[-1])
    return run + float(np.median((distance_then - run)[taut])) if taut.any() else run + distance[0]


def _load(path: Path) -> dict:
    """The struct, or what is wrong with the file."""
    do = "Expected Ampyx's MATLAB 5 file with the struct validationData; download it again."
    kinds, value = read_mat(path, STRUCT, do)
    if STRUCT not in kinds:
        raise BadInput(f"there is no struct '{STRUCT}'", str(path), f"It holds: {', '.join(kinds) or 'nothing'}."[:200])
    if not isinstance(value, dict):
        raise BadInput(f"'{STRUCT}' is not one struct", str(path), do)
    return value


def _member(path: Path, data: dict, name: str) -> dict:
    """A struct inside the struct."""
    if name not in data:
        raise BadInput(f"{STRUCT} has no field '{name}'", str(path), did_you_mean(name, data))
    if not isinstance(data[name], dict):
        raise BadInput(f"{STRUCT}.{name} is not a struct", str(path), "Is this the published file?")
    return data[name]


def _field(path: Path, data: dict, parent: str, name: str, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """A numeric field of a struct, float64, of the given shape (None: any vector of at least 3)."""
    if name not in data:
        raise BadInput(f"{parent} has no field '{name}'", str(path), did_you_mean(name, data))
    value = data[name]
    if not isinstance(value, np.ndarray):
        raise BadInput(f"{parent}.{name} does not hold numbers", str(path), "Is this the published file?")
    if value.shape != shape if shape is not None else value.ndim != 1 or value.size < 3:
        raise BadInput(f"{parent}.{name} has the shape {value.shape}, expected {shape or '(N,)'}", str(path), "Is the file complete?")
    return np.where(np.abs(value) < ABSURD, value, np.nan)
