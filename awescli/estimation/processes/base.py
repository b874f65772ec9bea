"""The contract of a process: what is neither a parameter nor a state of the kite, random in time, and integrated out of the likelihood.

Flight-vehicle identification calls a likelihood with such processes the filter-error method (Maine & Iliff, NASA RP-1138; Jategaonkar,
Flight Vehicle System Identification, ch. 5). Output error is the case without any.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from awescli.estimation.axes import Axes
from awescli.flightlog.log import FlightLog
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.disturbances import DISTURBANCES
from awescli.simulation.segments import Observed


@dataclass(frozen=True)
class Prior:
    """What is known beforehand of a level or a memory: log-normal about `median`, with standard deviation `spread` of the logarithm;
    spread 0: known."""

    median: float
    spread: float = 0.0

    def deviance(self, value: float) -> float:
        """-2 log of its density at a value, but for a constant; 0 where it is known."""
        return self.above(value) ** 2

    def above(self, value: float) -> float:
        """Spreads by which a value lies above the median; 0 where it is known."""
        return float(np.log(value / self.median) / self.spread) if self.spread else 0.0


def exponential(group: "Group", dt: np.ndarray) -> np.ndarray:
    """The covariance of the Ornstein-Uhlenbeck process itself."""
    return group.level**2 * np.exp(-dt / group.memory)


def at_rest(observed: Observed, nodes: np.ndarray) -> np.ndarray:
    """(K, L + 1) zero at the nodes of all segments."""
    return np.zeros((len(observed.segments), len(nodes)))


@dataclass(frozen=True)
class Group:
    """Axes that share a level (standard deviation, in their unit) and a memory [s], each an Ornstein-Uhlenbeck process of its own.

    axes: disturbances of the kite (`disturbances.DISTURBANCES`) or measured channels (`quantities.MEASURED`); level, memory: present
    values; of_level, of_memory: their priors, held where these say so; form: (group, time differences >= 0 [s]) -> covariance of what the
    Ornstein-Uhlenbeck process stands for in a fit, where that is known: for predictions; begins: (segments, samples of the nodes) ->
    (K, L + 1) values that a fit begins from.
    """

    name: str
    axes: tuple[str, ...]
    level: float
    memory: float
    of_level: Prior
    of_memory: Prior
    form: Callable[["Group", np.ndarray], np.ndarray] = exponential
    begins: Callable[[Observed, np.ndarray], np.ndarray] = at_rest

    @classmethod
    def known(cls, name: str, axes: Sequence[str], level: float, memory: float) -> "Group":
        """A group whose level and memory are not estimated."""
        return cls(name, tuple(axes), level, memory, Prior(level), Prior(memory))


@dataclass(frozen=True)
class Process(ABC):
    """A process of a fit, as its groups. Members are final: they say which groups there are for a flight, and how far apart nodes may be.

    groups: with their present levels; spacing: [s] between nodes at most.
    """

    groups: tuple[Group, ...]
    spacing: float
    name: ClassVar[str]
    doc: ClassVar[str]
    random: ClassVar[bool] = False
    """Does the model depend on it so strongly, and so little linearly, that the log determinant has a slope (`laplace`)?"""
    certain: ClassVar[bool] = False
    """Is it there on every flight, however little one flight shows of it?"""

    @classmethod
    @abstractmethod
    def of(cls, declaration: KiteDeclaration, log: FlightLog) -> "Process":
        """The process as it is known before anything is fitted to a flight of a kite."""

    def at(self, levels: dict[str, float], memories: dict[str, float] | None = None) -> "Process":
        """The same with other levels and memories, by name of the group."""
        memories = memories or {}
        groups = (replace(g, level=levels.get(g.name, g.level), memory=memories.get(g.name, g.memory)) for g in self.groups)
        return replace(self, groups=tuple(groups))

    @property
    def levels(self) -> dict[str, float]:
        return {g.name: g.level for g in self.groups}


def active(processes: Sequence[Process]) -> list[Group]:
    """The groups of some processes that are there at all: a level of zero is none."""
    return [g for process in processes for g in process.groups if g.level > 0]


def spacing(processes: Sequence[Process]) -> float:
    """[s] between the nodes that some processes share; infinite where none is there."""
    return min((p.spacing for p in processes if any(g.level > 0 for g in p.groups)), default=np.inf)


def disturbances_of(processes: Sequence[Process]) -> tuple[str, ...]:
    """The disturbances of a kite that some processes act on, in the order of `DISTURBANCES`."""
    there = {axis for g in active(processes) for axis in g.axes}
    return tuple(name for name in DISTURBANCES if name in there)


def drifts_of(processes: Sequence[Process], outputs: Sequence[str]) -> tuple[str, ...]:
    """The compared channels that drift."""
    there = {axis for g in active(processes) for axis in g.axes}
    return tuple(name for name in outputs if name in there)


def labels_of(processes: Sequence[Process], acting: Sequence[str], drifting: Sequence[str]) -> list[tuple[str, str]]:
    """(name of the group, disturbance or channel) of every axis of `axes_of`, in its order."""
    return [(g.name, axis) for g in active(processes) for axis in g.axes if axis in acting or axis in drifting]


def axes_of(processes: Sequence[Process], acting: Sequence[str], drifting: Sequence[str]) -> Axes:
    """The axes of all processes as the information filter takes them, by their places among the disturbances `acting` and the channels
    `drifting`; an axis on a channel that is not compared is left out."""
    groups = {g.name: g for g in active(processes)}
    rows = [
        (
            acting.index(axis) if axis in acting else -1,
            -1 if axis in acting else drifting.index(axis),
            groups[name].level,
            groups[name].memory,
        )
        for name, axis in labels_of(processes, acting, drifting)
    ]
    columns = list(zip(*rows, strict=True)) or [()] * 4
    return Axes(*(np.array(c, dtype) for c, dtype in zip(columns, (int, int, float, float), strict=True)))
