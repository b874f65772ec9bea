"""What a kite file may declare: numbers of this world, a rigid body's inertia, constraints that can hold, no effect twice.

Everything here looks at plain data, whole or with mistakes that the schema names, and only at what is declared; so that all mistakes of a
file are reported at once.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from awescli.notation.constraints import LinearConstraint, contradiction, parse_constraint
from awescli.notation.errors import BadInput
from awescli.physics.disturbances import DISTURBANCES
from awescli.physics.effects import EFFECTS

Where = Callable[..., str]
"""Place of a key in the file: `kite.yaml:12: parameters.m`."""

POSITIVE = {
    "m": (1e-3, 1e6, "kg"), "S": (1e-4, 1e5, "m2"), "b": (1e-2, 1e3, "m"), "c": (1e-3, 1e3, "m"),
    "Jx": (1e-9, 1e10, "kg m2"), "Jy": (1e-9, 1e10, "kg m2"), "Jz": (1e-9, 1e10, "kg m2"),
}  # fmt: skip
"""Parameters that something is divided by: from the wing of a gram to far beyond the largest aircraft. Their bounds may reach 0."""
NOT_NEGATIVE = {
    "g": (0.0, 100.0, "m/s2"), "d_t": (0.0, 1.0, "m"), "CtD": (0.0, 100.0, "-"), "k_v": (0.0, 1e9, "N/m"), "c_v": (0.0, 1e9, "N s/m"),
}  # fmt: skip
LARGEST = 1e12
"""Of any parameter: no unit of this physics needs more."""
STD = (1e-12, 1e12)
"""Of a prior: beyond, its weight, the inverse square, is no number to compute with."""

NUMBERS = {
    ("noise", "position"): (1e-9, 1e4, "m"), ("noise", "velocity"): (1e-9, 1e3, "m/s"), ("noise", "euler"): (1e-9, 10.0, "rad"),
    ("noise", "rates"): (1e-9, 100.0, "rad/s"), ("noise", "airspeed"): (1e-9, 1e3, "m/s"), ("noise", "flow_angles"): (1e-9, 10.0, "rad"),
    ("noise", "load_relative"): (1e-9, 10.0, "share"), ("noise", "acceleration"): (1e-9, 1e4, "m/s2"),
    ("wind", "exponent"): (-2.0, 2.0, "power law"), ("wind", "reference_height"): (0.1, 1000.0, "m"),
    ("wind", "roughness"): (1e-9, 100.0, "m"), ("wind", "std"): (0.0, 50.0, "m/s"), ("wind", "direction_std"): (0.0, math.pi, "rad"),
}  # fmt: skip
"""Where a number stands in the file -> (smallest, largest, what it is). Several numbers at one place are each looked at."""

DEFLECTION = math.pi / 2
"""rad: a surface that is said to go further is said in degrees."""

MOST = {"parameters": 2000, "effects": 60, "constraints": 200, "propellers": 50}
"""Entries of a kite file; the largest has a tenth."""
LONGEST_NAME, LONGEST_UNIT = 120, 30
"""Characters; an empirical term of four factors has 40."""
MOST_FACTORS, HIGHEST_DEGREE = 8, 12
"""Of a monomial: each factor costs work in every step of every rollout."""
MEASURED = 0.05
"""Share by which an inertia may miss the triangle inequality: swings measure it to some per cent (that of UMN's Thor misses by 0.5 %)."""


def mistakes(data: Any, where: Where) -> list[BadInput]:
    """What is wrong with the plain data of a kite file, beyond what the schema sees."""
    if not isinstance(data, dict):
        return []
    rows = {str(n): row for n, row in _mapping(data.get("parameters")).items() if isinstance(row, dict)}
    return [
        *_too_much(data, where), *_names(rows, where), *_values(rows, where), *_inertia(rows, where), *_numbers(data, where),
        *_surfaces(_mapping(data.get("surfaces")), where), *_effects(data.get("effects"), where),
        *_monomials(data.get("aerodynamics"), where), *_constraints(data.get("constraints"), rows, where),
    ]  # fmt: skip


def _mapping(data: Any) -> Mapping[Any, Any]:
    return data if isinstance(data, dict) else {}


def _of(rows: Mapping[str, Mapping], name: str, key: str) -> Any:
    return rows.get(name, {}).get(key)


def _number(value: Any) -> float | None:
    """A finite number; None for all else, which the schema names."""
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value) else None


def _unit_of(name: str) -> str:
    """The unit in which a parameter with a meaning of its own is taken; empty where the file gives it one."""
    known = POSITIVE.get(name) or NOT_NEGATIVE.get(name)
    return known[2] if known else ""


def _written(unit: str) -> str:
    """A unit without what different hands write differently: kg m2, kg*m^2, kg·m²."""
    return unit.translate(str.maketrans({**dict.fromkeys(" ^*·.", ""), "²": "2"}))


def _too_much(data: Mapping, where: Where) -> Iterator[BadInput]:
    for key, most in MOST.items():
        if isinstance(data.get(key), (dict, list)) and len(data[key]) > most:
            yield BadInput(f"{len(data[key])} entries are too many (limit {most})", where(key), "Is this the file you meant?")


def _names(rows: Mapping[str, Mapping], where: Where) -> Iterator[BadInput]:
    """Names are printed, and looked up beside those of awes' own parameters."""
    own = (*(f"{name}." for name in DISTURBANCES), "record.", "network.")
    for name, row in rows.items():
        if len(name) > LONGEST_NAME or not name.isprintable():
            yield BadInput("a name of a parameter is too long or not printable", where("parameters", name), "Use letters and digits.")
        elif name.startswith(own):
            yield BadInput(f"names that begin with '{name.split('.')[0]}.' are awes' own", where("parameters", name), "Choose another.")
        unit = row.get("unit", "-")
        if isinstance(unit, str) and (len(unit) > LONGEST_UNIT or not unit.isprintable()):
            yield BadInput(f"a unit of {len(unit)} characters", where("parameters", name, "unit"), "Write for example kg m2.")
        elif isinstance(unit, str) and _written(unit) not in ("", "-", _written(expected := _unit_of(name) or unit)):
            do = f"Give it in {expected}: numbers are taken as they stand."
            yield BadInput(f"{name} is given in {unit}", where("parameters", name, "unit"), do)


def _values(rows: Mapping[str, Mapping], where: Where) -> Iterator[BadInput]:
    """Sizes of values, bounds and standard deviations."""
    for name, row in rows.items():
        low, high, unit = POSITIVE.get(name) or NOT_NEGATIVE.get(name) or (-LARGEST, LARGEST, str(row.get("unit", "-"))[:LONGEST_UNIT])
        value = _number(row.get("value"))
        ends = {key: end for key in ("lower", "upper") if (end := _number(row.get(key))) is not None}
        if value is not None and not low <= value <= high:
            what = f"{name} = {value:g} {unit}"
            yield BadInput(what, where("parameters", name, "value"), f"Expected {low:g} to {high:g} {unit}.")
        for key, end in ends.items():
            # a bound of a fixed parameter bounds nothing, and one of 0 is never quite reached
            if row.get("free") is True and not (min(low, 0.0) if name in POSITIVE else low) <= end <= high:
                do = f"Expected {low:g} to {high:g} {unit}: an estimator goes as far as it is allowed to."
                yield BadInput(f"{key} bound {end:g} of {name}", where("parameters", name, key), do)
        if row.get("free") is True and len(ends) == 2 and ends["lower"] == ends["upper"]:
            yield BadInput(f"{name} is free, and its bounds leave it no room", where("parameters", name), "Declare it with free: false.")
        std = _number(row.get("std"))
        if std is not None and std > 0 and not STD[0] <= std <= STD[1]:
            do = f"Expected {STD[0]:g} to {STD[1]:g}; for a value that is known for certain: free: false."
            yield BadInput(f"a standard deviation of {std:g}", where("parameters", name, "std"), do)


INERTIA = ("Jx", "Jy", "Jz", "Jxz")


def _inertia(rows: Mapping[str, Mapping], where: Where) -> Iterator[BadInput]:
    """Is there a rigid body with an inertia within what is declared: the values of fixed parameters, the bounds of free ones?"""
    ranges = {}
    for name in INERTIA:
        value = _number(_of(rows, name, "value"))
        if value is None or (name in POSITIVE and value <= 0):
            return  # missing, or named already
        free = _of(rows, name, "free") is True
        lower, upper = (_number(_of(rows, name, key)) for key in ("lower", "upper"))
        ranges[name] = ((-math.inf if lower is None else lower), (math.inf if upper is None else upper)) if free else (value, value)
    for why in not_rigid(ranges):
        do = "Correct Jx, Jy, Jz, or the product of inertia Jxz."
        yield BadInput(
            f"{why}, whatever the bounds allow" if any(a < b for a, b in ranges.values()) else why, where("parameters", "Jx"), do
        )


def not_rigid(ranges: Mapping[str, tuple[float, float]]) -> Iterator[str]:
    """Which condition of a rigid body, symmetric about its x-z plane, no inertia within the ranges meets.

    Positive definite: Jx Jz > Jxz^2. Triangle inequality of the principal moments (Jx + Jz)/2 +- sqrt(((Jz - Jx)/2)^2 + Jxz^2) and Jy:
    Jx + Jz >= Jy >= sqrt((Jz - Jx)^2 + 4 Jxz^2), without Jxz the known Jx + Jy >= Jz and Jy + Jz >= Jx.
    """
    if len(ranges) < len(INERTIA):
        return
    (Jx_low, Jx), (Jy_low, Jy), (Jz_low, Jz), (product_low, product_high) = (ranges[name] for name in INERTIA)
    product = 0.0 if product_low <= 0 <= product_high else min(abs(product_low), abs(product_high))
    apart = max(Jx_low - Jz, Jz_low - Jx, 0.0)
    least = math.hypot(apart, 2 * product)
    if Jx * Jz <= product * product:
        yield f"the inertia is not positive definite: Jx Jz = {Jx * Jz:g} is not above Jxz^2 = {product * product:g}"
    elif (Jx + Jz) * (1 + MEASURED) < Jy_low:
        yield f"no rigid body has this inertia: Jx + Jz = {Jx + Jz:g} is below Jy = {Jy_low:g}"
    elif Jy * (1 + MEASURED) < least:
        yield f"no rigid body has this inertia: Jy = {Jy:g} is below sqrt((Jz - Jx)^2 + 4 Jxz^2) = {least:g} (triangle inequality)"


def _numbers(data: Mapping, where: Where) -> Iterator[BadInput]:
    for (block, key), (low, high, unit) in NUMBERS.items():
        found = _mapping(data.get(block)).get(key)
        for i, one in enumerate(found if isinstance(found, list) else [found]):
            value = _number(one)
            if value is not None and not low <= value <= high:
                place = (block, key, i) if isinstance(found, list) else (block, key)
                yield BadInput(f"{block}.{key} is {value:g}", where(*place), f"Expected {low:g} to {high:g} ({unit}).")
    wind = _mapping(data.get("wind"))
    height, roughness = _number(wind.get("reference_height", 10.0)), _number(wind.get("roughness", 0.0002))
    if wind.get("law") == "log" and height is not None and roughness is not None and roughness >= height > 0:
        do = "The log law needs a roughness length below the height of the station."
        yield BadInput(f"roughness {roughness:g} m at a reference height of {height:g} m", where("wind", "roughness"), do)


def _surfaces(surfaces: Mapping, where: Where) -> Iterator[BadInput]:
    """Ranges of the control surfaces [rad]."""
    for name, row in surfaces.items():
        ends = {key: _number(_mapping(row).get(key, default)) for key, default in (("lower", -0.6), ("upper", 0.6))}
        for key, end in ends.items():
            if end is not None and abs(end) > DEFLECTION:
                do = f"Deflections are in rad; {end:g} deg would be {math.radians(end):.4g}."
                yield BadInput(f"{name} goes to {end:g} rad", where("surfaces", name, key), do)
        lower, upper = ends["lower"], ends["upper"]
        if lower is not None and upper is not None and lower >= upper:
            what = f"{name} goes from {lower:g} to {upper:g} rad"
            yield BadInput(what, where("surfaces", name), "Its lower end must be below its upper one.")


def _effects(effects: Any, where: Where) -> Iterator[BadInput]:
    """Each effect once, those that make a flight at all, and loads in an order in which each sees what it answers."""
    if not isinstance(effects, list):
        return
    keys = [key for key in effects if isinstance(key, str)]
    if "aerodynamics" not in keys:
        do = "A flying kite has at least `aerodynamics`; usual is [gravity, aerodynamics, tether], without the tether where it flies free."
        yield BadInput("the effects lack 'aerodynamics', so that the table of terms acts on nothing", where("effects"), do)
    behind = ""
    for i, key in enumerate(effects):
        if not isinstance(key, str):
            continue
        if key in effects[:i]:
            yield BadInput(f"effect '{key[:LONGEST_NAME]}' is there twice", where("effects", i), "Remove one; it would act twice.")
        if len(key) > LONGEST_NAME or key.count("*") > MOST_FACTORS:
            yield BadInput(f"'{key[:30]}...' is too long for an effect", where("effects", i), "Is this the name you meant?")
        effect = EFFECTS.get(key.partition(":")[0])
        if effect is not None and behind and _is_load(effect):
            yield BadInput(f"'{key[:LONGEST_NAME]}' stands behind '{behind}', whose load answers the sum of all others",
                           where("effects", i), f"Put it before '{behind}'.")  # fmt: skip
        behind = key if effect is not None and effect.last else behind


def _is_load(effect: type) -> bool:
    return "load" in vars(effect)


def _monomials(aerodynamics: Any, where: Where) -> Iterator[BadInput]:
    """Sizes of the table's monomials, before anybody multiplies them out."""
    for coefficient, terms in _mapping(_mapping(aerodynamics).get("terms")).items():
        for text in _mapping(terms):
            factors = str(text).split("*")
            degree = sum(int(power) if (power := f.partition("^")[2].strip(") ")).isdecimal() and len(power) < 4 else 1 for f in factors)
            if len(factors) > MOST_FACTORS or len(str(text)) > LONGEST_NAME or degree > HIGHEST_DEGREE:
                what = f"a monomial of {len(factors)} factors and degree {degree}"
                do = f"At most {MOST_FACTORS} factors and degree {HIGHEST_DEGREE}."
                yield BadInput(what, where("aerodynamics", "terms", coefficient, text), do)


def _constraints(constraints: Any, rows: Mapping[str, Mapping], where: Where) -> Iterator[BadInput]:
    """Constraints that cannot hold together within the bounds, or that fix what is called free. What cannot be read is named elsewhere."""
    if not isinstance(constraints, list) or len(constraints) > MOST["constraints"]:
        return
    ranges = _ranges(rows)
    held: dict[int, LinearConstraint] = {}
    for i, text in enumerate(constraints):
        try:
            constraint = parse_constraint(text) if isinstance(text, str) else None
        except BadInput:
            continue
        if constraint is None or not set(constraint.factors) <= set(ranges):
            continue
        held[i] = constraint
        moving = [name for name in constraint.factors if ranges[name][0] < ranges[name][1]]
        if constraint.lower == constraint.upper and len(moving) == 1:
            what = f"'{text}' leaves the free parameter '{moving[0]}' one value"
            yield BadInput(what, where("constraints", i), "Declare that value for it, with free: false.")
    clash = contradiction(list(held.values()), ranges)
    for i, constraint in held.items():
        if any(constraint is other for other in clash):
            others = [repr(c.text) for c in clash if c is not constraint]
            together = f" together with {' and '.join(others)}" if others else ""
            what = f"no parameter values inside their bounds satisfy {constraint.text!r}{together}"
            yield BadInput(what, where("constraints", i), "Widen the bounds, free a parameter, or drop a constraint.")
            return


def _ranges(rows: Mapping[str, Mapping]) -> dict[str, tuple[float, float]]:
    """Parameter -> the values that it may take."""
    ranges = {}
    for name, row in rows.items():
        value = _number(row.get("value"))
        if value is None:
            continue
        lower, upper = _number(row.get("lower")), _number(row.get("upper"))
        free = row.get("free") is True
        ends = (-math.inf if lower is None else lower, math.inf if upper is None else upper) if free else (value, value)
        if ends[0] <= value <= ends[1]:
            ranges[name] = ends
    return ranges


def without_repeats(errors: Sequence[BadInput]) -> list[BadInput]:
    """The same errors, each place and sentence once, in the order of the file."""
    once = {(e.where, e.what): e for e in errors}
    return sorted(once.values(), key=_line)


def _line(error: BadInput) -> int:
    """Line in `kite.yaml:12: parameters.m`; 0 where there is none."""
    parts = error.where.split(": ")[0].rsplit(":", 1)
    return int(parts[1]) if len(parts) == 2 and parts[1].isdecimal() else 0
