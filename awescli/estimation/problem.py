"""From a log and a kite to an estimation problem: compile the model, cut the segments, say which processes there may be."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from awescli.estimation.misfit import Misfit
from awescli.estimation.processes import PROCESSES
from awescli.estimation.processes.base import Process
from awescli.flightlog.log import FlightLog
from awescli.flightlog.phases import apart_from_changes, phases
from awescli.flightlog.split import Split, segments
from awescli.notation.errors import BadInput
from awescli.notation.parameters import ParameterTable
from awescli.notation.quantities import UNITS
from awescli.physics.declaration import KiteDeclaration
from awescli.physics.disturbances import DISTURBANCE_UNITS, DISTURBANCES, both
from awescli.physics.flight_model import FlightModel
from awescli.physics.kite import Kite
from awescli.simulation.rollout import Simulator
from awescli.simulation.segments import Observed, observe

RANGE_SHARE = 0.01
"""Share of a channel's range that takes the place of its noise where channels are weighted by their range: the weight matrix of Rositani
eq. (11a), which normalises output magnitudes."""


@dataclass(frozen=True)
class EstimationProblem:
    """A flight cut up for one model.

    simulator: of the kite, with all parameters; horizon: [s] of a segment; outputs: compared channels; fitted, validation: segments to fit
    to and to choose on; processes: with their levels; names: of the fitted parameters; prior: their table as declared; factors: channel ->
    factor on the declared noise; by_range: channels are weighted by their range instead of their noise; known_starts: segments begin at the
    measured states (Rositani eq. 11c).
    """

    simulator: Simulator
    log: FlightLog
    split: Split
    horizon: float
    outputs: tuple[str, ...]
    fitted: Observed
    validation: Observed
    processes: tuple[Process, ...]
    names: tuple[str, ...]
    prior: ParameterTable
    factors: Mapping[str, float]
    by_range: bool = False
    known_starts: bool = False

    @property
    def kite(self) -> FlightModel:
        return self.simulator.kite

    def misfit(self, simulator: Simulator | None = None, names: Sequence[str] | None = None) -> Misfit:
        """Of the fitted segments."""
        names = self.names if names is None else tuple(names)
        return Misfit(simulator or self.simulator, self.fitted, names, self.processes, self.known_starts)

    def with_processes(self, processes: Sequence[Process]) -> "EstimationProblem":
        return replace(self, processes=tuple(processes))

    def with_factors(self, factors: Mapping[str, float]) -> "EstimationProblem":
        """With further factors on the noise of some channels."""
        scaled = {n: self.factors.get(n, 1.0) * factors.get(n, 1.0) for n in self.outputs}
        fitted, validation = (o.scaled(factors) for o in (self.fitted, self.validation))
        return replace(self, fitted=fitted, validation=validation, factors=scaled)

    def at_noise(self, factors: Mapping[str, float]) -> "EstimationProblem":
        """With these factors on the declared noise."""
        return self.with_factors({n: f / self.factors.get(n, 1.0) for n, f in factors.items()})

    def at(self, levels: Mapping[str, float], memories: Mapping[str, float], factors: Mapping[str, float]) -> "EstimationProblem":
        """With these levels of processes, by group, all others that need not be there at zero; these memories [s], others as they are; and
        these factors on the noise."""
        there = [{g.name: levels.get(g.name, g.level if p.certain else 0.0) for g in p.groups} for p in self.processes]
        processes = [p.at(of, dict(memories)) for p, of in zip(self.processes, there, strict=True)]
        return self.with_processes(processes).with_factors(factors)

    def spread_out(self, seconds: float) -> "EstimationProblem":
        """With no more of the fitted segments than `seconds` hold, and the same share of those to choose on, spread over the flight."""
        share = min(seconds / self.fitted.seconds, 1.0)
        return self if share == 1 else replace(self, fitted=self.fitted.spread_out(share), validation=self.validation.spread_out(share))

    def spaced(self, seconds: float) -> "EstimationProblem":
        """With nodes of processes that lie so far apart at least."""
        if all(p.spacing >= seconds for p in self.processes):
            return self
        return self.with_processes([replace(p, spacing=max(p.spacing, seconds)) for p in self.processes])

    def shorter(self, horizon: float, simulator: Simulator | None = None) -> "EstimationProblem":
        """The same flight cut into other segments; processes and noise as they are."""
        how = {"by_range": self.by_range, "known_starts": self.known_starts}
        cut = build(simulator or self.simulator, self.log, self.split, horizon, self.outputs, **how)
        return replace(cut.with_factors(self.factors), processes=self.processes, prior=self.prior, names=self.names)

    def without_values(self, rows: Mapping[str, Sequence[int]]) -> "EstimationProblem":
        """The same without some values of the log, channel -> samples."""
        return replace(self, log=self.log.without_values(rows)).shorter(self.horizon)


def simulator_of(
    declaration: KiteDeclaration,
    log: FlightLog,
    extra: Sequence[str] = (),
    law: Callable | None = None,
    closes: Callable[[Kite], Callable] | None = None,
) -> Simulator:
    """Compile the declared kite with `extra` effects at null, differentiable in its free parameters, in those of `extra`, and in all that
    acts beside them. law: closes the loop, as in `Simulator`; closes: makes it for the kite with its extra effects."""
    kite = Kite(declaration, log.recorded_wind.height, extra)
    own = {p.name for e in kite.effects if e.key in extra for p in e.rows()}
    beside = {*both(DISTURBANCES), *kite.record}
    wrt = [n for n in kite.parameter_names if kite.parameters[n].free or n in own or n in beside]
    return Simulator(kite, wrt, closes(kite) if closes else law)


def without_record(kite: FlightModel, table: ParameterTable) -> ParameterTable:
    """The table with the wind record's fitted error taken out: what a kite file holds, and what predictions are scored with."""
    return table.with_values(dict.fromkeys(kite.record, 0.0))


def build(
    simulator: Simulator, log: FlightLog, split: Split, horizon: float, outputs: Sequence[str], *, by_range: bool = False,
    known_starts: bool = False,
) -> EstimationProblem:  # fmt: skip
    """Cut the log into segments of `horizon` seconds for fitting and for choosing. Processes that are always there have their level, others
    are at zero. Raises BadInput where a part is too short for a segment.

    Of a kite with values of its own in a phase, segments stay clear of changes of phase, whose time a log tells to some seconds only.
    """
    kite, steps = simulator.kite, int(round(horizon / log.dt))
    valid = log.valid & apart_from_changes(phases(log), log.dt) if kite.own_in_phase else log.valid
    observed: list[Observed] = []
    for part in ("train", "validation"):
        first = segments(getattr(split, part), steps, valid=valid)
        if not len(first):
            raise BadInput(
                f"no segment of {horizon:g} s fits into the {part} loops of flight '{log.name}'",
                do="Use a shorter horizon, or a longer flight; `awes check` lists what was left out and why.",
            )
        cut = observe(log, kite, first, steps, outputs)
        if by_range:
            spans = np.array([RANGE_SHARE * (np.ptp(log[n]) or 1.0) for n in cut.outputs])
            cut = cut.with_sigma(np.where(np.isfinite(cut.sigma), spans, np.inf))
        observed.append(cut)
    # weights that are no noise have no likelihood in which a level could be found
    processes = () if by_range else tuple(p.of(kite.declaration, log) for p in PROCESSES.values())
    names = (*kite.parameters.free, *kite.record)
    fitted, validation = observed
    return EstimationProblem(
        simulator, log, split, horizon, fitted.outputs, fitted, validation, processes, names, kite.parameters, {}, by_range, known_starts
    )  # fmt: skip


def levels_found(problem: EstimationProblem) -> dict[str, dict]:
    """Group of a process that is there -> level, its unit, memory [s]."""
    return {
        g.name: {"level": g.level, "unit": UNITS.get(g.axes[0]) or DISTURBANCE_UNITS[g.axes[0]], "memory_s": g.memory, "process": p.name}
        for p in problem.processes
        for g in p.groups
        if g.level > 0
    }
