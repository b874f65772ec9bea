"""How units are written in headers and by hand: `knots`, `m s-1`, `lbs` -> the units of `units.py`."""

import re
from functools import cache

from awescli.flightlog.units import VOCABULARY
from awescli.notation.errors import did_you_mean

SPELLINGS: dict[str, str] = {
    "m": "meter meters metre metres mtr", "cm": "centimeter centimeters", "mm": "millimeter millimeters", "km": "kilometer kilometers",
    "ft": "foot feet '", "yd": "yard yards", "mi": "mile miles", "nmi": "nm nautical-mile nautical-miles",
    "deg": "degs degree degrees ° grd", "rad": "radian radians rads", "grad": "gon",
    "deg/s": "dps deg/sec degree/s degrees/s deg-s degs °/s degps deg/second degrees/sec",
    "rad/s": "rads rad/sec radian/s radians/s rad-s radps rps radians/sec", "rpm": "rev/min 1/min u/min",
    "1/s": "hz", "rev/s": "rps", "%": "percent pct",
    "m/s": "mps m-s ms m/sec meter/s meters/s metres/s m-s-1 ms-1 m*s-1", "cm/s": "cmps cms cm/sec", "mm/s": "mmps mms",
    "km/h": "kmh kph km-h kmph kmh-1", "kt": "kts knot knots ktas kias kcas keas", "mph": "miles/h miles/hour",
    "ft/s": "fps ftps ft-s fts ft/sec feet/s f/s", "ft/min": "fpm ftpm feet/min",
    "m/s2": "m/s^2 m/s/s mps2 ms2 m-s2 m/s**2 mss ms-2 m/s² m/sec2 m/sec^2", "g": "gee gees gs", "ft/s2": "ft/s^2 fps2 ft/s/s fts2",
    "N": "newton newtons", "kN": "kilonewton kilonewtons", "daN": "dekanewton decanewton", "kgf": "kg kp kilopond kgs",
    "lbf": "lb lbs pound pounds lb-f",
    "s": "sec secs second seconds", "ms": "msec msecs millisecond milliseconds millis",
    "us": "usec usecs microsecond microseconds µs micros",
    "ns": "nsec nanosecond nanoseconds nanos", "min": "minute minutes", "h": "hour hours hr hrs",
    "kg/m3": "kg/m^3 kgm3 kg/m**3 kgm-3 kg-m3 kg/m³", "slug/ft3": "slug/ft^3 slugs/ft3 slug-ft3 slugft3",
    "K": "kelvin", "degC": "c °c celsius deg-c degc", "degF": "f °f fahrenheit deg-f degf",
    "Pa": "pascal", "hPa": "hectopascal", "mbar": "mb millibar", "inHg": "inhg in-hg",
}  # fmt: skip
"""Unit -> other spellings, apart by spaces; where several units share a spelling, what is measured decides."""


def units_spelled(text: str) -> list[str]:
    """Every unit that `text` may mean, the likeliest first: `ms` is milliseconds or metres per second."""
    plain = text.strip().strip("[](){}<>").strip()
    if plain in VOCABULARY:
        return list(dict.fromkeys([plain, *_table().get(_flat(plain), ())]))
    return list(_table().get(_flat(plain), ()))


def known_unit(text: str) -> str:
    """The unit that `text` stands for; raises ValueError with the nearest one."""
    if found := units_spelled(text):
        return found[0]
    raise ValueError(f"unknown unit '{text}'. {did_you_mean(text, VOCABULARY)}")


def _flat(text: str) -> str:
    """Lower case, without what is written in a dozen ways: spaces, dots, underscores, stars, `per`."""
    text = re.sub(r"\bper\b", "/", text.lower())
    return re.sub(r"[\s_.*·]+", "", text)


@cache
def _table() -> dict[str, tuple[str, ...]]:
    found: dict[str, list[str]] = {}
    for unit in VOCABULARY:
        for spelling in (unit, *SPELLINGS.get(unit, "").split()):
            # `m-s` in the table is `m_s` or `m s` in a header; `m/s` may lose its stroke there
            for flat in dict.fromkeys((_flat(spelling), _flat(spelling.replace("-", "")), _flat(spelling.replace("/", "")))):
                rows = found.setdefault(flat, [])
                if unit not in rows:
                    rows.append(unit)
    return {flat: tuple(units) for flat, units in found.items()}
