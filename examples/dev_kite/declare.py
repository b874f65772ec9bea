"""Turn a development flight's nominal.yaml into a kite file: python declare.py NOMINAL.yaml KITE.yaml

nominal.yaml holds what the user of that kite would declare: exact mass, geometry and tether diameter, a guess with bounds for
every other parameter, the aerodynamic polynomial term by term, the sensor noise.
"""

import math
import re
import sys
from pathlib import Path

import yaml

UNITS = {"m": "kg", "S": "m2", "b": "m", "c": "m", "g": "m/s2", "d_t": "m", "k_v": "N/m", "c_v": "N s/m", "rty": "m", "rtx": "m",
         "rtz": "m", "dl": "m", "Jx": "kg m2", "Jy": "kg m2", "Jz": "kg m2", "Jxz": "kg m2"}  # fmt: skip
VARIABLES = {"ph": "p_hat", "qh": "q_hat", "rh": "r_hat", "da": "aileron", "de": "elevator", "dr": "rudder", "df": "flaps"}


def monomial(text: str) -> str:
    """`alpha^2` -> `alpha^2`, `qh` -> `q_hat`, `` -> `1`: the names that kite files use."""
    return "*".join(VARIABLES.get(f, f) for f in text.split("*")) if text else "1"


def terms(polynomial: str) -> dict[str, str]:
    """`CL0 + CLa*alpha` -> {"1": "CL0", "alpha": "CLa"}."""
    parts = (term.strip().partition("*") for term in polynomial.split("+"))
    return {monomial(rest): name for name, _, rest in parts}


def held(control: str) -> dict[str, float]:
    """`zero-order, 50 Hz` -> how often the controller sets the surfaces; nothing where it is not said."""
    rate = re.search(r"([\d.]+) *Hz", control)
    return {"set_point_rate": float(rate[1])} if rate else {}


def kite_of(nominal: dict) -> dict:
    exact, guesses, wind = nominal["exact"], nominal["parameters"], nominal["wind"]
    noise, deg = nominal["sensor_noise_std"], math.pi / 180
    parameters = {n: {"value": float(v), "unit": UNITS.get(n, "-"), "source": "nominal, exact"} for n, v in exact.items()}
    for name, row in guesses.items():
        parameters[name] = {
            "value": float(row["guess"]), "lower": float(row["lower"]), "upper": float(row["upper"]), "free": True,
            "unit": UNITS.get(name, "-"), "source": "nominal, guess",
        }  # fmt: skip
    law = {"law": wind["height_model"], "reference_height": float(wind.get("reference_height", 10.0))}
    if "exponent" in wind:
        law["exponent"] = float(wind["exponent"])
    return {
        "name": "development kite",
        "description": nominal["description"],
        "parameters": parameters,
        "aerodynamics": {
            "frame": "wind",
            "angles": "rad",
            "terms": {c: terms(nominal["aerodynamics"][c]) for c in ("CL", "CD", "CY", "Cl", "Cm", "Cn")},
        },
        "tether": {"law": "thesis", "tension": "constraint"},
        "wind": law,
        "surfaces": {s: {"sign": 1} for s in ("aileron", "elevator", "rudder", "flaps")},
        **held(nominal.get("control_hold", "")),
        "effects": ["gravity", "aerodynamics", "tether"],
        "noise": {
            "position": noise["position_m"], "velocity": noise["velocity_ms"], "euler": noise["euler_deg"] * deg,
            "rates": noise["rates_dps"] * deg, "airspeed": noise["V_a_ms"], "load_relative": noise["load_relative"],
            "acceleration": noise["acceleration_ms2"],
        },
    }  # fmt: skip


def main(arguments: list[str]) -> int:
    if len(arguments) != 2:
        print("usage: python declare.py NOMINAL.yaml KITE.yaml", file=sys.stderr)
        return 2
    source, target = map(Path, arguments)
    try:
        nominal = yaml.safe_load(source.read_text())
        text = yaml.safe_dump(kite_of(nominal), sort_keys=False, width=140)
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as e:
        print(f"{source}: not a nominal.yaml of a development flight: {type(e).__name__}: {e}", file=sys.stderr)
        return 2
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
