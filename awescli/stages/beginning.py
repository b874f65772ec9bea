"""What `awes init` writes: a plan, a flight.yaml for a log of unknown layout, a kite file to fill in; and what is to be said of them."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from awescli.notation.errors import BadInput, BadInputs
from awescli.notation.quantities import CONTROL_SURFACES as SURFACES
from awescli.notation.quantities import OF_LINE
from awescli.stages.base import Stage

PLAN, FLIGHT, KITE = "stages.yaml", "flight.yaml", "kite.yaml"


@dataclass(frozen=True)
class Beginning:
    """files: name -> text, to be written into the folder; found: quantity -> how the log's column is read; findings: title -> sentences."""

    files: Mapping[str, str]
    found: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    findings: Mapping[str, Sequence[str]] = field(default_factory=dict)


def begin(folder: Path, flight: Path, kite: Path | None, stages: Sequence[Stage]) -> Beginning:
    """The files of a new plan in `folder`. flight: a folder, a log, or a flight.yaml; kite: None to get one to fill in.

    Raises BadInput where the flight is nothing that could be read, or the kite file is none.
    """
    from awescli.stages.starter import starter_text

    if (folder / PLAN).exists():
        raise _there_already(folder / PLAN)
    log, surfaces, on_line = _log_to_draft(flight), SURFACES, True
    files, found, findings = {}, {}, {}
    if log is not None:
        files[FLIGHT], found, findings = _drafted(log, folder)
        surfaces = tuple(s for s in SURFACES if s in found) or SURFACES
        on_line = not found or any(name in found for name in OF_LINE)
    of_flight = FLIGHT if FLIGHT in files else _from(folder, _readable(flight))
    if kite is None:
        from awescli.physics.kite_template import kite_template

        files[KITE] = kite_template(surfaces, on_line)
        findings["kite.yaml"] = [f"{files[KITE].count('value: fill_in')} numbers to fill in; awes check names them"]
    else:
        findings |= _still_open(kite)
    files[PLAN] = starter_text(stages, of_flight, KITE if kite is None else _from(folder, kite))
    for name in files:
        if (folder / name).exists():
            raise _there_already(folder / name)
    return Beginning(files, found, findings)


def _there_already(file: Path) -> BadInput:
    return BadInput("is there already and is not overwritten", str(file), "Choose another folder, or move it away.")


def _from(folder: Path, path: Path) -> str:
    """The path as it is written in a file of the folder."""
    return str(path) if path.is_absolute() else os.path.relpath(path.resolve(), folder.resolve())


def _readable(flight: Path) -> Path:
    """What the plan calls the flight: a folder, or the flight.yaml itself."""
    return flight if flight.is_dir() or flight.suffix in (".yaml", ".yml") else flight.parent


def _log_to_draft(flight: Path) -> Path | None:
    """The CSV of unknown layout that needs a flight.yaml; None where the flight is readable as it is."""
    from awescli.flightlog.drafting.weather import weather_files
    from awescli.flightlog.files import PATTERNS

    if not flight.exists():
        raise BadInput("there is no such file or folder", f"--flight {flight}", "Name the flight log, or its folder.")
    if flight.is_file():
        return flight if flight.suffix.lower() == ".csv" and not _kitemill_folder(flight) else None
    for pattern, _ in PATTERNS:
        if (there := sorted(flight.glob(pattern))) and (pattern != "kite.csv" or _kitemill_folder(there[0])):
            return None
    weather = set(weather_files(flight, None))
    logs = [p for p in sorted(flight.glob("*.csv")) if p not in weather] or sorted(flight.glob("*.csv"))
    if not logs:
        there = ", ".join(sorted(p.name for p in flight.iterdir())[:12]) or "nothing"
        raise BadInput("no flight log is in this folder", f"--flight {flight}", f"There is: {there}. Name the log's file.")
    # of several the log is the longest; `file` in flight.yaml names another
    return max(logs, key=lambda p: p.stat().st_size)


def _kitemill_folder(log: Path) -> bool:
    """Is this a Kitemill log under its own name, which needs no flight.yaml?"""
    from awescli.flightlog.kitemill_csv import is_kitemill
    from awescli.flightlog.table import read_header

    return log.name == "kite.csv" and is_kitemill(read_header(log)[1])


def _drafted(log: Path, folder: Path) -> tuple[str, dict, dict]:
    """(text of flight.yaml, found, findings)"""
    from awescli.flightlog.drafting.draft import draft
    from awescli.flightlog.drafting.text import draft_text
    from awescli.flightlog.drafting.weather import weather_files
    from awescli.flightlog.kitemill_csv import is_kitemill
    from awescli.flightlog.table import read_header
    from awescli.notation.quantities import IN_WORDS

    if is_kitemill(read_header(log)[1]):
        name = os.path.relpath(log.resolve(), folder.resolve())
        return f"# A log in Kitemill's columns under another name.\nformat: kitemill\nfile: {name}\n", {}, {}
    drafted = draft(log, weather_files(log.parent, log))
    wind = drafted.weather
    entries = {**drafted.position, **drafted.signals, **{f"wind {p}": e for p, e in ((wind.entries or {}) if wind else {}).items()}}
    found = {
        name: {"column": e.column, "unit": e.unit, "sign": "-" if e.sign < 0 else "", "": "assumed" if e.assumed else ""}
        for name, e in {"time": drafted.time, **entries}.items()
    }
    needs_words = {**IN_WORDS, "wind": "direction and speed, of the log or a file beside it"}
    findings = {
        "to be checked": [n.removeprefix("CHECK: ") for n in drafted.doubtful],
        "not mapped": [f"{name}, column {column}: {why}" for name, column, why in (*drafted.rest.left, *(wind.left if wind else ()))],
        "a model still needs": [f"{name}: {needs_words[name]}" for name in drafted.needed],
    }
    return draft_text(drafted, folder), found, {k: v for k, v in findings.items() if v}


def _still_open(kite: Path) -> dict[str, list[str]]:
    """What is to be said of a kite file that has numbers to fill in. Raises one BadInput for a file that is no kite file."""
    from awescli.notation.document import open_document
    from awescli.physics.declaration import read_kite
    from awescli.physics.unfilled import unfilled

    if not kite.is_file():
        raise BadInput("there is no such file", f"--kite {kite}", "Name the kite's YAML file, or leave --kite out for one to fill in.")
    try:
        read_kite(kite)
    except BadInput as e:
        mistakes, open_numbers = len(e.errors) if isinstance(e, BadInputs) else 1, len(unfilled(open_document(kite))[1])
        if mistakes == open_numbers:
            return {str(kite): [f"{open_numbers} numbers to fill in; awes check names them"]}
        first = e.errors[0] if isinstance(e, BadInputs) else e
        others = f" ({mistakes - 1} further mistakes)" if mistakes > 1 else ""
        do = f"{first.do} Leave --kite out for a kite file to fill in.".strip()
        raise BadInput(f"{first.what}{others}", first.where, do) from None
    return {}
