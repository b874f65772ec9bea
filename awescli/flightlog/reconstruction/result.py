"""What a reconstruction says: noise of every channel and errors of sensors, each with its interval; plain values, for a fit as priors."""

from dataclasses import asdict, dataclass

import numpy as np


@dataclass(frozen=True)
class Level:
    """A positive level with its 95 % interval (low, high), in SI."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, value: float, spread: float) -> "Level":
        """From the standard deviation of its logarithm."""
        reach = np.exp(1.96 * min(spread, 5.0))
        return cls(float(value), float(value / reach), float(value * reach))


@dataclass(frozen=True)
class ChannelNoise:
    """Noise of one measured channel. white: standard deviation of a sample, None where the flight does not tell it; drift, memory [s]: of
    what wanders beside it (Ornstein-Uhlenbeck), None where nothing does; by: what it was determined from."""

    channel: str
    unit: str
    white: Level | None
    drift: Level | None
    memory: Level | None
    by: str


@dataclass(frozen=True)
class SensorError:
    """A systematic error of a sensor, as far as kinematics alone tells it.

    name: the effect of the library that it is, or what it is where there is none; target: of the effect; acts_on: channels; size, std:
    estimate and standard deviation in `unit` (SI); matters: size from which it changes what a model learns; agrees: the flight says one
    thing at slow and at quick motion (delays), or is as clear as it has to be; simple: it delays, scales or shifts each of its channels by
    itself, so that it can be taken out again (a box of gyros that is turned does not, nor does iron beside a compass).
    """

    name: str
    target: str | None
    acts_on: tuple[str, ...]
    size: float
    std: float
    unit: str
    matters: float
    agrees: bool = True
    simple: bool = True

    @property
    def found(self) -> bool:
        """Clearly there, and of a size that matters."""
        return self.agrees and clearly_matters(self.size, self.std, self.matters)

    @property
    def determined(self) -> bool:
        """The flight would have shown a size that matters."""
        return bool(CLEAR * self.std <= self.matters)


CLEAR = 4.0
"""Standard deviations: some fifteen errors are looked at on each flight, and their noise is not quite what is assumed."""


def clearly_matters(error: float, std: float, matters: float) -> bool:
    """Is an error clearly there, and of a size that matters, with its interval beyond half of that?"""
    return bool(abs(error) > CLEAR * std and abs(error) - 1.96 * std > 0.5 * matters and abs(error) >= matters)


@dataclass(frozen=True)
class FlightPath:
    """What the kinematics of a flight say of its sensors. samples, stretches: what was looked at; notes: what could not be."""

    noise: tuple[ChannelNoise, ...]
    errors: tuple[SensorError, ...]
    samples: int
    stretches: int
    notes: tuple[str, ...] = ()

    @property
    def findings(self) -> tuple[SensorError, ...]:
        return tuple(e for e in self.errors if e.found)

    def as_dict(self) -> dict:
        """Plain data, ready for JSON."""
        return {**asdict(self), "errors": [{**asdict(e), "found": e.found} for e in self.errors]}
