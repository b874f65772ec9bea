"""What the XML of a foreign kite is written in: units, the signals and numbers that formulas may name, and the elements around formulas.

JSBSim counts in ft, lbf and slug; its unit METER is 3.2808399 ft, so that only ft, lbf and slug stand in the XML, and FT is exact here.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from foreign_formula import number, xml

from awescli.control.pattern import Pattern
from awescli.flightlog.log import WindRecord
from awescli.notation.errors import BadInput
from awescli.notation.quantities import SURFACES
from awescli.simulation.synthetic import ReelOut

FT = 1 / 0.3048
"""Feet in a metre."""
LBF = 0.45359237 * 9.80665
"""Newtons in a pound-force."""
SLUG = LBF * FT
"""Kilograms in a slug."""
RADIUS = 1e10
"""[ft] of the planet: its surface is flat to 1e-5 m within a line's length, and a position is still known to 1e-6 m."""
STEP = 1 / 400
"""[s] of JSBSim. Set before a model is loaded: flight-control components keep the step that they were loaded with."""

MOVING = (
    "t", "p_n", "p_e", "p_d", "u", "v", "w", "v_n", "v_e", "v_d", "V_a", "qS", "rho", "height", "distance", "length", "reel", "elevation",
    "phase", "heading", "winch_length", "winch_speed", "winch_acceleration", "reel_acceleration", "last_a_x", "last_a_y", "last_a_z",
    "wind_n", "wind_e", "wind_d", *(f"R{i}{j}" for i in "123" for j in "123"),
)  # fmt: skip
"""Signals in SI that the flight control computes first in every frame, as si/NAME. t: s from the log's first row; qS: dynamic pressure
times wing area [N]; length, reel, reel_acceleration: what the line does; winch_length, winch_speed, winch_acceleration: what the winch
says it does; elevation: height over distance, as the bank of empirical terms has it; phase: place in the loop, 0 at its top, growing to
the right; heading: yaw from downwind; wind_n ...: the air's velocity at the kite; Rij: body to NED; last_a_x: a_x of the frame before."""
SIGNALS = {
    "alpha": "aero/alpha-rad", "beta": "aero/beta-rad", "phi": "attitude/phi-rad", "theta": "attitude/theta-rad", "psi": "attitude/psi-rad",
    "p": "velocities/p-rad_sec", "q": "velocities/q-rad_sec", "r": "velocities/r-rad_sec", "p_air": "velocities/p-aero-rad_sec",
    "tension": "line/tension", **{f"a_{axis}": f"true/a_{axis}" for axis in "xyz"},
    **{name: f"si/{name}" for name in MOVING}, **{surface: f"surface/{surface}" for surface in SURFACES},
}  # fmt: skip
"""Name in a formula -> property; SI and rad, surfaces as they act on the air, in the log's signs."""
OF_THE_KITE = ("m", "g", "S", "b", "c", "k_v", "c_v", "dl", "d_t", "CtD")
"""Parameters of the kite file that formulas may name."""


@dataclass(frozen=True)
class Scene:
    """What a flight needs beside the kite and the world. lead: s flown before the log's first row; duration: s of the log."""

    wind: WindRecord
    reel_out: ReelOut
    pattern: Pattern
    lead: float
    duration: float


@dataclass(frozen=True)
class Names:
    """Signals (name -> property) and numbers that formulas may name."""

    signals: Mapping[str, str]
    numbers: Mapping[str, float]

    def also(self, signals: Mapping[str, str] | None = None, numbers: Mapping[str, float] | None = None) -> "Names":
        """The same names and some more, which come first."""
        return Names({**self.signals, **(signals or {})}, {**self.numbers, **(numbers or {})})

    def xml(self, formula: str) -> str:
        """The formula as an element. Raises BadInput."""
        return xml(formula, self.signals, self.numbers)

    def number(self, formula: str) -> float:
        """The value of a formula that names numbers only. Raises BadInput."""
        return number(formula, self.numbers)

    def function(self, name: str, formula: str) -> str:
        """A function, computed where it stands, whose value is the property `name`."""
        return f'<function name="{name}">{self.xml(formula)}</function>'

    def component(self, name: str, formula: str, output: str = "") -> str:
        """A flight-control component that computes a formula; output: a property that it sets beside its own."""
        return computed(name, self.xml(formula), output)


def names_of(parameters: Mapping[str, float], values: Mapping[str, float], scene: Scene, own: Sequence[str]) -> Names:
    """All that formulas may name. parameters: of the kite; values: the kind's numbers; own: names of the world's signals. Raises BadInput
    where a kind calls something of its own by a name that is taken."""
    pattern = scene.pattern
    numbers = {name: parameters[name] for name in OF_THE_KITE} | {
        "pi": math.pi, "planet": RADIUS, "lbf": LBF, "slug_ft3": SLUG * FT**3, "metre": FT, "step": STEP, "lead": scene.lead,
        "duration": scene.duration, "downwind": pattern.azimuth,
        "sin_a": math.sin(pattern.azimuth), "cos_a": math.cos(pattern.azimuth),
        "sin_e": math.sin(pattern.elevation), "cos_e": math.cos(pattern.elevation),
    }  # fmt: skip
    if taken := sorted({*values, *own} & {*SIGNALS, *numbers}):
        raise BadInput(f"a kind's own numbers and signals have names that are taken: {', '.join(taken)}", do="Call them otherwise.")
    return Names({**SIGNALS, **{name: f"own/{name}" for name in own}}, {**numbers, **values})


def computed(name: str, element: str, output: str = "") -> str:
    """A flight-control component around a function's element."""
    written = f"<output>{output}</output>" if output else ""
    return f'<fcs_function name="{name}"><function>{element}</function>{written}</fcs_function>'


def delayed(seconds: float) -> str:
    """A component's delay, to the next frame. JSBSim's are a frame shorter than the number of frames that it is given."""
    return f'<delay type="frames">{round(seconds / STEP) + 1}</delay>'


def place(arm: Sequence[float]) -> str:
    """A place (x, y, z) [m, FRD] in JSBSim's structural frame: inches, x aft, y right, z up."""
    x, y, z = (12 * FT * float(a) for a in arm)
    return f"<x>{-x!r}</x><y>{y!r}</y><z>{-z!r}</z>"
