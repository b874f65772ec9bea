"""What all models of a trace share: the flights, how they are cut, and how much of them is looked at."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from awescli.estimation.problem import EstimationProblem, build, simulator_of
from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import Split
from awescli.notation.parameters import Parameter
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator
from awescli.tracing.feedback import answering

ONSETS = 12
"""Moments of a flight at which something may begin that are looked at at once."""
EDGE = 1.0
"""[s] within which what begins in flight is there."""
BEYOND = 10.0
"""Prior standard deviations to either side where a bound is taken away."""
SMALLEST = 0.01
"""Of a bound that keeps a parameter from zero, down to which it may go without that bound."""


def unbounded(p: Parameter) -> Parameter:
    """The parameter without bounds; its prior is normal about its value, with the standard deviation that it had."""
    return replace(p, lower=p.value - BEYOND * p.prior_std, upper=p.value + BEYOND * p.prior_std, std=p.prior_std, relative=False)


def _of_its_sign(p: Parameter) -> Parameter:
    """The parameter without bounds, but for the sign that these say. What they keep from zero stays so: nothing turns without inertia."""
    free = unbounded(p)
    lower = max(free.lower, SMALLEST * p.lower) if p.lower >= 0 else free.lower
    upper = min(free.upper, SMALLEST * p.upper) if p.upper <= 0 else free.upper
    return replace(free, lower=lower, upper=upper)


@dataclass(frozen=True)
class TracedFlight:
    """A flight of a trace. declared: the kite as declared for it (its wind record and noise are the flight's); closes: a kite -> the law
    that moves its surfaces; None: the recorded set-points do."""

    log: FlightLog
    split: Split
    declared: KiteDeclaration
    label: str = ""
    closes: Callable[[Kite], Callable] | None = None

    @cached_property
    def answering(self) -> tuple[str, ...]:
        """Surfaces that answer what the kite does, or may do so."""
        return answering(self.log)

    def simulator(self, keys: Sequence[str]) -> Simulator:
        """Of the declared kite with the effects `keys` at null."""
        return simulator_of(self.declared, self.log, keys, closes=self.closes)


@dataclass(frozen=True)
class Levels:
    """Levels and memories [s] of a flight's processes, by group, and factors on its noise, by channel."""

    processes: Mapping[str, float] = field(default_factory=dict)
    memories: Mapping[str, float] = field(default_factory=dict)
    factors: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Frame:
    """What all models of a trace share. flights: the plan's first; outputs: compared channels; per_flight: patterns of parameters that
    every flight has for itself; seconds: no more than so much of the train loops of each is looked at, and the same share of validation;
    spacing: [s] between nodes of processes, at least."""

    flights: tuple[TracedFlight, ...]
    horizon: float
    outputs: tuple[str, ...]
    per_flight: tuple[str, ...] = ()
    seconds: float = np.inf
    spacing: float = 0.0

    @property
    def labels(self) -> list[str]:
        return [f.label for f in self.flights]

    @property
    def answering(self) -> tuple[str, ...]:
        """Surfaces that answer what the kite does, in one flight at least, or may do so."""
        return tuple(dict.fromkeys(s for f in self.flights for s in f.answering))

    @property
    def declared(self) -> KiteDeclaration:
        """Of the plan's flight."""
        return self.flights[0].declared

    def beyond(self, names: Sequence[str]) -> "Frame":
        """The same with parameters free to leave their declared bounds, but not to change a sign that these say."""
        flights = []
        for flight in self.flights:
            table = flight.declared.table()
            rows = (_of_its_sign(table[n]) for n in names)
            flights.append(replace(flight, declared=flight.declared.with_parameters(table.with_rows(rows))))
        return replace(self, flights=tuple(flights))

    def _stretches(self, *parts: str) -> np.ndarray:
        """(R, 2) [s] those of some parts of the plan's flight, in order."""
        log, of = self.flights[0].log, self.flights[0].split
        return np.array([(log.time[first], log.time[last - 1]) for first, last in sorted(r for part in parts for r in getattr(of, part))])

    def onsets(self, between: tuple[float, float] = (-np.inf, np.inf)) -> list[float]:
        """[s] moments of the plan's flight at which something may begin, between those two, in order: spread over what is looked at of it,
        and in the middle of what is not, within which no sample tells."""
        ends = self._stretches("train", "validation")
        inside, gaps = np.clip(ends, *between), ((ends[:-1, 1] + ends[1:, 0]) / 2)[ends[1:, 0] - ends[:-1, 1] > EDGE]
        before = np.r_[0.0, np.cumsum(inside[:, 1] - inside[:, 0])]
        shares = np.arange(1, ONSETS + 1) / (ONSETS + 1)
        spread = np.interp(shares * before[-1], np.stack([before[:-1], before[1:]], axis=1).ravel(), inside.ravel())
        return sorted({*spread.tolist(), *gaps[(gaps > between[0]) & (gaps < between[1])].tolist()})

    def fits(self, moment: float) -> bool:
        """Does a moment of the plan's flight lie in a stretch that is fitted, and not at its end, of which that says little?"""
        return any(first + EDGE < moment < last - EDGE for first, last in self._stretches("train"))

    def without(self, rows: Sequence[Mapping[str, Sequence[int]]]) -> "Frame":
        """The same without some samples of channels, of every flight: their sensors said nothing there."""
        each = zip(self.flights, rows, strict=True)
        return replace(self, flights=tuple(replace(flight, log=flight.log.without_values(of)) for flight, of in each))

    def problems(self, keys: Sequence[str]) -> list[EstimationProblem]:
        """The flights cut up for the declared kite with the effects `keys` at null."""
        cut = (build(f.simulator(keys), f.log, f.split, self.horizon, self.outputs) for f in self.flights)
        return [problem.spread_out(self.seconds).spaced(self.spacing) for problem in cut]
