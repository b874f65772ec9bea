"""Names, units and words of everything that an exported model takes and gives."""

from collections.abc import Sequence
from dataclasses import dataclass

from awescli.notation.phases import OWN, input_of
from awescli.notation.quantities import IN_WORDS, STATES, SURFACES, UNITS
from awescli.physics.disturbances import RECORDED
from awescli.physics.effects.around import AROUND, LOOKED_AT, around
from awescli.physics.effects.past import ASKED, BEHIND, past_of


@dataclass(frozen=True)
class Signal:
    """A state, input, output or parameter. value: at the start, or of the parameter; interval: 95 %, where a flight gives one."""

    name: str
    unit: str
    words: str
    value: float | None = None
    source: str = ""
    std: float | None = None
    interval: Sequence[float] | None = None


_WAYS = dict(zip("ned", ("north", "east", "down"), strict=True))
_INPUTS = {
    "density": ("kg/m3", "air density at the kite"),
    **{f"turbulence_{axis}": ("-", f"turbulence of unit variance, {way}") for axis, way in _WAYS.items()},
    "turbulence_p": ("-", "roll gust of unit variance"),
    **{f"gust_{axis}": ("m/s", f"gust beside the wind, {way}") for axis, way in _WAYS.items()},
    "gust_p": ("rad/s", "roll gust: gradient of the vertical gust along the span"),
    "gust_q": ("rad/s", "pitch gust: gradient of the vertical gust along the fuselage"),
    "gust_r": ("rad/s", "yaw gust: gradient of the lateral gust along the fuselage"),
    **{f"force_{axis}": ("m/s2", f"force per mass beside the modelled ones, body {axis}") for axis in "xyz"},
    **{f"moment_{axis}": ("rad/s2", f"angular acceleration beside the modelled moments, body {axis}") for axis in "xyz"},
    **{axis: ("rad", f"{IN_WORDS[surface]} beside the recorded one") for surface, axis in RECORDED.items()},
    "line_length": ("m", "length of the line beside what the winch has paid out"),
    "reel_out_acceleration": ("m/s2", "rate of the reel-out speed"),
    "time": ("s", "the flight's clock, which runs on as it flies"),
    "tension_rate": ("N/s", "rate of the measured pull of the line"),
    **{
        name: (UNITS[asked], f"{IN_WORDS[asked] if asked not in SURFACES else f'{asked} command'} {ago:g} s before, less that of now")
        for asked in ASKED for name, ago in zip(past_of(asked), BEHIND, strict=True)
    },
    **{
        name: (UNITS.get(signal, "m/s2"), f"{IN_WORDS.get(signal, 'rate of the reel-out speed')} {ahead:+g} s from now, less that of now")
        for signal in LOOKED_AT for name, ahead in zip(around(signal), AROUND, strict=True)
    },
    **{input_of(phase): ("-", f"1 in {phase}, in which parameters have values of their own, else 0") for phase in OWN},
}  # fmt: skip
"""Exogenous inputs that are no quantity of a flight -> (unit, words)."""
_STATIONS = {"speed": ("m/s", "wind speed"), "direction": ("rad", "direction that the wind comes from, clockwise from north"),
             "down": ("m/s", "wind down")}  # fmt: skip


def state_signal(name: str, unit: str, value: float | None) -> Signal:
    """One of the 12 states, or of an effect's own."""
    if name in STATES:
        return Signal(name, unit, IN_WORDS[name], value)
    effect, _, own = name.rpartition(".")
    return Signal(name, unit, f"{own} of the effect {effect}", value)


def input_signal(name: str, heights: Sequence[float], value: float) -> Signal:
    """An exogenous input of a kite in a wind known at `heights` [m]."""
    if name.startswith("wind_"):
        _, kind, station = name.split("_")
        unit, words = _STATIONS[kind]
        return Signal(name, unit, f"{words}, at {heights[int(station)]:g} m" if len(heights) > 1 else words, value)
    if name in _INPUTS:
        return Signal(name, *_INPUTS[name], value)
    if name.removesuffix("_rate") in SURFACES:
        surface = name.removesuffix("_rate")
        unit = "1/s" if UNITS[surface] == "-" else f"{UNITS[surface]}/s"
        return Signal(name, unit, f"rate of the {surface} command, over the last 0.1 s", value)
    return Signal(name, UNITS[name], IN_WORDS[name], value)


def set_point_signal(name: str, value: float) -> Signal:
    return Signal(name, UNITS[name], IN_WORDS[name], value)


def output_signal(name: str) -> Signal:
    """What a sensor reports, or a set-point as it is flown."""
    return Signal(name, UNITS[name], IN_WORDS[name])
