"""How quantities, models and numbers are said on the page: degrees, percent, few digits."""

import math

import numpy as np

from awescli.notation.quantities import UNITS

CHANNELS = {
    "p_n": "position north", "p_e": "position east", "p_d": "position down",
    "u": "speed forward", "v": "speed right", "w": "speed down (body)",
    "v_n": "velocity north", "v_e": "velocity east", "v_d": "velocity down",
    "phi": "roll φ", "theta": "pitch θ", "psi": "yaw ψ", "p": "roll rate p", "q": "pitch rate q", "r": "yaw rate r",
    "a_x": "acceleration forward", "a_y": "acceleration right", "a_z": "acceleration down (body)",
    "V_a": "airspeed", "alpha": "angle of attack α", "beta": "sideslip β", "tension": "tether tension",
    "aileron": "aileron", "elevator": "elevator", "rudder": "rudder", "flaps": "flaps",
    "throttle": "throttle",
    "tether_length": "tether length", "reel_out_speed": "reel-out speed", "motor_speed": "motor revolutions",
    "mean": "mean of the 12 states",
}  # fmt: skip

SHORT = {"phi": "φ", "theta": "θ", "psi": "ψ", "alpha": "α", "beta": "β", "V_a": "airspeed"}

GROUPS = {
    "Position": ("p_n", "p_e", "p_d"),
    "Velocity over ground, body axes": ("u", "v", "w"),
    "Attitude": ("phi", "theta", "psi"),
    "Rates": ("p", "q", "r"),
    "Air and tether": ("V_a", "alpha", "beta", "tension"),
}
"""Channels that are shown together."""

MODELS = {"initial": "as declared", "identified": "identified", "with_effects": "with the traced effect", "hybrid": "hybrid"}
BASELINE = {"linear": "linear (ARX)"}
"""What stands beside the nested models, and is none of them."""

COLOURS = {
    "measured": "@ink", "initial": "@orange", "identified": "@blue", "with_effects": "@green", "hybrid": "@purple", "linear": "@brown",
    "floor": "@grey",
    "train": "@steel", "validation": "@ochre", "test": "@red",
}  # fmt: skip
"""One colour per thing, all over the page; @names are looked up in page.css, which has a light and a dark set."""

SHOWN = {"rad": ("°", 180 / math.pi), "rad/s": ("°/s", 180 / math.pi), "m/s2": ("m/s²", 1.0), "-": ("", 1.0), "kg m2": ("kg m²", 1.0)}
KILO = 2000.0
"""N: forces that grow larger are shown in kN."""


def channel(name: str) -> str:
    """A channel in words."""
    return CHANNELS.get(name, name)


def short(name: str) -> str:
    """A channel's symbol, for axes."""
    return SHORT.get(name, name)


def unit_of(unit: str) -> tuple[str, float]:
    """(unit shown, factor) of an SI unit."""
    return SHOWN.get(unit, (unit, 1.0))


def scale_of(name: str, values: np.ndarray) -> tuple[str, float]:
    """(unit shown, factor) of a channel with such values."""
    if UNITS.get(name) == "N":
        return ("kN", 1e-3) if np.nanmax(np.abs(values), initial=0.0) > KILO else ("N", 1.0)
    return unit_of(UNITS.get(name, ""))


def number(value: float | None, digits: int = 3) -> str:
    """A number with so many significant digits: 0.0000123 as 1.23e-5, no trailing noise."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if size < -4 or size > 6:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}·10{superscript(int(exponent))}".replace("-", "−")
    return f"{value:.{max(digits - 1 - size, 0)}f}".replace("-", "−")


def superscript(n: int) -> str:
    """A whole number in superior figures."""
    return str(n).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def percent(share: float | None) -> str:
    """A share in percent, three significant digits at most."""
    if share is None or not math.isfinite(share):
        return "–"
    value = 100 * share
    return f"{number(value, 2 if abs(value) < 1 else 3)} %"


def with_std(value: float, std: float | None, unit: str = "") -> str:
    """value ± 2 std, both to the digit that the std still shows."""
    shown, factor = unit_of(unit)
    value, width = value * factor, 2 * (std or 0.0) * factor
    tail = f" {shown}" if shown else ""
    if not width or not math.isfinite(width):
        return f"{number(value, 4)}{tail}"
    places = 1 - math.floor(math.log10(width))
    if not -3 <= places <= 7:
        return f"{number(value, 4)} ± {number(width, 2)}{tail}"
    return f"{value:.{max(places, 0)}f} ± {width:.{max(places, 0)}f}{tail}".replace("-", "−")


def effect_words(name: str, acts_on: str = "") -> str:
    """An effect in words: `actuator_lag` on `rudder` -> "actuator lag (rudder)"."""
    words = name.replace("_", " ") if acts_on != "parameter" else f"parameter {name}"
    return f"{words} ({acts_on.replace('_', ' ')})" if acts_on and acts_on != "parameter" else words


def times(before: float, after: float) -> str:
    """How many times smaller, in words."""
    if after <= 0 or before <= 0:
        return ""
    ratio = before / after
    if ratio >= 1.05:
        return f"{ratio:.0f} times smaller" if ratio >= 9.5 else f"{ratio:.1f} times smaller"
    return "unchanged" if ratio > 0.95 else f"{1 / ratio:.1f} times larger"


def listed(names: list[str]) -> str:
    """a, b and c."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}" if names else ""
