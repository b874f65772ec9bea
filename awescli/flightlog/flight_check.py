"""flight.yaml checked: every mistake of the file at once, with its line and the nearest right word."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from awescli.flightlog.flight_file import OF_VECTOR, Column, FlightFile, Spherical, Vector, Wind
from awescli.flightlog.table import read_header
from awescli.flightlog.text_stamps import ISO
from awescli.flightlog.units import factor_to_si
from awescli.notation.document import open_document
from awescli.notation.errors import BadInput, BadInputs, did_you_mean
from awescli.notation.present import present
from awescli.notation.quantities import UNITS

OF_WIND = {"direction": "rad", "speed": "m/s", "density": "kg/m3", "temperature": "K", "pressure": "Pa", "height": "m"}
"""Column of the wind -> SI unit."""
OF_SPHERICAL = {"elevation": "rad", "azimuth": "rad", "distance": "m"}
OF_GEODETIC = {"latitude": "rad", "longitude": "rad", "altitude": "m"}
ATTITUDE = ("phi", "theta", "psi")
CSV_ONLY = ("time", "position", "velocity", "acceleration", "signals", "wind")
"""Keys that belong to format csv."""
LOGS = {
    "csv": "*.csv", "kitemill": "kite.csv", "ampyx": "*.mat", "umn": "*.mat", "px4": "*.ulg", "ardupilot": "*.[bB][iI][nN]",
}  # fmt: skip
"""Format -> the log beside a flight.yaml that does not name it."""
MIXED = ("csv", "umn", "px4", "ardupilot")
"""Formats whose quantities may be sums of columns or channels."""

Where = Callable[..., str]
"""Parts of a key -> its place: `flight.yaml:12: signals.phi`."""


@dataclass(frozen=True)
class Declared:
    """A checked flight.yaml. log: the log that it describes, None where only its text was checked; where: names the place of a key."""

    path: Path
    file: FlightFile
    log: Path | None
    where: Where

    @property
    def described(self) -> Path:
        """The log, where more than the text was checked."""
        return present(self.log, "the log that a flight.yaml describes")


@dataclass(frozen=True)
class Use:
    """One column that a flight.yaml uses: where it says so, the column, its unit and the SI unit of what it is; of_wind_file: it stands
    in the weather's own file."""

    loc: tuple[str | int, ...]
    column: str
    unit: str
    si_unit: str
    of_wind_file: bool = False


def read_flight_file(path: Path, text: str | None = None) -> Declared:
    """The flight.yaml at `path`. Raises BadInput, or BadInputs for all its mistakes: unknown keys, quantities and units, units of
    something else, entries that contradict each other, files and columns that are not there.

    text: instead of the file's own; then files and columns are not looked for.
    """
    document = open_document(path, text)
    file, errors = document.check_part(FlightFile)
    log = None
    if file is not None:
        errors += contradictions(file, document.where)
        if text is None:
            log, more = _log_file(path, file, document.where)
            errors += more
            if file.format == "csv":
                errors += _missing_columns(path, file, log, document.where)
    if errors or file is None:
        raise errors[0] if len(errors) == 1 else BadInputs(errors)
    return Declared(path, file, log, document.where)


def uses(file: FlightFile) -> Iterator[Use]:
    """Every column that the mapping uses, the clock first."""
    if file.time is not None:
        yield Use(("time",), file.time.column, file.time.unit, "s")
    for quantity, spec in file.signals.items():
        yield _use(("signals", quantity), spec, UNITS[quantity])
    if file.format == "csv":
        for quantity, mix in file.mix.items():
            yield from (Use(("mix", quantity, "of", column), column, mix.unit, UNITS[quantity]) for column in mix.of)
    for name, quantities in OF_VECTOR.items():
        vector = getattr(file, name)
        if isinstance(vector, Vector):
            yield from (Use((name, "columns", i), c, vector.unit, UNITS[quantities[0]]) for i, c in enumerate(vector.columns))
        elif vector is not None:
            parts = OF_SPHERICAL if isinstance(vector, Spherical) else OF_GEODETIC
            yield from (_use((name, part), getattr(vector, part), si) for part, si in parts.items())
    if file.wind is not None:
        own = file.wind.file is not None
        if file.wind.time is not None:
            yield Use(("wind", "time"), file.wind.time.column, file.wind.time.unit, "s", own)
        yield from (_use(("wind", part), spec, OF_WIND[part], own) for part, spec in columns_of_wind(file.wind).items())


def columns_of_wind(wind: Wind) -> dict[str, Column]:
    """direction, speed, ... -> its column, of those that are mapped."""
    return {part: spec for part in OF_WIND if isinstance(spec := getattr(wind, part), Column)}


def _use(loc: tuple[str | int, ...], spec: Column, si_unit: str, of_wind_file: bool = False) -> Use:
    return Use(loc, spec.column, spec.unit, si_unit, of_wind_file)


def contradictions(file: FlightFile, where: Where) -> list[BadInput]:
    """What the schema cannot see."""
    errors = [*_wrong_units(file, where), *_wrong_formats(file, where), *_wrong_vectors(file, where)]
    if file.wind is not None:
        errors += _wrong_wind(file.wind, where)
    if any(late == "auto" for group, late in file.clocks.items() if group != "winch"):
        errors.append(BadInput("only the winch clock can be found automatically", where("clocks"), "Write clocks: {winch: auto}."))
    return errors


def _wrong_units(file: FlightFile, where: Where) -> Iterator[BadInput]:
    """Units of something else, each once."""
    seen_at = set()
    for use in uses(file):
        # of several columns in one entry its unit is named once
        loc = use.loc[:1] if "columns" in use.loc else use.loc[:2] if use.loc[0] == "mix" else use.loc
        if use.unit == ISO:
            continue
        try:
            factor_to_si(use.unit, use.si_unit)
        except BadInput as e:
            if loc not in seen_at:
                yield BadInput(e.what, where(*loc, "unit"), e.do)
            seen_at.add(loc)


def _wrong_formats(file: FlightFile, where: Where) -> Iterator[BadInput]:
    if file.format == "csv":
        if file.time is None:
            yield BadInput("format csv needs the time column", where(), "Add `time: {column: ..., unit: s}`.")
        if not (file.signals or file.mix or file.position or file.velocity):
            yield BadInput("format csv maps no signal", where(), "Fill `signals`, `position` and `velocity`.")
    else:
        for name in CSV_ONLY:
            if getattr(file, name):
                do = "Remove it, or write `format: csv` and map every column."
                yield BadInput(f"this belongs to format csv, and this is format {file.format}", where(name), do)
    if file.format not in MIXED and file.mix:
        yield BadInput(f"this belongs to formats {', '.join(MIXED)}, and this is format {file.format}", where("mix"), "Remove it.")
    if file.format not in MIXED[1:] and file.navigation != "estimator":
        what = f"this belongs to formats {', '.join(MIXED[1:])}, and this is format {file.format}"
        yield BadInput(what, where("navigation"), "Remove it.")
    if file.format != "kitemill" and file.units:
        yield BadInput("this belongs to format kitemill", where("units"), "In format csv the unit stands at each signal.")


def _wrong_vectors(file: FlightFile, where: Where) -> Iterator[BadInput]:
    for quantity in file.mix:
        if quantity in file.signals:
            yield BadInput(f"{quantity} stands in signals and in mix", where("mix", quantity), "Keep one.")
    for name, quantities in OF_VECTOR.items():
        if getattr(file, name) is not None and (twice := [q for q in quantities if q in (*file.signals, *file.mix)]):
            yield BadInput(f"{', '.join(twice)} stand in signals and in {name}", where(name), "Keep one.")
    if isinstance(file.position, Vector) and file.position.frame == "BODY":
        yield BadInput("a position has no body axes", where("position", "frame"), "Write NED or ENU.")
    if missing := [a for a in ATTITUDE if a not in file.signals]:
        do = f"Map {', '.join(missing)} in signals as well."
        if file.velocity is not None and file.velocity.frame == "BODY":
            yield BadInput("velocities in body axes need the attitude", where("velocity"), do)
        acceleration = file.acceleration
        if acceleration is not None and acceleration.frame != "BODY":
            yield BadInput("accelerations in NED or ENU need the attitude", where("acceleration"), do)
        if acceleration is not None and acceleration.measures == "specific_force" and acceleration.frame == "BODY":
            yield BadInput("to add gravity to a specific force the attitude is needed", where("acceleration"), do)


def _wrong_wind(wind: Wind, where: Where) -> Iterator[BadInput]:
    mapped = columns_of_wind(wind)
    if wind.file is None or mapped:
        for part in ("direction", "speed"):
            if part not in mapped:
                yield BadInput(f"wind needs a {part}", where("wind"), f"Add `{part}: {{column: ..., unit: ...}}`.")
    if wind.file is None and wind.time is not None:
        yield BadInput("only a weather file of its own has a clock of its own", where("wind", "time"), "Remove it, or name the `file`.")
    if wind.file is not None and mapped and wind.time is None:
        yield BadInput("a weather file needs its clock", where("wind"), "Add `time: {column: ..., unit: s}`.")
    if ("temperature" in mapped) != ("pressure" in mapped):
        yield BadInput("density comes from temperature and pressure together", where("wind"), "Map both, or neither.")
    if "height" in mapped and wind.file is None:
        do = "Write the height of the station in m; a profile has a file of its own."
        yield BadInput("wind in the log's own rows has one height", where("wind", "height"), do)


def _log_file(path: Path, file: FlightFile, where: Where) -> tuple[Path | None, list[BadInput]]:
    """The log: named, or the only one beside the declaration that is not the weather."""
    pattern = LOGS[file.format]
    if file.file is not None:
        return _named(path, file.file, pattern, where("file"))
    weather = path.parent / file.wind.file if file.wind is not None and file.wind.file else None
    found = [p for p in sorted(path.parent.glob(pattern)) if p != weather]
    if len(found) == 1:
        return found[0], []
    what = f"there is no {pattern} beside it" if not found else f"several logs: {', '.join(p.name for p in found[:8])}"
    return None, [BadInput(what, str(path), "Say which one: `file: NAME`.")]


def _named(path: Path, name: str, pattern: str, place: str) -> tuple[Path | None, list[BadInput]]:
    """A file that the declaration names."""
    if (named := path.parent / name).is_file():
        return named, []
    near = [p.name for p in path.parent.glob(pattern)]
    return None, [BadInput(f"there is no file {named}", place, did_you_mean(name, near) if near else "Check the path.")]


def _missing_columns(path: Path, file: FlightFile, log: Path | None, where: Where) -> list[BadInput]:
    """Columns that the log, or the weather file, does not have; each with the nearest that it has."""
    errors, weather = [], None
    if file.wind is not None and file.wind.file is not None:
        weather, errors = _named(path, file.wind.file, "*.csv", where("wind", "file"))
    headers = {}
    for of_wind, source in ((False, log), (True, weather)):
        if source is not None:
            try:
                headers[of_wind] = source, read_header(source)[1]
            except BadInput as e:
                errors.append(e)
    for use in uses(file):
        source, header = headers.get(use.of_wind_file, (None, ()))
        if source is not None and use.column not in header:
            loc = use.loc if "columns" in use.loc or use.loc[0] == "mix" else (*use.loc, "column")
            errors.append(BadInput(f"{source.name} has no column '{use.column}'", where(*loc), did_you_mean(use.column, header)))
    return errors
