"""Flights that a stage takes beside the plan's: how they are declared, what is refused of them, and reading them."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import Field

from awescli.notation.errors import BadInput
from awescli.stages.base import Context, Inputs, StageConfig

if TYPE_CHECKING:
    from awescli.physics.declaration import KiteDeclaration
    from awescli.stages.identify import IdentifyConfig
    from awescli.stages.trace_residual import TraceResidualConfig


class FurtherFlight(StageConfig):
    """A flight that is fitted together with the plan's."""

    flight: Path = Field(description="folder of the flight log")
    kite: Path | None = Field(
        None, description="its own kite file, where wind record, noise or fixed values differ; free parameters are declared by the plan's"
    )


def refused_flights(
    inputs: Inputs, also: Sequence[FurtherFlight], outputs: Sequence[str] | None, closed: bool = False
) -> Iterator[tuple[str, BadInput]]:
    """(key, mistake) of `also`; closed: surfaces that the fitted controller moves are channels too."""
    from awescli.flightlog.read import read_flight
    from awescli.stages.flight_parts import unknown_channels

    for i, other in enumerate(also):
        try:
            further = read_flight(other.flight)
            inputs.parts_of(further, other.flight)
        except BadInput as e:
            yield f"also.{i}.flight", BadInput(str(e))
        else:
            yield from unknown_channels(further, outputs, f"also.{i}.flight", closed)
        if other.kite is not None:
            try:
                same_kite(inputs.declared, other.kite)
            except BadInput as e:
                yield f"also.{i}.kite", BadInput(str(e))


def flights_of(context: Context, also: Sequence[FurtherFlight], declared: "KiteDeclaration") -> list[tuple]:
    """(log, parts, kite, label) of the plan's flight and of those of `also`; labels tell flights of one name apart, the plan's is ""."""
    from awescli.stages.flight_parts import flight_parts

    flights, names = [], []
    for i, (folder, file) in enumerate([(context.flight, None), *((f.flight, f.kite) for f in also)]):
        log, parts = flight_parts(context, folder)
        label = f"{log.name}-{names.count(log.name) + 1}" if log.name in names else log.name
        names.append(log.name)
        flights.append((log, parts, same_kite(declared, file) if file else declared, label if i else ""))
    return flights


def unknown_own(declared: "KiteDeclaration", config: "IdentifyConfig | TraceResidualConfig") -> Iterator[tuple[str, BadInput]]:
    """(key, mistake) of `per_flight`: patterns of no free parameter, or nothing to tell apart."""
    from fnmatch import fnmatchcase

    from awescli.notation.errors import did_you_mean

    free = [name for name, row in declared.parameters.items() if row.free]
    for pattern in config.per_flight:
        if not any(fnmatchcase(name, pattern) for name in free):
            yield "per_flight", BadInput(f"no free parameter is called '{pattern}'", do=did_you_mean(pattern, free))
    if config.per_flight and not config.also:
        yield "per_flight", BadInput("there is only one flight", do="Name further flights under `also`, or drop this key.")


def same_kite(declared: "KiteDeclaration", file: Path) -> "KiteDeclaration":
    """The kite of `file` with the free parameters of `declared`. Raises BadInput where it is another kite."""
    from awescli.physics.declaration import read_kite

    other = read_kite(file)
    for what in ("aerodynamics", "effects", "tether"):
        if getattr(other, what) != getattr(declared, what):
            raise BadInput(f"its {what} differ from the plan's kite", str(file), "Flights that are fitted together are of one kite.")
    free = {name: row for name, row in declared.parameters.items() if row.free}
    fixed = {name: row.model_copy(update={"free": False}) for name, row in other.parameters.items()}
    return other.model_copy(update={"parameters": {**fixed, **free}, "constraints": declared.constraints})
