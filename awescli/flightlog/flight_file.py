"""flight.yaml: how a flight folder is to be read. Pydantic models, every key once."""

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from awescli.flightlog.units import VOCABULARY
from awescli.notation.errors import did_you_mean
from awescli.notation.quantities import INPUTS, MEASURED

Group = Literal["onboard", "winch", "weather", "motor"]
Late = float | Literal["auto"]

OF_VECTOR = {"position": ("p_n", "p_e", "p_d"), "velocity": ("v_n", "v_e", "v_d"), "acceleration": ("a_x", "a_y", "a_z")}
"""Vector entries of flight.yaml -> the quantities they give."""


def _known_unit(unit: str) -> str:
    if unit not in VOCABULARY:
        raise ValueError(f"unknown unit '{unit}'. {did_you_mean(unit, VOCABULARY)}")
    return unit


Unit = Annotated[str, AfterValidator(_known_unit)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Column(_Strict):
    """One column of the CSV: value = sign * column + offset, both in `unit`."""

    column: str = Field(description="name of the column in the CSV file")
    unit: Unit = Field(description="unit of the column, e.g. m, deg, kgf, m/s")
    sign: Literal[1, -1] = Field(1, description="-1 where the column counts the other way")
    offset: float = Field(0.0, description="added after the sign, in the column's unit")
    group: Group | None = Field(None, description="clock group; default by quantity")


class Vector(_Strict):
    """Three columns of a vector, in the order of its frame: NED (north, east, down), ENU (east, north, up), BODY (x, y, z)."""

    columns: tuple[str, str, str] = Field(description="the three columns")
    unit: Unit = Field(description="unit of all three")
    frame: Literal["NED", "ENU", "BODY"] = Field("NED", description="axes of the columns")
    group: Group = Field("onboard", description="clock group")


class Spherical(_Strict):
    """Position from angles and distance: elevation above the horizon, azimuth clockwise from north, distance from the winch."""

    elevation: Column
    azimuth: Column
    distance: Column


class Time(_Strict):
    """The clock of the file."""

    column: str = Field(description="name of the time column")
    unit: Literal["s", "ms", "us", "ns"] = Field(description="its unit")


class Wind(_Strict):
    """Wind columns of the same file, as one station saw them."""

    direction: Column = Field(description="where the wind comes from, clockwise from north (sign, offset where it is not)")
    speed: Column = Field(description="horizontal wind speed")
    density: Column | None = Field(None, description="air density, kg/m3")
    height: float = Field(10.0, description="height of the station above the winch [m]", ge=0.1)


class Mix(_Strict):
    """A quantity as a sum of columns or channels: `{of: {da_r: 0.5, da_l: -0.5}, unit: rad}`; factors say what each is worth in `unit`."""

    of: dict[str, float] = Field(min_length=1, description="column or channel -> factor")
    unit: Unit = Field(description="unit of the sum")
    offset: float = Field(0.0, description="added to the sum, in its unit")
    group: Group | None = Field(None, description="clock group; default by quantity")


class FlightFile(_Strict):
    """The whole flight.yaml."""

    format: Literal["csv", "kitemill", "ampyx", "umn", "px4", "ardupilot"] = Field(
        "csv", description="csv (mapped here), kitemill, ampyx, umn (.mat), px4 (.ulg) or ardupilot (.bin)"
    )
    file: str | None = Field(None, description="the log, relative to this file (default: kite.csv, *.mat, or the only *.csv)")
    units: dict[str, Unit] = Field({}, description="format kitemill: column -> unit, where it is not the format's own")
    station_height: float = Field(10.0, description="format kitemill: height of a weather station without heights [m]", ge=0.1)
    clocks: dict[Group, Late] = Field({}, description="clock group -> s by which its records come late, or auto (winch only)")
    time: Time | None = Field(None, description="format csv: the time column")
    position: Vector | Spherical | None = Field(None, description="format csv: position from the winch")
    velocity: Vector | None = Field(None, description="format csv: velocity over ground")
    acceleration: Vector | None = Field(None, description="format csv: kinematic acceleration")
    signals: dict[str, Column] = Field({}, description="format csv: quantity -> column")
    mix: dict[str, Mix] = Field({}, description="formats csv, umn, px4, ardupilot: quantity -> sum of columns or channels")
    navigation: Literal["estimator", "gnss"] = Field(
        "estimator", description="formats umn, px4, ardupilot: position, velocity of the onboard estimator, or of the GNSS, at its own rate"
    )
    wind: Wind | None = Field(None, description="format csv: wind columns")
    believe: tuple[str, ...] = Field((), description="format csv: columns whose unit is not to be checked against the others")

    @model_validator(mode="after")
    def _complete(self) -> "FlightFile":
        for quantity in (*self.signals, *self.mix):
            if quantity not in (*MEASURED, *INPUTS):
                key = "signals" if quantity in self.signals else "mix"
                raise ValueError(f"{key}.{quantity} is not a quantity. {did_you_mean(quantity, (*MEASURED, *INPUTS))}")
        if twice := [q for q in self.mix if q in self.signals]:
            raise ValueError(f"{', '.join(twice)} stand in signals and in mix; keep one")
        for name, quantities in OF_VECTOR.items():
            if getattr(self, name) is not None and (twice := [q for q in quantities if q in self.signals]):
                raise ValueError(f"{', '.join(twice)} stand in signals and in {name}; keep one")
        for name in ("position", "velocity"):
            if isinstance(getattr(self, name), Vector) and getattr(self, name).frame == "BODY":
                raise ValueError(f"{name} must be in NED or ENU")
        if self.format == "csv" and self.time is None:
            raise ValueError("format csv needs `time: {column: ..., unit: ...}`")
        if self.format == "csv" and not (self.signals or self.position or self.velocity):
            raise ValueError("format csv maps no signal: fill `signals`, `position` and `velocity`")
        if self.format != "csv" and (
            used := [n for n in ("time", "position", "velocity", "acceleration", "signals", "wind") if getattr(self, n)]
        ):
            raise ValueError(f"{', '.join(used)} belong to format csv, this is format {self.format}")
        if self.format in ("kitemill", "ampyx") and self.mix:
            raise ValueError(f"`mix` belongs to formats csv, umn, px4 and ardupilot, this is format {self.format}")
        if self.format in ("csv", "kitemill", "ampyx") and self.navigation != "estimator":
            raise ValueError(f"`navigation` belongs to formats umn, px4 and ardupilot, this is format {self.format}")
        if self.format != "kitemill" and self.units:
            raise ValueError("`units` belongs to format kitemill; in format csv the unit stands at each signal")
        if any(late == "auto" for group, late in self.clocks.items() if group != "winch"):
            raise ValueError("only the winch clock can be found automatically (clocks: {winch: auto})")
        return self
