"""What people call the quantities of a flight: words of log headers and of other programs -> the names of `quantities.py`, in one place.

Names are compared without case, spaces and punctuation, so that `Roll Rate`, `roll_rate` and `rollRate` are one name.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache

from awescli.notation.errors import did_you_mean
from awescli.notation.quantities import CONTROL_SURFACES, INPUTS

PHRASES: dict[str, tuple[str, ...]] = {
    "p_n": ("north", "pos n", "pos north", "position n", "position north", "north position", "p n", "p north", "r n", "ned n", "x north"),
    "p_e": ("east", "pos e", "pos east", "position e", "position east", "east position", "p e", "p east", "r e", "ned e", "y east"),
    "p_d": ("down", "pos d", "pos down", "position d", "position down", "down position", "p d", "p down", "r d", "ned d", "z down"),
    "-p_d": (
        "altitude", "alt", "height", "up", "pos u", "pos up", "position up", "z up", "enu u", "agl", "msl", "alt agl", "alt msl",
        "altitude agl", "altitude msl", "altitude amsl", "height above ground", "hgt", "elevation above ground", "baro alt", "relative alt",
    ),
    "-p_n": ("south", "pos south"),
    "-p_e": ("west", "pos west"),
    "v_n": ("v n", "vel n", "vel north", "velocity n", "velocity north", "north velocity", "speed north", "north speed", "v north"),
    "v_e": ("v e", "vel e", "vel east", "velocity e", "velocity east", "east velocity", "speed east", "east speed", "v east"),
    "v_d": (
        "v d", "vel d", "vel down", "velocity d", "velocity down", "down velocity", "speed down", "down speed", "v down",
        "sink rate", "sink", "sink speed", "descent rate",
    ),
    "-v_d": (
        "v u", "v up", "vel u", "vel up", "velocity u", "velocity up", "up velocity", "speed up", "up speed", "climb", "climb rate",
        "vertical speed", "vertical velocity", "vario", "rate of climb", "roc",
    ),
    "phi": ("roll", "roll angle", "bank", "bank angle", "phi", "euler x", "euler roll", "roll x"),
    "theta": ("pitch", "pitch angle", "theta", "euler y", "euler pitch", "nick"),
    "psi": ("yaw", "yaw angle", "heading", "hdg", "psi", "true heading", "heading true", "euler z", "euler yaw", "heading angle"),
    "p": (
        "p", "roll rate", "roll speed", "gyro x", "gyr x", "g x", "omega x", "w x", "rate x", "body rate x", "angular velocity x",
        "ang vel x", "angular rate x", "gyroscope x", "rate p", "p rate", "roll dot", "rot x", "p body", "omega p",
    ),
    "q": (
        "q", "pitch rate", "pitch speed", "gyro y", "gyr y", "g y", "omega y", "w y", "rate y", "body rate y", "angular velocity y",
        "ang vel y", "angular rate y", "gyroscope y", "rate q", "q rate", "pitch dot", "rot y", "q body", "omega q",
    ),
    "r": (
        "r", "yaw rate", "yaw speed", "gyro z", "gyr z", "g z", "omega z", "w z", "rate z", "body rate z", "angular velocity z",
        "ang vel z", "angular rate z", "gyroscope z", "rate r", "r rate", "yaw dot", "rot z", "r body", "omega r",
    ),
    "a_x": ("a x", "acc x", "accel x", "acceleration x", "acceleration forward", "acc forward", "imu a x", "body acc x", "lin acc x"),
    "a_y": ("a y", "acc y", "accel y", "acceleration y", "acceleration right", "acc right", "imu a y", "body acc y", "lin acc y"),
    "a_z": ("a z", "acc z", "accel z", "acceleration z", "acceleration down", "acc down", "imu a z", "body acc z", "lin acc z"),
    "V_a": (
        "airspeed", "air speed", "v a", "v air", "tas", "true airspeed", "eas", "ias", "cas", "pitot", "pitot speed", "pitot airspeed",
        "apparent wind speed", "v tas", "v app", "apparent speed",
    ),
    "alpha": ("alpha", "aoa", "angle of attack", "alfa"),
    "beta": ("beta", "aos", "sideslip", "side slip", "sideslip angle", "angle of sideslip", "ssa"),
    "tension": (
        "tension", "tether tension", "line tension", "cable tension", "rope tension", "tether force", "line force", "cable force",
        "rope force", "force", "load", "load cell", "tether load", "line load", "pull", "pull force", "winch force", "winch tension",
        "kite force", "load force",
    ),
    "aileron": ("aileron", "ailerons", "ail", "delta a", "d a"),
    "elevator": ("elevator", "elev", "ele", "delta e", "d e"),
    "rudder": ("rudder", "rud", "delta r", "d r"),
    "flaps": ("flaps", "flap", "delta f", "d f"),
    "throttle": ("throttle", "thr", "power lever", "motor command", "delta t", "motor throttle"),
    "motor_speed": (
        "motor speed", "motor rpm", "rpm", "prop speed", "prop rpm", "propeller speed", "propeller rpm", "esc rpm", "engine rpm",
    ),
    "tether_length": (
        "tether length", "line length", "cable length", "rope length", "length", "l t", "line out", "tether out", "cable out", "paid out",
        "payout", "drum length", "reeled out", "reeled out length", "winch length", "winch position", "unrolled length", "line paid out",
    ),
    "reel_out_speed": (
        "reel out speed", "reel speed", "reeling speed", "winch speed", "line speed", "tether speed", "cable speed", "rope speed",
        "payout speed", "reel out velocity", "tether velocity", "winch velocity", "line velocity", "reel out rate", "line rate",
        "tether reel out speed", "v reel", "v t", "drum speed",
    ),
    "-reel_out_speed": ("reel in speed", "reel in rate", "reel in velocity"),
}  # fmt: skip
"""Quantity -> what it is called; a minus sign before the quantity: what counts the other way, with `sign: -1`."""

PARTS: dict[str, tuple[str, ...]] = {
    "position.x": ("x", "pos x", "position x", "p x", "local x", "x pos", "x position"),
    "position.y": ("y", "pos y", "position y", "p y", "local y", "y pos", "y position"),
    "position.z": ("z", "pos z", "position z", "p z", "local z", "z pos", "z position"),
    "velocity.x": ("v x", "vel x", "velocity x", "x dot", "speed x", "x vel", "x velocity", "x speed"),
    "velocity.y": ("v y", "vel y", "velocity y", "y dot", "speed y", "y vel", "y velocity", "y speed"),
    "velocity.z": ("v z", "vel z", "velocity z", "z dot", "speed z", "z vel", "z velocity", "z speed"),
    "velocity.u": ("u", "u velocity", "vel u body", "velocity forward", "forward velocity"),
    "velocity.v": ("v", "v velocity", "vel v body", "velocity right", "right velocity"),
    "velocity.w": ("w", "w velocity", "vel w body", "velocity down body"),
    "position.latitude": ("lat", "latitude", "gps lat", "lati"),
    "position.longitude": ("lon", "lng", "long", "longitude"),
    "position.elevation": ("elevation", "elevation angle", "el", "elev angle", "zenith elevation"),
    "position.azimuth": ("azimuth", "azimuth angle", "azim"),
    "position.distance": ("distance", "range", "radius", "slant range", "radial distance"),
    "wind.direction": ("wind direction", "wind dir", "wdir", "wd", "wind from", "wind heading", "upwind direction", "winddirection"),
    "wind.speed": ("wind speed", "wspd", "ws", "wind velocity", "wind", "v wind", "wind vel", "vw"),
    "wind.density": ("air density", "density", "rho", "rho air"),
    "wind.temperature": ("air temperature", "temperature", "temp", "oat", "t air", "airtemp"),
    "wind.pressure": ("air pressure", "pressure", "static pressure", "baro", "qnh", "qfe", "p static", "barometric pressure", "press"),
    "time": (
        "time", "t", "timestamp", "timestamps", "time stamp", "stamp", "epoch", "unix time", "unix", "utc", "gps time", "seconds",
        "elapsed time", "elapsed", "time since start", "clock", "millis", "micros", "time boot", "posix time", "secs", "datetime",
    ),
}  # fmt: skip
"""What is no quantity of its own: a component whose axes the header does not tell, an angle of a position, wind, the clock."""

WEATHER: dict[str, tuple[str, ...]] = {
    "wind.direction": ("direction", "dir", "from", "dd"),
    "wind.speed": ("speed", "velocity", "ff", "spd"),
    "wind.height": ("height", "altitude", "alt", "z", "level", "agl", "height above ground", "h"),
}
"""What the same words mean in a file that holds weather only."""

COMMANDS = ("cmd", "command", "commanded", "sp", "setpoint", "set point", "des", "desired", "ref", "reference", "demand", "target", "set")
"""Words that make a signal what was asked for, not what was measured."""

REACHED = ("meas", "measured", "fb", "feedback", "actual", "act", "pos", "position", "deflection", "angle", "defl", "state")
"""Words that make a control surface what was reached, not what was asked for."""

IDLE = frozenset(
    "kite uav uas drone aircraft plane glider vehicle airframe fc imu ins gps gnss ekf nav navigation est estimated estimate estimator "
    "filtered filt lowpass lp raw sensor onboard body local frame signal value data log ahrs attitude att mean avg average smoothed eb b "
    "cell station met weather mast lidar ground ned enu frd flu true tether line air measured meas actual state kf main primary "
    "pwm servo".split()
)
"""Words that say where a signal comes from and not what it is; dropped where the rest is still a name."""


@dataclass(frozen=True)
class Meaning:
    """What a name stands for. quantity: a key of PHRASES (without its minus sign), PARTS or WEATHER; sign: -1 where it counts the other
    way; command: it is what was asked for; reached: it is said to be what came of that; idle: how many words were dropped to read it."""

    quantity: str
    sign: int = 1
    command: bool = False
    reached: bool = False
    idle: int = 0


def words(text: str) -> tuple[str, ...]:
    """`rollRate_deg`, `Roll Rate [deg]` -> (roll, rate, deg): lower case, cut at punctuation, at capitals and around digits."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Za-z])(?=[0-9])|(?<=[0-9])(?=[A-Za-z])", " ", text)
    return tuple(w for w in re.split(r"[^A-Za-z0-9]+", apart.lower()) if w)


def meanings(name: tuple[str, ...], weather: bool = False) -> list[Meaning]:
    """What the words of a name may stand for, the most literal reading first; weather: in a file that holds weather only."""
    table = _table(weather)
    command = any(w in COMMANDS for w in name) or "setpoint" in "".join(name)
    kept = tuple(w for w in name if w not in (*COMMANDS, "point")) if command else name
    found = []
    for idle, core in _readings(kept):
        # what was asked for is no measurement
        found += [Meaning(q, s, command, False, idle) for q, s in table.get("".join(core), ()) if not command or q in INPUTS]
    if (rest := tuple(w for w in name if w not in REACHED)) != name and not command:
        found += [Meaning(q, s, False, True, 1) for q, s in table.get("".join(rest), ()) if q in CONTROL_SURFACES]
    return list(dict.fromkeys(found))


def nearest_quantity(name: str, known: Iterable[str]) -> str:
    """The `do` of an error about an unknown quantity: the one that people call so, else the nearest name."""
    for meaning in meanings(words(name)):
        if meaning.quantity in known:
            return f"Did you mean '{meaning.quantity}'?" if meaning.sign > 0 else f"Did you mean '{meaning.quantity}', with `sign: -1`?"
    return did_you_mean(name, known)


@cache
def _table(weather: bool) -> dict[str, tuple[tuple[str, int], ...]]:
    """Name without spaces -> (quantity, sign) of all that are called so."""
    found: dict[str, list[tuple[str, int]]] = {}
    # in a weather file its own words come first
    for phrases in (*((WEATHER,) if weather else ()), PHRASES, PARTS):
        for quantity, names in phrases.items():
            entry = (quantity.removeprefix("-"), -1 if quantity.startswith("-") else 1)
            for name in (*names, *((quantity,) if entry[1] > 0 else ())):
                rows = found.setdefault("".join(words(name)), [])
                if entry not in rows:
                    rows.append(entry)
    return {name: tuple(rows) for name, rows in found.items()}


def _readings(name: tuple[str, ...]) -> Iterator[tuple[int, tuple[str, ...]]]:
    """(words dropped, words left): the name itself, then without numbers, then without idle words, from either end."""
    yield 0, name
    bare = tuple(w for w in name if not w.isdigit())
    if bare != name and bare:
        yield 1, bare
    core = tuple(w for w in bare if w not in IDLE)
    if core and core != bare:
        yield 1 + len(bare) - len(core), core
