"""A draft as the text of a flight.yaml: one line an entry, with what it is and how it was found; what is missing as a commented line."""

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from awescli.flightlog.drafting.draft import Draft
from awescli.flightlog.drafting.pool import Entry
from awescli.flightlog.drafting.weather import Weather
from awescli.flightlog.motion import FRAMES
from awescli.notation.present import present
from awescli.notation.quantities import IN_WORDS, UNITS

VECTORS = {"position": ("p_n", "p_e", "p_d"), "velocity": ("v_n", "v_e", "v_d")}
WORDS_OF_YAML = ("true", "false", "null", "yes", "no", "on", "off", "nan", "n", "y")
"""Words that some reader of YAML takes for something else than text."""
PARTS = {
    "direction": "where the wind comes from, clockwise from north", "speed": "horizontal wind speed", "density": "air density",
    "height": "height above the winch", "temperature": "of the air", "pressure": "static, at the station",
}  # fmt: skip


def draft_text(draft: Draft, folder: Path) -> str:
    """The flight.yaml of a draft, to lie in `folder`."""
    clock = present(draft.time, "the clock of a drafted log")
    lines = [
        "# Drafted by `awes init` from the header and the numbers of the log: value = (sign * scale * column + offset) in unit.",
        "# Read what says CHECK or ASSUMED. A line that begins with # and a quantity was not found: complete it and remove the #.",
        "# `awes check` says what this file gives, `awes schema` every key that it may have.",
        f"file: {_quoted(os.path.relpath(draft.log.resolve(), folder.resolve()))}",
        f"time: {_flow({'column': clock.column, 'unit': clock.unit})}{_comment(clock.why)}",
    ]
    lines += [f"# {note}" for note in draft.notes]
    signals = dict(draft.signals)
    for name, quantities in VECTORS.items():
        frame = draft.velocity_frame if name == "velocity" else ""
        if (line := _vector(name, signals, quantities, frame)) is not None:
            lines.append(line)
            signals = {n: e for n, e in signals.items() if n not in quantities}
    lines += _position(draft)
    if draft.rest.accelerations is not None:
        columns, unit, measures = draft.rest.accelerations
        row = {"columns": list(columns), "unit": unit, "frame": "BODY", "measures": measures}
        lines.append(f"acceleration: {_flow(row)}{_comment(*draft.rest.notes)}")
    lines.append("signals:" if signals else "signals: {}")
    lines += [f"  {name}: {_entry(line)}{_comment(IN_WORDS[name], line.why, _assumed(line))}" for name, line in signals.items()]
    lines += _left(draft)
    lines += _needed(draft)
    lines += _wind(draft, folder)
    if draft.unused:
        lines += ["# Columns of which nothing was made:", *(f"#   {_clean(name)}" for name in draft.unused)]
    return "\n".join(lines) + "\n"


def _vector(name: str, signals: Mapping[str, Entry], quantities: Sequence[str], frame: str) -> str | None:
    """One line for three columns of one unit in one frame; None where they need a line each."""
    found = [signals[q] for q in quantities if q in signals]
    if len(found) < len(quantities) or any(e.offset or e.scale != 1.0 for e in found) or len({e.unit for e in found}) > 1:
        return None
    for known in ("NED", "ENU"):
        axes = FRAMES[known]
        if all(e.sign == sign for e, (_, sign) in zip(found, axes, strict=True)):
            columns = [""] * 3
            for e, (i, _) in zip(found, axes, strict=True):
                columns[i] = e.column
            row = {"columns": columns, "unit": found[0].unit, "frame": "BODY" if frame == "BODY" else known}
            what = "position from the winch" if name == "position" else "velocity over ground"
            return f"{name}: {_flow(row)}{_comment(what, _assumed(found[0]))}"
    return None


def _position(draft: Draft) -> Iterator[str]:
    """A position by angles or by latitude, longitude and altitude."""
    if not draft.position:
        return
    geodetic = "position.latitude" in draft.position
    # without its origin the whole block is not yet one
    off = "# " if geodetic and draft.origin is None else ""
    yield f"{off}position:"
    for name, line in draft.position.items():
        yield f"{off}  {name.removeprefix('position.')}: {_entry(line)}{_comment(line.why, _assumed(line))}"
    if geodetic:
        lat, lon, alt = draft.origin or ("...", "...", "...")
        note = "where the winch stands: deg, deg, m" + ("; NEEDED by a model" if draft.origin is None else "")
        yield f"{off}  origin: {{latitude: {lat}, longitude: {lon}, altitude: {alt}}}{_comment(note)}"


def _left(draft: Draft) -> Iterator[str]:
    """Columns with a meaning that were not mapped, and why."""
    for name, column, why in draft.rest.left:
        if name == "acceleration":
            yield f"# acceleration, {column}: {why}"
        else:
            yield f"  # {name}: {{column: {_quoted(column)}, unit: ...}}{_comment(IN_WORDS[name], why)}"


def _needed(draft: Draft) -> Iterator[str]:
    listed = {name for name, _, _ in draft.rest.left}
    for name in draft.needed:
        if name not in listed and name in UNITS:
            yield f"  # {name}: {{column: ..., unit: {UNITS[name]}}}{_comment(f'NEEDED by a model: {IN_WORDS[name]}')}"


def _wind(draft: Draft, folder: Path) -> Iterator[str]:
    """The wind block, or what is missing of it."""
    wind, off = draft.weather or Weather(), ""
    if "wind" in draft.needed:
        yield "# NEEDED by a model: the wind, its direction (where it comes from) and speed, of the log or of a file beside it"
        off = "# "
    yield f"{off}wind:"
    if wind.file is not None or off:
        path = "weather.csv" if wind.file is None else os.path.relpath(wind.file.resolve(), folder.resolve())
        yield f"{off}  file: {_quoted(path)}{_comment('Kitemill weather format' if wind.kitemill else 'a CSV of its own')}"
    if wind.kitemill:
        return
    if wind.time is not None:
        yield f"{off}  time: {_flow({'column': wind.time.column, 'unit': wind.time.unit})}{_comment(wind.time.why)}"
    elif off:
        yield f"{off}  time: {{column: ..., unit: s}}"
    entries = wind.entries or {}
    for part, line in entries.items():
        yield f"{off}  {part}: {_entry(line)}{_comment(PARTS[part], line.why, _assumed(line))}"
    for part in ("direction", "speed"):
        if part not in entries:
            yield f"{off}  {part}: {{column: ..., unit: {'deg' if part == 'direction' else 'm/s'}}}{_comment(PARTS[part])}"
    if "height" not in entries:
        yield f"{off}  height: 10.0{_comment('ASSUMED: height of the station above the winch [m]')}"
    if not {"density", "temperature"} & set(entries):
        note = _comment("air density; without it 1.225 kg/m3 is taken")
        yield f"{'#   ' if off else '  # '}density: {{column: ..., unit: kg/m3}}{note}"
    for part, column, why in wind.left:
        yield f"  # {part}, {column}: {why}"
    yield from (f"# {note}" for note in wind.notes)


def _assumed(line: Entry) -> str:
    return f"ASSUMED: {line.assumed}" if line.assumed else ""


def _entry(line: Entry) -> str:
    row = {"column": line.column, "unit": line.unit}
    further = (("sign", line.sign, 1), ("scale", line.scale, 1.0), ("offset", line.offset, 0.0))
    return _flow(row | {key: value for key, value, null in further if value != null})


def _flow(row: Mapping[str, object]) -> str:
    return "{" + ", ".join(f"{key}: {_value(value)}" for key, value in row.items()) + "}"


def _value(value: object) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    return _quoted(value) if isinstance(value, str) else f"{value:.9g}" if isinstance(value, float) else str(value)


def _quoted(text: str) -> str:
    """Plain where YAML reads it as text, else in quotes."""
    plain = re.fullmatch(r"[A-Za-z_./][A-Za-z0-9_./^-]*", text) and text.lower() not in WORDS_OF_YAML
    return text if plain else json.dumps(text, ensure_ascii=False)


def _comment(*parts: str) -> str:
    """What stands behind a line."""
    said = _clean("; ".join(p for p in parts if p))
    return f"    # {said}" if said else ""


def _clean(text: str) -> str:
    """Control characters of a header stay out of the file."""
    return "".join(c for c in re.sub(r"\s+", " ", text) if c.isprintable())
