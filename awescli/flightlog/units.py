"""The units a log may be written in: unit -> (what it measures, factor to SI)."""

import math

from awescli.notation.errors import BadInput, did_you_mean

GRAVITY = 9.80665
"""m/s2, by definition: 1 kgf = 9.80665 N."""

FOOT, MILE, NAUTICAL_MILE, POUND = 0.3048, 1609.344, 1852.0, 0.45359237
"""m, m, m, kg: international foot, mile and nautical mile, avoirdupois pound, all by definition (NIST SP 811)."""

POUND_FORCE = POUND * GRAVITY
SLUG = POUND_FORCE / FOOT
"""kg: what one pound-force accelerates by one foot per second squared."""

VOCABULARY = {
    "m": ("length", 1.0), "cm": ("length", 0.01), "mm": ("length", 0.001), "km": ("length", 1000.0), "ft": ("length", FOOT),
    "yd": ("length", 3 * FOOT), "mi": ("length", MILE), "nmi": ("length", NAUTICAL_MILE),
    "deg": ("angle", math.pi / 180), "rad": ("angle", 1.0), "grad": ("angle", math.pi / 200), "rev": ("angle", 2 * math.pi),
    "deg/s": ("angular rate", math.pi / 180), "rad/s": ("angular rate", 1.0), "deg/min": ("angular rate", math.pi / 10800),
    "1/s": ("revolutions", 1.0), "rev/s": ("revolutions", 1.0), "rpm": ("revolutions", 1 / 60),
    "m/s": ("speed", 1.0), "km/h": ("speed", 1 / 3.6), "kn": ("speed", NAUTICAL_MILE / 3600), "kt": ("speed", NAUTICAL_MILE / 3600),
    "mph": ("speed", MILE / 3600), "mi/h": ("speed", MILE / 3600), "ft/s": ("speed", FOOT), "ft/min": ("speed", FOOT / 60),
    "cm/s": ("speed", 0.01), "mm/s": ("speed", 0.001), "m/min": ("speed", 1 / 60),
    "m/s2": ("acceleration", 1.0), "g": ("acceleration", GRAVITY), "ft/s2": ("acceleration", FOOT), "mg": ("acceleration", GRAVITY / 1000),
    "N": ("force", 1.0), "kN": ("force", 1000.0), "daN": ("force", 10.0), "kgf": ("force", GRAVITY), "lbf": ("force", POUND_FORCE),
    "kip": ("force", 1000 * POUND_FORCE),
    "s": ("time", 1.0), "ms": ("time", 1e-3), "us": ("time", 1e-6), "ns": ("time", 1e-9), "min": ("time", 60.0), "h": ("time", 3600.0),
    "kg/m3": ("density", 1.0), "g/m3": ("density", 1e-3), "slug/ft3": ("density", SLUG / FOOT**3), "lb/ft3": ("density", POUND / FOOT**3),
    "K": ("temperature", 1.0), "degC": ("temperature", 1.0), "degF": ("temperature", 5 / 9),
    "Pa": ("pressure", 1.0), "hPa": ("pressure", 100.0), "mbar": ("pressure", 100.0), "kPa": ("pressure", 1000.0),
    "inHg": ("pressure", 3386.389), "mmHg": ("pressure", 133.322387415), "psi": ("pressure", POUND_FORCE / (FOOT / 12) ** 2),
    "-": ("number", 1.0), "%": ("number", 0.01),
}  # fmt: skip

ZERO = {"degC": 273.15, "degF": 459.67}
"""Unit -> what is added to a value in it before the factor, where its zero is not the SI unit's (ITS-90; 0 degF = 459.67 degR)."""

DIMENSION_OF_SI = {si: VOCABULARY[si][0] for si in ("m", "rad", "rad/s", "m/s", "m/s2", "N", "s", "kg/m3", "K", "Pa", "1/s", "-")}
"""SI unit of a quantity (`quantities.UNITS`) -> what it measures."""


def units_of(si_unit: str) -> list[str]:
    """All units of what `si_unit` measures."""
    return [name for name, (of, _) in VOCABULARY.items() if of == DIMENSION_OF_SI[si_unit]]


def factor_to_si(unit: str, si_unit: str) -> float:
    """What a value in `unit` is multiplied with to be in `si_unit`; raises BadInput for a unit of something else."""
    allowed = units_of(si_unit)
    if unit not in allowed:
        raise BadInput(f"'{unit}' is not a unit of {DIMENSION_OF_SI[si_unit]}", do=did_you_mean(unit, allowed))
    return VOCABULARY[unit][1]


def zero_of(unit: str) -> float:
    """What is added to a value in `unit` before the factor to SI."""
    return ZERO.get(unit, 0.0)
