"""What everything begins with: a flight and a kite, read from files and shown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from awescli.api.figures import Album, Picture
from awescli.api.shown import as_html, as_text, frame
from awescli.notation.errors import BadInput, did_you_mean

if TYPE_CHECKING:
    import polars

    from awescli.flightlog.log import FlightLog
    from awescli.flightlog.quality import DataQuality
    from awescli.physics.declaration import KiteDeclaration


@dataclass(frozen=True, eq=False)
class Flight:
    """A flight log, in SI units, radians, NED and FRD axes, on one uniform clock.

    path: the folder or flight.yaml that it was read from; log: its signals (`log["phi"]`, (N,)), clock, wind record and notes.
    """

    path: Path
    log: "FlightLog"
    keep: object = field(default=None, repr=False, compare=False)

    @cached_property
    def quality(self) -> "DataQuality":
        """What `awes check` says of it: channels, named checks, phases, loops."""
        from awescli.flightlog.quality import data_quality

        return data_quality(self.log)

    def to_frame(self) -> "polars.DataFrame":
        """One row a sample: time [s], every signal in SI units, `valid` (may it be fitted and scored?)."""
        return frame({"time": self.log.time, **self.log.measured, **self.log.inputs, "valid": self.log.valid})

    def plot(self, name: str | None = None) -> Picture:
        """A figure of the report, by name (`figures`): the path in space first."""
        return self._album.picture(name)

    @property
    def figures(self) -> tuple[str, ...]:
        """Names for `plot`."""
        return tuple(self._album.figures)

    @cached_property
    def _album(self) -> Album:
        def tell() -> list[Any]:
            from awescli.flightlog.loops import find_loops
            from awescli.flightlog.phases import phases
            from awescli.flightlog.quality import data_quality
            from awescli.flightlog.split import split
            from awescli.reporting.evidence import Evidence
            from awescli.reporting.flight import flight

            labels = phases(self.log)
            loops = find_loops(self.log, labels)
            parts = split(loops, log=self.log)
            return [flight(Evidence(self.log, loops, labels, data_quality(self.log, parts=parts), parts, scores={}, predictions={}))]

        return Album(tell)

    def _sentences(self) -> list[str]:
        q = self.quality
        bad = [c.name for c in q.checks if not c.ok]
        return [
            f"{len(self.log)} samples in {q.duration:.1f} s at {q.rate:.4g} Hz; {q.loops}",
            f"data: {'good' if q.ok else 'look at ' + ', '.join([*bad, *(['what is missing'] if q.missing else [])])}",
        ]

    def __repr__(self) -> str:
        return as_text(f"Flight {self.log.name}", self._sentences())

    def _repr_html_(self) -> str:
        rows = [{"signal": c.name, "unit": c.unit, "low": c.low, "high": c.high, "noise": c.noise} for c in self.quality.channels]
        return as_html(f"Flight {self.log.name}", self._sentences(), frame(rows))


@dataclass(frozen=True, eq=False)
class Kite:
    """A kite file: mass, geometry, aerodynamic terms, effects, and for every parameter value, bounds, unit, source and whether it is free.

    path: the file; declaration: what it says, checked.
    """

    path: Path
    declaration: "KiteDeclaration"
    keep: object = field(default=None, repr=False, compare=False)

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of its effects, in their order."""
        return self.declaration.effects

    def __getitem__(self, name: str) -> float:
        """The value of a parameter [its unit]. Raises BadInput for one that it has not."""
        return self._row(name).value

    def with_values(self, values: Mapping[str, float]) -> "Kite":
        """The same kite with other values of some parameters, in a temporary file; `write` keeps it."""
        rows = {name: self._row(name).model_copy(update={"value": float(value)}) for name, value in values.items()}
        parameters = {**self.declaration.parameters, **rows}
        return temporary_kite(self.declaration.model_copy(update={"parameters": parameters}))

    def write(self, file: str | Path) -> "Kite":
        """Write it as a kite file, and give back the kite of that file."""
        from awescli.artifacts import write_text
        from awescli.physics.declaration import kite_text

        write_text(Path(file), kite_text(self.declaration))
        return read_kite(file)

    def _row(self, name: str) -> Any:
        rows = self.declaration.parameters
        if name not in rows:
            raise BadInput(f"{self.declaration.name} has no parameter '{name}'", str(self.path), did_you_mean(name, rows))
        return rows[name]

    def to_frame(self) -> "polars.DataFrame":
        """One row a parameter: name, value, unit, bounds, free, prior standard deviation, source."""
        return frame({"parameter": name, **row.model_dump()} for name, row in self.declaration.parameters.items())

    def _sentences(self) -> Sequence[str]:
        rows = self.declaration.parameters.values()
        return [f"{len(rows)} parameters, {sum(row.free for row in rows)} free", f"effects: {', '.join(self.effects)}"]

    def __repr__(self) -> str:
        return as_text(f"Kite {self.declaration.name}", self._sentences())

    def _repr_html_(self) -> str:
        return as_html(f"Kite {self.declaration.name}", self._sentences(), self.to_frame())


def read_flight(path: str | Path) -> Flight:
    """The flight log in a folder (Kitemill, Ampyx AP2, UMN, PX4, ArduPilot) or of a flight.yaml that maps any CSV.

    Raises BadInput for what cannot be read: what, where, what to do.
    """
    from awescli.flightlog.read import read_flight as read

    return Flight(Path(path), read(Path(path)))


def read_kite(path: str | Path) -> Kite:
    """The kite of a kite file. Raises BadInput, with file and line, for every mistake in it."""
    from awescli.physics.declaration import read_kite as read

    return Kite(Path(path), read(Path(path)))


def temporary_kite(declaration: "KiteDeclaration") -> Kite:
    """A kite whose file goes when nobody needs it any more."""
    from awescli.artifacts import write_text
    from awescli.physics.declaration import kite_text

    folder = TemporaryDirectory(prefix="awes-")
    path = Path(folder.name) / "kite.yaml"
    write_text(path, kite_text(declaration))
    return Kite(path, read_kite(path).declaration, folder)
