"""The columns of a log with what their headers may mean, and the entries that a draft is made of."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from awescli.flightlog.drafting.headers import SI, Reading, readings
from awescli.flightlog.table import read_header, read_table
from awescli.flightlog.text_stamps import ISO, read_stamps
from awescli.flightlog.units import VOCABULARY, factor_to_si, units_of, zero_of
from awescli.notation.errors import BadInput

MOST = 400
"""Columns of which a meaning is looked for: a log of more is a dump of everything, and is still read for those."""


@dataclass(frozen=True)
class Entry:
    """One line of the draft: value = (sign * scale * column + offset) in `unit`; why: how it was found; assumed: what no header says."""

    column: str
    unit: str
    sign: int = 1
    scale: float = 1.0
    offset: float = 0.0
    why: str = ""
    assumed: str = ""

    def si(self, values: np.ndarray, si_unit: str) -> np.ndarray:
        """The column's values (N,) in SI."""
        if self.unit == ISO:
            return values
        return (self.sign * self.scale * values + self.offset + zero_of(self.unit)) * factor_to_si(self.unit, si_unit)


@dataclass(frozen=True)
class Pool:
    """Columns of numbers, (N,) each, and the readings of their headers; text: columns that hold no numbers, clocks written as text among
    them (their values are seconds)."""

    path: Path
    values: dict[str, np.ndarray]
    read: dict[str, list[Reading]]
    text: tuple[str, ...] = ()
    header: tuple[str, ...] = field(default=())

    def of(self, quantity: str) -> list[Reading]:
        """The columns that may be a quantity, the likeliest first."""
        found = [r for column in self.values for r in self.read[column] if r.quantity == quantity]
        return sorted(found, key=lambda r: (*r.rank, self.header.index(r.column)))

    def best(self, quantity: str) -> Reading | None:
        """The likeliest column that holds more than one value; None where there is none."""
        return next((r for r in self.of(quantity) if _varies(self.values[r.column])), None)

    def all(self, quantities: Iterable[str]) -> list[Reading] | None:
        """The likeliest column of each, or None if one has none."""
        found = [self.best(q) for q in quantities]
        there = [reading for reading in found if reading is not None]
        return there if len(there) == len(found) else None

    def stack(self, chosen: Sequence[Reading], rows: np.ndarray) -> np.ndarray:
        """(n, K) of several columns, with the signs of their names, in their own units."""
        return np.array([r.meaning.sign * self.values[r.column][rows] for r in chosen])


def pool_of(path: Path, weather: bool = False) -> Pool:
    """The columns of a CSV that may mean something. Raises BadInput where it is no CSV."""
    _, header = read_header(path)
    once = [name for name in header if header.count(name) == 1][:MOST]
    read = {name: found for name in once if (found := readings(name, weather))}
    values, text = {}, []
    try:
        values = dict(read_table(path, read).columns)
    except BadInput:
        for name in read:
            try:
                values |= read_table(path, [name]).columns
            except BadInput:
                text.append(name)
                # a clock may be written as text
                if any(r.quantity == "time" for r in read[name]) and (stamps := _stamps(path, name)) is not None:
                    values[name] = stamps
        if not values:
            raise
    return Pool(path, values, read, tuple(text), header)


def _stamps(path: Path, name: str) -> np.ndarray | None:
    try:
        return read_stamps(path, name)
    except BadInput:
        return None


def entry(reading: Reading, unit: str, why: str = "", **how: Any) -> Entry:
    """The entry of a column, with the sign that its name gives it."""
    return Entry(reading.column, unit, reading.meaning.sign, why=why, **how)


def also(*parts: str) -> str:
    """Reasons in one line."""
    return "; ".join(p for p in parts if p)


def units_for(reading: Reading, usual: Sequence[str]) -> tuple[str, ...]:
    """Units to try: the one in the header, else the usual ones."""
    return (reading.unit,) if reading.unit else tuple(u for u in usual if u in units_of(SI[reading.quantity]))


def factor(unit: str) -> float:
    """To SI."""
    return VOCABULARY[unit][1]


def high(values: np.ndarray) -> float:
    """The size that 99.5 % of the values stay below; a few broken cells decide nothing."""
    known = np.abs(values[np.isfinite(values)])
    return float(np.percentile(known, 99.5)) if known.size else 0.0


def _varies(values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size > 2 and np.ptp(known) > 0)
