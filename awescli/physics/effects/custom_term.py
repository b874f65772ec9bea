"""An empirical term: what repeats in the residual and no effect of the library explains. Never a claim about physics."""

import re
from types import SimpleNamespace

from awescli.notation.errors import BadInput
from awescli.notation.parameters import Parameter
from awescli.notation.scalars import cos, sin
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.effects.base import Effect
from awescli.physics.effects.sizes import crosswind_speed, weight
from awescli.physics.instant import Instant, Load

CHANNELS = ("f_x", "f_y", "f_z", "m_x", "m_y", "m_z")
FEATURES = {
    "1": lambda at: 1.0,
    "alpha": lambda at: at.alpha,
    "beta": lambda at: at.beta,
    "V_a": lambda at: at.V_a / crosswind_speed(at),
    "p": lambda at: at.z.p,
    "q": lambda at: at.z.q,
    "r": lambda at: at.z.r,
    "rudder": lambda at: at.deflections["rudder"],
    "elevator": lambda at: at.deflections["elevator"],
    "aileron": lambda at: at.deflections["aileron"],
    "elevation": lambda at: -at.p_hat[2],
    "tether_length": lambda at: at.inputs["tether_length"] / (40 * at.values["b"]),
    "tension": lambda at: at.inputs["tension"] / (6 * weight(at)),
    "sin_heading": lambda at: sin(at.z.psi),
    "cos_heading": lambda at: cos(at.z.psi),
}
"""Features of about 1 on any kite that flies crosswind: V_a in units of 2.5 times the speed at which a lift coefficient of 1 carries the
kite, tether length of 40 spans, (measured) tension of 6 weights (of a kite of 50 kg with 3 m2 and 7.4 m: 41 m/s, 296 m, 2.9 kN); angles and
rates in rad."""
_TERM = re.compile(r"^([fm]_[xyz])\*(.+)$")


def parse_term(target: str) -> tuple[str, list[str]] | None:
    """`m_y*alpha*V_a` -> ("m_y", ["alpha", "V_a"]); None where it cannot be read."""
    match = _TERM.match(target)
    factors = match[2].split("*") if match else []
    return (match[1], factors) if match and all(f in FEATURES for f in factors) else None


class CustomTerm(Effect):
    """force or moment channel += k qbar S (b or c for moments) * product of features. The target is the term, e.g. `m_y*alpha*V_a`."""

    name = "custom_term"
    doc = "empirical term found in a residual"
    parameters = (Parameter("k", 0.0, "-", -1.0, 1.0, source="empirical"),)
    traceable = False
    empirical = True

    def __init__(self, target: str = "", declaration: KiteDeclaration | None = None):
        super().__init__(target, declaration)
        term = parse_term(target)
        if term is None:
            raise BadInput(
                f"cannot read the term '{target}'", where="effects", do=f"One of f_x to m_z, times any of {', '.join(FEATURES)}."
            )
        self.channel, self.factors = term
        self.reads = ("tension",) if "tension" in self.factors else ()
        self.of_line = bool({"tension", "tether_length"} & set(self.factors))

    @classmethod
    def accepts(cls, target: str) -> bool:
        return parse_term(target) is not None

    def load(self, at: Instant, own: SimpleNamespace) -> Load:
        channel = self.channel
        value = own.k * at.dynamic_pressure * at.values["S"]
        for factor in self.factors:
            value = value * FEATURES[factor](at)
        if channel[0] == "m":
            value = value * at.values["c" if channel == "m_y" else "b"]
        vector = tuple(value if axis == channel[2] else 0.0 * value for axis in "xyz")
        nothing = (0.0 * value,) * 3
        return Load(vector, nothing) if channel[0] == "f" else Load(nothing, vector)
