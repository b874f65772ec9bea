"""What all models of a trace share: the flights, how they are cut, and how much of them is looked at."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from awescli.estimation.problem import EstimationProblem, build, simulator_of
from awescli.flightlog.log import FlightLog
from awescli.flightlog.split import Split
from awescli.notation.parameters import Parameter
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator

BEYOND = 10.0
"""Prior standard deviations to either side where a bound is taken away."""


def unbounded(p: Parameter) -> Parameter:
    """The parameter without bounds; its prior is normal about its value, with the standard deviation that it had."""
    return replace(p, lower=p.value - BEYOND * p.prior_std, upper=p.value + BEYOND * p.prior_std, std=p.prior_std, relative=False)


def _of_its_sign(p: Parameter) -> Parameter:
    """The parameter without bounds, but for the sign that these say."""
    free = unbounded(p)
    lower, upper = max(free.lower, 0.0) if p.lower >= 0 else free.lower, min(free.upper, 0.0) if p.upper <= 0 else free.upper
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

    def problems(self, keys: Sequence[str]) -> list[EstimationProblem]:
        """The flights cut up for the declared kite with the effects `keys` at null."""
        cut = (build(f.simulator(keys), f.log, f.split, self.horizon, self.outputs) for f in self.flights)
        return [problem.spread_out(self.seconds).spaced(self.spacing) for problem in cut]
