"""The units a log may be written in: unit -> (what it measures, factor to SI)."""

import math

from awescli.notation.errors import BadInput, did_you_mean

GRAVITY = 9.80665
"""m/s2, by definition: 1 kgf = 9.80665 N."""

VOCABULARY = {
    "m": ("length", 1.0), "cm": ("length", 0.01), "mm": ("length", 0.001), "km": ("length", 1000.0), "ft": ("length", 0.3048),
    "deg": ("angle", math.pi / 180), "rad": ("angle", 1.0),
    "deg/s": ("angular rate", math.pi / 180), "rad/s": ("angular rate", 1.0),
    "m/s": ("speed", 1.0), "km/h": ("speed", 1 / 3.6), "kn": ("speed", 1852 / 3600), "ft/s": ("speed", 0.3048),
    "m/s2": ("acceleration", 1.0), "g": ("acceleration", GRAVITY),
    "N": ("force", 1.0), "kN": ("force", 1000.0), "kgf": ("force", GRAVITY),
    "s": ("time", 1.0), "ms": ("time", 1e-3), "us": ("time", 1e-6), "ns": ("time", 1e-9),
    "kg/m3": ("density", 1.0),
    "1/s": ("revolutions", 1.0), "rpm": ("revolutions", 1 / 60),
    "-": ("number", 1.0), "%": ("number", 0.01),
}  # fmt: skip

DIMENSION_OF_SI = {si: VOCABULARY[si][0] for si in ("m", "rad", "rad/s", "m/s", "m/s2", "N", "s", "kg/m3", "1/s", "-")}
"""SI unit of a quantity (`quantities.UNITS`) -> what it measures."""


def factor_to_si(unit: str, si_unit: str) -> float:
    """What a value in `unit` is multiplied with to be in `si_unit`; raises BadInput for a unit of something else."""
    dimension = DIMENSION_OF_SI[si_unit]
    allowed = [name for name, (of, _) in VOCABULARY.items() if of == dimension]
    if unit not in allowed:
        raise BadInput(f"'{unit}' is not a unit of {dimension}", do=did_you_mean(unit, allowed))
    return VOCABULARY[unit][1]
