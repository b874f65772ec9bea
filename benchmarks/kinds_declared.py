"""Mistakes in a declared kite: what one types, what one forgets, what one takes from a paper in other units."""

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from fuzz_kinds import Judged

from awescli.notation.errors import AwesError
from awescli.physics.declaration import read_kite
from awescli.physics.doubts import doubts
from awescli.physics.kite import Kite

ROOT = Path(__file__).parent.parent
LENGTHS, MASSES = ("S", "b", "c"), ("m", "Jx", "Jy", "Jz")
SIGNED = ("Clp", "Cmq", "Cnr", "CLa", "CD0", "CYb", "Cma", "Cnb", "Clb", "Clr", "CLq", "CYr", "CDa2")
SURFACES = ("CLde", "Cmde", "CYdr", "Cndr", "CLdf", "CDdf")
"""Of pairs that say where the force of a surface acts, or what it costs."""
Data = dict[str, Any]


def _row(data: Data, name: str, **more) -> str:
    data["parameters"][name] |= more
    return f"{name}: {more}"


def _fixed(data: Data, name: str, value: float) -> str:
    data["parameters"][name] = {"value": float(value)}
    return f"{name} = {value:.4g}"


def _free(data: Data) -> list[str]:
    return [n for n, row in data["parameters"].items() if row.get("free")]


def _aerodynamic(data: Data) -> list[str]:
    return [name for terms in data["aerodynamics"]["terms"].values() for name in terms.values()]


def _times(names: tuple[str, ...], low: float, high: float) -> Callable[[Data, np.random.Generator], str]:
    """One of the parameters times a power of ten, as a slip of a unit makes it."""

    def change(data: Data, rng: np.random.Generator) -> str:
        name, power = rng.choice(names), rng.choice([p for p in range(int(low), int(high) + 1) if p])
        row = data["parameters"][name]
        for key in ("value", "lower", "upper", "std"):
            if row.get(key) is not None:
                row[key] = float(row[key]) * 10.0 ** float(power)
        return f"{name} times 1e{power}"

    return change


def _negative(names: tuple[str, ...]) -> Callable[[Data, np.random.Generator], str]:
    def change(data: Data, rng: np.random.Generator) -> str:
        name = str(rng.choice(names))
        return _fixed(data, name, -abs(data["parameters"][name]["value"]) * rng.choice([0.0, 1.0]))

    return change


def _inertia(data: Data, rng: np.random.Generator) -> str:
    """Fixed moments that no mass has: one much larger than the other two together."""
    J = rng.uniform(10, 40, 3)
    J[rng.integers(3)] = J.sum() * rng.uniform(1.2, 4)
    return ", ".join(_fixed(data, n, v) for n, v in zip(("Jx", "Jy", "Jz", "Jxz"), (*J, rng.uniform(-2, 2)), strict=True))


def _product(data: Data, rng: np.random.Generator) -> str:
    J = rng.uniform(20, 60, 3)
    product = np.sqrt(J[0] * J[2]) * rng.uniform(1.05, 3)
    return ", ".join(_fixed(data, n, v) for n, v in zip(("Jx", "Jy", "Jz", "Jxz"), (*J, product), strict=True))


def _noise(factor: Callable[[np.random.Generator], float]) -> Callable[[Data, np.random.Generator], str]:
    def change(data: Data, rng: np.random.Generator) -> str:
        key = str(rng.choice([k for k in data["noise"] if k != "position"]))
        data["noise"][key] = float(data["noise"][key] * factor(rng))
        return f"noise.{key} = {data['noise'][key]:.3g}"

    return change


def _sign(name: str, data: Data) -> str:
    row = data["parameters"][name]
    ends = sorted(-row[key] for key in ("lower", "upper"))
    return _row(data, name, value=-row["value"], lower=ends[0], upper=ends[1])


def _signs(data: Data, rng: np.random.Generator) -> str:
    """The sign of a damping, of drag, of a slope that makes it stable: what has one sign on nearly every aircraft."""
    return _sign(str(rng.choice(SIGNED)), data)


def _surface_sign(data: Data, rng: np.random.Generator) -> str:
    """The sign of one of two things that a surface does."""
    return _sign(str(rng.choice(SURFACES)), data)


def _any_sign(data: Data, rng: np.random.Generator) -> str:
    """The sign of any other coefficient, which differs from table to table and from kite to kite: no declaration shows it."""
    return _sign(str(rng.choice([n for n in _aerodynamic(data) if n not in (*SIGNED, *SURFACES)])), data)


def _bounds(data: Data, rng: np.random.Generator) -> str:
    name = str(rng.choice(_free(data)))
    row = data["parameters"][name]
    if rng.random() < 0.5:
        return _row(data, name, lower=row["upper"], upper=row["lower"])
    return _row(data, name, value=row["upper"] + rng.uniform(0.1, 10) * (row["upper"] - row["lower"]))


def _std(data: Data, rng: np.random.Generator) -> str:
    return _row(data, str(rng.choice(_free(data))), std=float(rng.choice([1e-300, 1e-30, 1e30, 1e300, 0.0, -1.0])))


def _wild(data: Data, rng: np.random.Generator) -> str:
    """A number of the other end of the double range."""
    name = str(rng.choice(list(data["parameters"])))
    return _fixed(data, name, float(rng.choice([1, -1])) * 10.0 ** float(rng.choice([20, 100, 300])))


def _effects(data: Data, rng: np.random.Generator) -> str:
    """One twice, a load behind the line, none, one that is misspelt."""
    how = rng.integers(4)
    data["effects"] = [["gravity", "gravity", "aerodynamics", "tether"], ["aerodynamics", "tether", "gravity"], [],
                       ["gravty", "aerodynamics", "tether"]][how]  # fmt: skip
    return str(data["effects"])


def _constraints(data: Data, rng: np.random.Generator) -> str:
    name = str(rng.choice(_free(data)))
    row = data["parameters"][name]
    data["constraints"] = [
        [f"{name} >= {row['upper'] + 1:.6g}"],
        [f"{name} >= {0.9 * row['value'] + 0.1 * row['upper']:.6g}", f"{name} <= {0.9 * row['value'] + 0.1 * row['lower']:.6g}"],
        [f"{name} = {row['value']:.6g}"],
        [f"1e{rng.integers(13, 400)}*{name} >= 0"],
        [f"{name} >= {'9' * int(rng.integers(50, 50_000))}"],
        [f"{name}x + {name} >= 0"],
        [f"{name} > 0"],
    ][rng.integers(7)]
    return data["constraints"][0][:60]


def _terms(data: Data, rng: np.random.Generator) -> str:
    """A monomial that is misspelt, far too long, or of another frame; a term without its parameter."""
    terms = data["aerodynamics"]["terms"]
    coefficient = str(rng.choice(list(terms)))
    how = rng.integers(4)
    if how == 0:
        terms[coefficient]["alfa"] = "CL0"
    elif how == 1:
        terms[coefficient]["*".join(["alpha^9"] * int(rng.integers(2, 3000)))] = "CL0"
    elif how == 2:
        terms["CZ"] = terms.pop(coefficient)
    else:
        terms[coefficient]["beta^2"] = "CLnew"
    return f"{coefficient}: {['alfa', 'long', 'CZ', 'no parameter'][how]}"


def _missing(data: Data, rng: np.random.Generator) -> str:
    name = str(rng.choice(["m", "g", "S", "b", "c", "Jx", "Jy", "Jz", "Jxz", *_aerodynamic(data)]))
    del data["parameters"][name]
    return name


def _key(data: Data, rng: np.random.Generator) -> str:
    """A misspelt key, or text where a number belongs."""
    name = str(rng.choice(list(data["parameters"])))
    row = data["parameters"][name]
    if rng.random() < 0.5:
        row["valeu"] = row.pop("value")
    else:
        row["value"] = str(rng.choice(["much", "1,5", "12 kg", "", "1e"]))
    return f"{name}: {row}"


def _degrees(data: Data, rng: np.random.Generator) -> str:
    surface = str(rng.choice(list(data["surfaces"])))
    for end in ("lower", "upper"):
        data["surfaces"][surface][end] = float(np.rad2deg(data["surfaces"][surface][end]))
    return surface


def _wind(data: Data, rng: np.random.Generator) -> str:
    key, value = [("exponent", 1e9), ("exponent", 14.0), ("roughness", 20.0), ("reference_height", -10.0), ("std", -0.1), ("std", 1e9),
                  ("direction_std", 57.0)][rng.integers(7)]  # fmt: skip
    data["wind"] |= {"law": "log" if key == "roughness" else "power", key: value}
    return f"wind.{key} = {value:g}"


CHANGES: dict[str, Callable[[Data, np.random.Generator], str]] = {
    "mass or inertia zero or below": _negative(MASSES),
    "area, span or chord zero or below": _negative(LENGTHS),
    "a length in other units (x 1e-9 to 1e9)": _times(LENGTHS, -9, 9),
    "a mass or inertia in other units (x 1e-9 to 1e9)": _times(MASSES, -9, 9),
    "a fixed inertia that no body has": _inertia,
    "a product of inertia that is too large": _product,
    "noise zero or below": _noise(lambda rng: -float(rng.integers(2))),
    "noise beyond all sense": _noise(lambda rng: 10.0 ** float(rng.choice([-20, -12, 8, 20, 300]))),
    "sign of a damping, of drag, of a stability": _signs,
    "sign of what a surface does": _surface_sign,
    "sign of a coefficient that may have either": _any_sign,
    "bounds swapped, or a value outside them": _bounds,
    "a standard deviation beyond all sense": _std,
    "a number beyond all sense": _wild,
    "effects twice, missing, misordered": _effects,
    "constraints that cannot hold, or cannot be meant": _constraints,
    "terms that cannot be meant": _terms,
    "a parameter that is missing": _missing,
    "a key or number that is misspelt": _key,
    "surfaces in degrees": _degrees,
    "a wind law of other units": _wind,
}

KINDS = dict.fromkeys(CHANGES, 60)


def prepare(folder: Path):
    """A judge of the development kite with a mistake."""
    plain = yaml.safe_load((ROOT / "data" / "kites" / "development.yaml").read_text())
    file = folder / "kite.yaml"
    file.write_text(yaml.safe_dump(plain, sort_keys=False))
    usual = set(doubts(read_kite(file)))

    def judge(kind: str, rng: np.random.Generator) -> Judged:
        data = copy.deepcopy(plain)
        what = CHANGES[kind](data, rng)
        file.write_text(yaml.safe_dump(data, sort_keys=False))
        try:
            declaration = read_kite(file)
            Kite(declaration)
        except AwesError as e:
            placed = all(str(file) in line for line in str(e).splitlines() if not line.startswith(" "))
            return Judged("refused", what) if placed else Judged("fault", f"{what}: no place in '{str(e)[:100]}'")
        said = set(doubts(declaration)) - usual
        return Judged("noticed" if said else "unnoticed", what)

    return judge
