"""flight.yaml: how a flight folder is to be read. Pydantic models, every key once."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, Tag

from awescli.flightlog.unit_words import known_unit
from awescli.notation.errors import BadInput
from awescli.notation.names import nearest_quantity
from awescli.notation.quantities import INPUTS, MEASURED

Group = Literal["onboard", "winch", "weather", "motor"]
Late = float | Literal["auto"]

OF_VECTOR = {"position": ("p_n", "p_e", "p_d"), "velocity": ("v_n", "v_e", "v_d"), "acceleration": ("a_x", "a_y", "a_z")}
"""Vector entries of flight.yaml -> the quantities they give."""

Unit = Annotated[str, AfterValidator(known_unit)]


def _quantity(name: str) -> str:
    if name not in (known := (*MEASURED, *INPUTS)):
        raise ValueError(BadInput(f"'{name}' is not a quantity", do=nearest_quantity(name, known)))
    return name


Quantity = Annotated[str, AfterValidator(_quantity)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Column(_Strict):
    """One column of the CSV: value = sign * scale * column + offset, in `unit`."""

    column: str = Field(description="name of the column in the CSV file")
    unit: Unit = Field(description="unit of the column, e.g. m, ft, deg, kt, lbf, m/s")
    sign: Literal[1, -1] = Field(1, description="-1 where the column counts the other way")
    scale: float = Field(1.0, description="factor that makes the column a number in `unit`, where no unit is its own", gt=0)
    offset: float = Field(0.0, description="added after sign and scale, in `unit`")
    group: Group | None = Field(None, description="clock group; default by quantity")


class Vector(_Strict):
    """Three columns of a vector, in the order of its frame: NED (north, east, down), ENU (east, north, up), BODY (x forward, y right,
    z down)."""

    columns: tuple[str, str, str] = Field(description="the three columns")
    unit: Unit = Field(description="unit of all three")
    frame: Literal["NED", "ENU", "BODY"] = Field("NED", description="axes of the columns")
    scale: float = Field(1.0, description="factor that makes the columns numbers in `unit`", gt=0)
    group: Group = Field("onboard", description="clock group")


class Acceleration(Vector):
    """Acceleration of the kite, or what its accelerometers show."""

    measures: Literal["kinematic", "specific_force"] = Field(
        "kinematic", description="kinematic: d(velocity)/dt; specific_force: as accelerometers show it, gravity taken off (-g at rest)"
    )


class Spherical(_Strict):
    """Position from angles and distance: elevation above the horizon, azimuth clockwise from north, distance from the winch."""

    elevation: Column = Field(description="angle above the horizon, from the winch")
    azimuth: Column = Field(description="angle in the horizon, clockwise from north")
    distance: Column = Field(description="straight distance from the winch")


class Origin(_Strict):
    """Where the winch stands."""

    latitude: float = Field(description="[deg], north positive", ge=-90, le=90)
    longitude: float = Field(description="[deg], east positive", ge=-180, le=360)
    altitude: float = Field(description="[m], above the same zero as the log's altitude")


class Geodetic(_Strict):
    """Position from latitude, longitude and altitude (WGS84), and where the winch stands."""

    latitude: Column = Field(description="north positive")
    longitude: Column = Field(description="east positive")
    altitude: Column = Field(description="above the same zero as that of the origin")
    origin: Origin = Field(description="latitude [deg], longitude [deg], altitude [m] of the winch")


class Time(_Strict):
    """The clock of a file."""

    column: str = Field(description="name of the time column")
    unit: Literal["s", "ms", "us", "ns", "min", "h", "iso"] = Field(
        description="its unit; iso: text such as 2022-04-15T05:20:00.040 (UTC where no zone is named), or a time of day"
    )
    start: float | None = Field(None, description="unix time [s] of its zero, where it does not count from 1970 itself")


class Wind(_Strict):
    """Wind as one station or a profile of heights saw it: columns of the log, or of a file of its own."""

    file: str | None = Field(None, description="a CSV of its own, relative to this file; without columns: Kitemill's weather format")
    time: Time | None = Field(None, description="clock of that file; the log's and this one must both be unix time, or one clock")
    direction: Column | None = Field(None, description="where the wind comes from, clockwise from north (offset 180 where it is where to)")
    speed: Column | None = Field(None, description="horizontal wind speed")
    density: Column | None = Field(None, description="air density, kg/m3")
    temperature: Column | None = Field(None, description="of the air, for its density where that is not logged")
    pressure: Column | None = Field(None, description="static, at the station's height, for the density")
    height: float | Column = Field(10.0, description="height above the winch [m], or the column that holds it (one row a time and height)")


def _kind_of_position(value: Any) -> str:
    """Which of the three forms of a position is meant, so that only its own mistakes are reported."""
    keys = set(value) if isinstance(value, dict) else set(type(value).model_fields) if isinstance(value, BaseModel) else set()
    if keys & {"latitude", "longitude", "altitude", "origin"}:
        return "geodetic"
    return "spherical" if keys & {"elevation", "azimuth", "distance"} else "vector"


Position = Annotated[
    Annotated[Vector, Tag("vector")] | Annotated[Spherical, Tag("spherical")] | Annotated[Geodetic, Tag("geodetic")],
    Discriminator(_kind_of_position),
]


class Mix(_Strict):
    """A quantity as a sum of columns or channels: `{of: {da_r: 0.5, da_l: -0.5}, unit: rad}`; factors say what each is worth in `unit`."""

    of: dict[str, float] = Field(min_length=1, description="column or channel -> factor")
    unit: Unit = Field(description="unit of the sum")
    offset: float = Field(0.0, description="added to the sum, in its unit")
    group: Group | None = Field(None, description="clock group; default by quantity")


class FlightFile(_Strict):
    """The whole flight.yaml: how a flight log is to be read."""

    format: Literal["csv", "kitemill", "ampyx", "umn", "px4", "ardupilot"] = Field(
        "csv", description="csv (mapped here), kitemill, ampyx, umn (.mat), px4 (.ulg) or ardupilot (.bin)"
    )
    file: str | None = Field(None, description="the log, relative to this file (default: kite.csv, *.mat, or the only *.csv)")
    units: dict[str, Unit] = Field({}, description="format kitemill: column -> unit, where it is not the format's own")
    station_height: float = Field(10.0, description="height of a weather station in Kitemill's format without heights [m]", ge=0.1)
    clocks: dict[Group, Late] = Field({}, description="clock group -> s by which its records come late, or auto (winch only)")
    time: Time | None = Field(None, description="format csv: the time column")
    position: Position | None = Field(None, description="format csv: position from the winch")
    velocity: Vector | None = Field(None, description="format csv: velocity over ground")
    acceleration: Acceleration | None = Field(None, description="format csv: acceleration, in body axes unless its frame says otherwise")
    signals: dict[Quantity, Column] = Field({}, description="format csv: quantity -> column")
    mix: dict[Quantity, Mix] = Field({}, description="formats csv, umn, px4, ardupilot: quantity -> sum of columns or channels")
    navigation: Literal["estimator", "gnss"] = Field(
        "estimator", description="formats umn, px4, ardupilot: position, velocity of the onboard estimator, or of the GNSS, at its own rate"
    )
    wind: Wind | None = Field(None, description="format csv: wind columns, or a weather file")
    unchecked: tuple[str, ...] = Field((), description="format csv: columns whose unit is not to be checked against the others")
