"""What a column's header says: a quantity, a unit, a sign. `VN(ft/s)`, `Alt [ft]`, `airspeed_kt`, `gyro_x`, `rudder_cmd`."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from awescli.flightlog.unit_words import units_spelled
from awescli.flightlog.units import DIMENSION_OF_SI, VOCABULARY
from awescli.notation.names import Meaning, meanings, words
from awescli.notation.quantities import UNITS

SI = {
    **UNITS, "time": "s", "position.latitude": "rad", "position.longitude": "rad", "position.elevation": "rad", "position.azimuth": "rad",
    "position.distance": "m", **{f"position.{a}": "m" for a in "xyz"}, **{f"velocity.{a}": "m/s" for a in "xyzuvw"},
    "wind.direction": "rad", "wind.speed": "m/s", "wind.density": "kg/m3", "wind.temperature": "K", "wind.pressure": "Pa",
    "wind.height": "m",
}  # fmt: skip
"""Everything that a header may name -> its SI unit."""

_BRACKETS = re.compile(r"^(.*?)[\[(<{]\s*([^\])>}]*?)\s*[\])>}]\s*$")
LONGEST_UNIT = 4
"""Words at the end of a header that may be its unit: `kg_per_m_3`."""


@dataclass(frozen=True)
class Reading:
    """One way to read a header: the column, what it means, the unit that it names (None where it names none)."""

    column: str
    meaning: Meaning
    unit: str | None

    @property
    def quantity(self) -> str:
        return self.meaning.quantity

    @property
    def rank(self) -> tuple[int, int, int]:
        """Smaller is likelier: nothing dropped, a unit named, a command where commands are wanted."""
        return self.meaning.idle, self.meaning.reached, self.unit is None


def readings(column: str, weather: bool = False) -> list[Reading]:
    """All readings of a header, the likeliest first; weather: in a file that holds weather only."""
    found = []
    for name, units in _parses(column):
        for meaning in meanings(name, weather):
            dimension = DIMENSION_OF_SI[SI[meaning.quantity]]
            fitting = [u for u in units or () if VOCABULARY[u][0] == dimension]
            if units is None or fitting:
                found.append(Reading(column, meaning, fitting[0] if fitting else None))
    first: dict[str, Reading] = {}
    for reading in sorted(found, key=lambda r: r.rank):
        first.setdefault(reading.quantity, reading)
    return list(first.values())


def _parses(column: str) -> Iterator[tuple[tuple[str, ...], Sequence[str] | None]]:
    """(words of the name, units that the rest may mean; None where there is no rest) of every way to cut a header."""
    match = _BRACKETS.match(column)
    if match and match[1].strip() and (units := units_spelled(match[2])):
        yield from ((words(part), units) for part in _tails(match[1]))
        return
    for part in _tails(column):
        whole = words(part)
        yield whole, None
        for count in range(1, min(LONGEST_UNIT, len(whole) - 1) + 1):
            if units := units_spelled("".join(whole[-count:])):
                yield whole[:-count], units


def _tails(text: str) -> Iterator[str]:
    """The text, and what stands behind its last `/` or `.`: loggers put the message's name first."""
    yield text
    tail = re.split(r"[/.:]", text)[-1]
    if tail != text and tail.strip():
        yield tail
