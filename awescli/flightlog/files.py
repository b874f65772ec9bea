"""Which files a flight is read from, without reading them: what the readers open, and what is hashed as a flight, is this list."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from awescli.flightlog.flight_file import FlightFile
from awescli.notation.document import read_document
from awescli.notation.errors import BadInput, did_you_mean

DECLARED = "flight.yaml"
PATTERNS: tuple[tuple[str, str], ...] = ((DECLARED, "declared"), ("*.mat", "ampyx"), ("kite.csv", "kitemill"))
"""What to look for in a folder, in this order, and which format it is."""
LOGS = {"csv": "*.csv", "kitemill": "kite.csv", "ampyx": "*.mat"}
"""Format -> the log beside a flight.yaml that does not name it."""


@dataclass(frozen=True)
class FlightFiles:
    """The files of one flight. format: who reads it; declaration: the flight.yaml, with what it says in `mapping`."""

    format: Literal["csv", "kitemill", "ampyx"]
    log: Path
    weather: Path | None = None
    declaration: Path | None = None
    mapping: FlightFile | None = None

    def opened(self) -> dict[str, Path]:
        """What each file is -> the file, of all that the reader opens."""
        files = {"log": self.log, "weather": self.weather, "declaration": self.declaration}
        return {what: file for what, file in files.items() if file is not None}


def find_flight(flight: Path) -> FlightFiles:
    """The files of the flight in the folder `flight`, or described by the YAML file `flight`. Raises BadInput where there is none."""
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
            return _declared(found[0]) if kind == "declared" else _of_format(kind, found[0])
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


def _declared(declaration: Path) -> FlightFiles:
    """What a flight.yaml describes."""
    mapping = read_document(declaration, FlightFile)
    return _of_format(mapping.format, _log_of(declaration, mapping), declaration, mapping)


def _of_format(kind: str, log: Path, declaration: Path | None = None, mapping: FlightFile | None = None) -> FlightFiles:
    return FlightFiles(kind, log, find_weather(log.parent) if kind == "kitemill" else None, declaration, mapping)


def _log_of(declaration: Path, mapping: FlightFile) -> Path:
    """The log: named, or the only one beside the declaration."""
    pattern = LOGS[mapping.format]
    if mapping.file is not None:
        path = declaration.parent / mapping.file
        if not path.is_file():
            near = [p.name for p in declaration.parent.glob(pattern)]
            cure = did_you_mean(mapping.file, near) if near else "Check the path."
            raise BadInput(f"there is no file {path}", f"{declaration}: file", cure)
        return path
    found = sorted(declaration.parent.glob(pattern))
    if len(found) != 1:
        what = f"there is no {pattern} beside it" if not found else f"several logs: {', '.join(p.name for p in found[:8])}"
        raise BadInput(what, str(declaration), "Say which one: `file: NAME`.")
    return found[0]
