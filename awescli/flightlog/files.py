"""Which files a flight is read from: what the readers open, and what is hashed as a flight, is this list."""

from dataclasses import dataclass
from pathlib import Path

from awescli.flightlog.flight_check import LOGS, Declared, read_flight_file
from awescli.notation.errors import BadInput
from awescli.notation.present import present

DECLARED = "flight.yaml"
MATLAB = "matlab"
"""A .mat file of either layout: which one, its variables tell."""
PATTERNS: tuple[tuple[str, str], ...] = (
    (DECLARED, "declared"), ("*.mat", MATLAB), *((LOGS[kind], kind) for kind in ("kitemill", "px4", "ardupilot")),
)  # fmt: skip
"""What to look for in a folder, in this order, and which format it is."""


@dataclass(frozen=True)
class FlightFiles:
    """The files of one flight. format: who reads it (`read.READERS`); declared: its flight.yaml, checked; why_no_weather: why none of the
    weather files beside a mapped log is taken."""

    format: str
    log: Path
    weather: Path | None = None
    declared: Declared | None = None
    why_no_weather: str = ""

    @property
    def mapping(self) -> Declared:
        """The flight.yaml of a flight that has one."""
        return present(self.declared, "the flight.yaml of a mapped log")

    def opened(self) -> dict[str, Path]:
        """What each file is -> the file, of all that the reader opens."""
        files = {"log": self.log, "weather": self.weather, "declaration": self.declared.path if self.declared else None}
        return {what: file for what, file in files.items() if file is not None}


def find_flight(flight: Path) -> FlightFiles:
    """The files of the flight in the folder `flight`, or described by the YAML file `flight`. Raises BadInput where there is none, and
    BadInputs for all mistakes of a flight.yaml (`flight_check.read_flight_file`)."""
    flight = Path(flight)
    if not flight.exists():
        near = sorted(p.name for p in flight.parent.iterdir() if p.is_dir()) if flight.parent.is_dir() else []
        raise BadInput("there is no such flight folder", str(flight), f"Beside it: {', '.join(near[:8])}." if near else "Check the path.")
    if not flight.is_dir():
        if flight.suffix in (".yaml", ".yml"):
            return _declared(flight)
        raise BadInput("a flight is a folder, this is a file", str(flight), f"Give its folder: {flight.parent}.")
    for pattern, kind in PATTERNS:
        if found := sorted(flight.glob(pattern)):
            if len(found) > 1:
                names = ", ".join(p.name for p in found[:8])
                raise BadInput(
                    f"several logs: {names}", str(flight), f"Say which one in a {DECLARED} (`file: NAME`), or give each its folder."
                )
            if kind == "declared":
                return _declared(found[0])
            return FlightFiles(kind, found[0], find_weather(flight) if kind == "kitemill" else None)
    there = ", ".join(sorted(p.name for p in flight.iterdir())[:12]) or "nothing"
    raise BadInput(
        "no flight log that awes knows",
        str(flight),
        f"Looked for {', '.join(p for p, _ in PATTERNS)}; there is: {there}. Map a CSV in {DECLARED}.",
    )


def find_weather(folder: Path) -> Path | None:
    """The weather file of a Kitemill folder, or None; several wind*.csv are an error, since one would be ignored."""
    if (folder / "lista_fyr_lighthouse.csv").is_file():
        return folder / "lista_fyr_lighthouse.csv"
    found = sorted(folder.glob("wind*.csv"))
    if len(found) > 1:
        raise BadInput(
            f"several weather files: {', '.join(p.name for p in found)}", str(folder), "Keep the one that belongs to the flight."
        )
    return found[0] if found else None


def _declared(path: Path) -> FlightFiles:
    """What a flight.yaml describes."""
    declared = read_flight_file(path)
    file, log = declared.file, declared.described
    if file.format == "csv":
        weather, why_not = _beside(declared) if file.wind is None else (path.parent / file.wind.file if file.wind.file else None, "")
        return FlightFiles(file.format, log, weather, declared, why_not)
    return FlightFiles(file.format, log, find_weather(log.parent) if file.format == "kitemill" else None, declared)


def _beside(declared: Declared) -> tuple[Path | None, str]:
    """(a weather file that nobody mapped, beside the log or its flight.yaml; why none is taken where there are several)"""
    for folder in dict.fromkeys((declared.described.parent, declared.path.parent)):
        try:
            found = find_weather(folder)
        except BadInput as e:
            return None, e.what
        if found is not None and found != declared.log:
            return found, ""
    return None, ""
