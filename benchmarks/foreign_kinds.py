"""The kinds of foreign flights as data (foreign_kinds.yaml): what is in the world, what the declaration lacks, which answer is right.

    kinds = read_kinds()            name -> Kind, in the order of the file
    kinds["actuator_lag"].values("half")

A strength scales with the size of the effect (full, half, quarter; full is the listed size), a shape stays.
"""

from functools import cache
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from awescli.notation.document import read_document
from awescli.notation.quantities import MEASURED, SURFACES

FILE = Path(__file__).with_name("foreign_kinds.yaml")
SHARES = {"full": 1.0, "half": 0.5, "quarter": 0.25}

Surface = Literal[SURFACES]
Channel = Literal[MEASURED]
Coefficient = Literal["CD", "CY", "CL", "Cl", "Cm", "Cn"]
LoadChannel = Literal["f_x", "f_y", "f_z", "m_x", "m_y", "m_z"]


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Actuator(_Frozen):
    """JSBSim's actuator between set-point and surface: rad, s, rad/s; each a formula of the kind's numbers."""

    lag: str | None = Field(None, description="time constant of a first-order lag [s]")
    rate_limit: str | None = Field(None, description="[rad/s]")
    delay: str | None = Field(None, description="[s]")
    hysteresis_width: str | None = Field(None, description="whole width of the play [rad]")
    deadband_width: str | None = Field(None, description="whole width [rad]")
    bias: str | None = Field(None, description="[rad]")


class Signal(_Frozen):
    """A signal with a memory of its own, named in other formulas."""

    of: str = Field(description="formula of what drives it")
    law: Literal["formula", "lag", "washout", "second_order", "integral", "relay"]
    tau: str = Field("1", description="lag, washout: time constant [s]")
    frequency: str = Field("1", description="second_order: undamped [Hz]")
    damping: str = Field("1", description="second_order: ratio")
    on_above: str = Field("0", description="relay: becomes 1 above")
    off_below: str = Field("0", description="relay: becomes 0 below")


class Sensor(_Frozen):
    """What a sensor of JSBSim makes of a channel, beside noise and quantisation."""

    reads: str | None = Field(None, description="formula of what it reads, where that is not the channel itself")
    lag: str | None = Field(None, description="time constant [s]")
    delay: str | None = Field(None, description="[s]")
    drift_rate: str | None = Field(None, description="[unit of the channel per s]")


class Air(_Frozen):
    """How the air differs from what the weather station measures."""

    speed_factor: str = "1"
    turn: str = Field("0", description="added to the direction the wind comes from [rad]")
    north: str = Field("0", description="added wind [m/s]")
    east: str = "0"
    down: str = "0"
    density: str = Field("1", description="factor on the recorded density, a number")


class Line(_Frozen):
    """How line and winch differ from the declared ones."""

    drag: str = Field("0", description="added to C_tD")
    lateral: str = Field("0", description="share of the drag's lateral part, -F_tD v_r / V_a along body y")
    weight: str = Field("0", description="mass per length [kg/m]: half the weight on the kite, a third of the mass moved with it")
    length: str = Field("0", description="true minus logged length [m]")
    length_rate: str = Field("0", description="its rate [m/s]")
    length_acceleration: str = Field("0", description="the rate's rate [m/s2]")
    late: str = Field("0", description="s by which the winch's clock stamps late, a number")


class World(_Frozen):
    """What is in the air beside the declared kite. Formulas name the signals of foreign_aircraft and the kind's own numbers."""

    actuators: dict[Surface, Actuator] = {}
    deflections: dict[Surface, str] = Field({}, description="surface -> formula of what acts on the air, of the actuators' positions [rad]")
    mass: str = Field("0", description="added mass [kg]")
    cg: tuple[str, str, str] = Field(("0", "0", "0"), description="centre of mass from the reference point [m, FRD]")
    air: Air = Air()
    coefficients: dict[Coefficient, str] = Field({}, description="added aerodynamic coefficients")
    loads: dict[LoadChannel, str] = Field({}, description="added forces [N] and moments [N m], body axes")
    line: Line = Line()
    signals: dict[str, Signal] = {}
    sensors: dict[Channel, Sensor] = {}


class Conditions(_Frozen):
    """What kind of flight: ranges that a seed draws from."""

    rates: tuple[int, ...] = Field((50,), description="of the log [Hz]; divisors of 400")
    duration: tuple[float, float] = Field((150.0, 150.0), description="[s]")
    noise: tuple[float, float] = Field((1.0, 1.0), description="true over declared noise")
    attitude_drift: tuple[float, float] = Field((0.0, 0.0), description="standard deviation [deg] of an Ornstein-Uhlenbeck process")
    attitude_memory: tuple[float, float] = Field((2.0, 20.0), description="its memory [s]")
    turbulence: tuple[float, float] = Field((0.0, 0.0), description="MIL-F-8785C, sigma_w [m/s]")
    elevator: tuple[float, float] = Field((3.5, 6.0), description="the operator's trim [deg, in the log's sign]")
    pitot: bool = True
    vanes: bool = Field(False, description="log the flow angles too: a mapped log, wind from one station")
    faults: bool = Field(False, description="the recorder loses rows, sensors fall silent, single values are far off")
    bounds: Literal["hold", "miss"] = Field("hold", description="whether declared bounds hold the truth")


class Kind(_Frozen):
    """One kind of flight."""

    group: Literal["library", "outside", "clean"]
    lacks: str = Field(description="what the declared kite lacks, in a sentence")
    answers: tuple[str, ...] = Field((), description="right answers: `name`, `name:target`; two effects as `a + b`")
    strengths: dict[str, float] = Field({}, description="number -> value at full size; null is 0")
    inverse: tuple[str, ...] = Field((), description="strengths that grow as their number falls")
    shapes: dict[str, float] = {}
    world: World = World()
    conditions: Conditions = Conditions()

    @model_validator(mode="after")
    def _complete(self) -> "Kind":
        if (self.group == "library") != bool(self.answers):
            raise ValueError("a kind of the library names its right answers, and no other does")
        if bool(self.strengths) == (self.group == "clean" or self.conditions.bounds == "miss"):
            raise ValueError("a kind has strengths, unless it is clean or only its bounds are wrong")
        return self

    def values(self, size: str) -> dict[str, float]:
        """Numbers by name at a size out of SHARES."""
        share = SHARES[size]
        scaled = {name: value / share if name in self.inverse else value * share for name, value in self.strengths.items()}
        return {**scaled, **self.shapes}


class Registry(_Frozen):
    kinds: dict[str, Kind]


@cache
def read_kinds() -> dict[str, Kind]:
    """The registry. Raises BadInput with file and line."""
    return dict(read_document(FILE, Registry).kinds)
