"""A reconstruction in words and display units: the table of channels beside what was declared, and of the errors of sensors."""

from collections.abc import Mapping

import numpy as np

from awescli.flightlog.quality import DISPLAY
from awescli.flightlog.reconstruction.result import ChannelNoise, FlightPath, Level, SensorError

ALIKE = 1.25
"""Factor up to which noise is as declared."""
VAGUE = 20.0
"""Ratio of the ends of an interval from which it is not worth printing."""

AGAINST = {
    **dict.fromkeys(("p", "q", "r"), "the attitude"), **dict.fromkeys(("phi", "theta"), "the rates"),
    **dict.fromkeys(("v_n", "v_e"), "the acceleration"), **dict.fromkeys(("a_x", "a_y", "a_z", "p_n", "p_e"), "the velocity"),
}  # fmt: skip
"""Signal -> what its scale is measured against."""


def noise_table(path: FlightPath, declared: Mapping[str, float]) -> dict[str, dict[str, object]]:
    """Channel -> unit, declared and measured white noise with its 95 % interval, drift with its memory [s], and what that means. declared:
    standard deviations [SI] of a kite file, by channel; what it lacks is left empty."""
    rows: dict[str, dict[str, object]] = {}
    for n in path.noise:
        unit, factor = DISPLAY.get(n.unit, (n.unit, 1.0))
        said = declared.get(n.channel)
        rows[n.channel] = {
            "unit": unit, "declared": "" if said is None else said * factor, "measured": "" if n.white is None else n.white.value * factor,
            "95 %": _between(n.white, factor), "drift": _drift(n, factor), "": _verdict(n.white, n.drift is not None, said),
        }  # fmt: skip
    return rows


def error_table(path: FlightPath) -> dict[str, dict[str, object]]:
    """Error -> size with its 95 % interval, in display units, the size that matters, and a verdict."""
    rows: dict[str, dict[str, object]] = {}
    for e in path.errors:
        unit, factor = DISPLAY.get(e.unit, (e.unit, 1.0))
        low, high = sorted((factor * (e.size + sign * 1.96 * e.std)) for sign in (-1, 1))
        verdict = "FOUND" if e.found else "none" if e.determined else "cannot tell"
        rows[_row(e)] = {
            "unit": unit, "size": e.size * factor, "95 %": f"{low:.3g} to {high:.3g}", "matters": e.matters * factor, "": verdict,
        }  # fmt: skip
    return rows


def _row(error: SensorError) -> str:
    """Its name, and the one channel that it acts on."""
    if error.name == "imu_misalignment":
        return f"{error.name} {' '.join(error.acts_on)} about {error.target}"
    return f"{error.name} {error.acts_on[0] if len(error.acts_on) == 1 else ''}".strip()


def said(error: SensorError) -> str:
    """`position late by 0.26 s +- 0.01`, with one standard deviation."""
    unit, factor = ("%", 100.0) if error.unit == "-" else DISPLAY.get(error.unit, (error.unit, 1.0))
    std = error.std * factor
    places = int(np.clip(-np.floor(np.log10(std)), 0, 6)) if std > 0 else 3
    amount, size = f"{abs(error.size) * factor:.{places}f}", error.size
    signed = f"{'-' if size < 0 else ''}{amount}"
    where = " and ".join(error.acts_on) if len(error.acts_on) <= 2 else ", ".join(error.acts_on)
    # gyros that are turned about the body's x do the same
    also = " (or the IMU turned about x)" if where == "phi" else ""
    words = {
        "position_latency": f"position {'late' if size > 0 else 'early'} by {amount} s",
        "attitude_latency": f"attitude late by {amount} s against the rates",
        "rate latency": f"rates late by {amount} s against the attitude",
        "velocity latency": f"velocity late by {amount} s against the acceleration",
        "acceleration latency": f"acceleration late by {amount} s against the velocity",
        "airspeed_lag": f"airspeed lags by {amount} s",
        "airspeed_scale": f"airspeed reads {amount} % {'high' if size > 0 else 'low'}",
        "scale": f"{where} reads {amount} % {'high' if size > 0 else 'low'} against {AGAINST.get(where, 'others')}",
        "attitude_bias": f"{where} off by {signed} {unit} against {AGAINST.get(where, 'others')}{also}",
        "imu_misalignment": f"{where} turned about {error.target} by {signed} {unit} against the attitude",
        "compass_deviation": f"heading off by up to {amount} {unit} to either side in a turn (compass deviation)",
        "heading_bias": f"heading off by {signed} {unit}",
    }
    return f"{words.get(error.name, f'{where} off by {signed} {unit}')} +- {std:.{places}f}"


def _between(level: Level | None, factor: float) -> str:
    if level is None or level.high > VAGUE * level.low:
        return ""
    return f"{level.low * factor:.3g} to {level.high * factor:.3g}"


def _drift(noise: ChannelNoise, factor: float) -> str:
    """Its level and its memory."""
    return "" if noise.drift is None or noise.memory is None else f"{noise.drift.value * factor:.2g} in {noise.memory.value:.2g} s"


def _verdict(white: Level | None, drifts: bool, declared: float | None) -> str:
    """`as declared`, `2.1 x declared`; `, drifts`."""
    if white is None:
        words = "cannot tell"
    elif not declared:
        words = "not declared"
    else:
        ratio = white.value / declared
        inside = white.low / ALIKE <= declared <= white.high * ALIKE
        words = "as declared" if inside else f"{ratio:.2g} x declared"
    return f"{words}, drifts" if drifts else words
