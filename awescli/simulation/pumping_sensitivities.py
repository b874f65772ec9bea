"""How a pumping flight, and the power it yields, change with parameters, winch law and the limits that end its phases: exactly, switches
included (`switched_sensitivities`). Phases end where their guards are passed, which makes the flight a smooth function of all these."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from awescli.flightlog.log import WindRecord
from awescli.notation.phases import parted
from awescli.notation.present import present
from awescli.notation.quantities import OUTPUTS, STATES
from awescli.simulation.pumping import DRUM, GUARDED, Pumping, air_and_line, winch_states
from awescli.simulation.stepping import Stepping
from awescli.simulation.switched_sensitivities import Columns, Programs, Sensitivities, sensitivities_through
from awescli.simulation.switching import Switched, fly_switched

Asked = str | tuple[str, int]
"""A state of the start or a parameter by name (`CLa`, `CD0:retraction`); (parameter, place of a phase): its value in that phase alone, as
a winch law has it; (quantity, place of a phase): the limit at which it ends that phase."""
GUARDING = ("tension", "V_a")
"""Outputs that a guard may name."""


@dataclass(frozen=True)
class DifferentiatedCycles:
    """flown: with phases that end at guards; of: its sensitivities, outputs GUARDING, columns as they were asked for; power (N,) [W] and
    its derivative (N, n); dt: [s] between samples."""

    flown: Switched
    of: Sensitivities
    power: np.ndarray
    power_moved: np.ndarray
    dt: float

    @property
    def _ends(self) -> list[int]:
        """Which switches end a cycle."""
        return [i for i, s in enumerate(self.flown.switches) if s.into == 0]

    @property
    def cycles(self) -> int:
        """How many came to their end."""
        return len(self._ends)

    def mean_power(self) -> tuple[float, np.ndarray, float]:
        """(mean power [W] of all `cycles` since the start, its derivative (n,), their seconds)."""
        ends = self._ends
        last = self.flown.switches[ends[-1]]
        energy, power = self._until(self.power, last.time)
        moved, _ = self._until(self.power_moved, last.time)
        ended = self.of.times[ends[-1]]
        mean = energy / last.time
        return float(mean), (moved + power * ended - mean * ended) / last.time, last.time

    def _until(self, rate: np.ndarray, time: float) -> tuple[float | np.ndarray, float | np.ndarray]:
        """(integral of a rate to a time, the rate there): trapezoids, straight between samples."""
        k = int(time / self.dt)
        here, share = rate[k], time / self.dt - k
        there = here + share * (rate[k + 1] - here)
        whole = self.dt / 2 * (rate[:k] + rate[1 : k + 1]).sum(axis=0)
        return whole + share * self.dt / 2 * (here + there), there


def parameters_of(asked: Sequence[Asked]) -> tuple[str, ...]:
    """The parameters that a Pumping must be differentiable in (`Pumping.of: wrt`)."""
    names = (parted(a)[0] if isinstance(a, str) else a[0] for a in asked)
    return tuple(dict.fromkeys(n for n in names if n not in (*STATES, *GUARDED, "time_in_phase")))


def differentiated(
    pumping: Pumping, wind: WindRecord, asked: Sequence[Asked], *, start: np.ndarray, length: float, duration: float, dt: float,
    cycles: int, speed: float = 0.0, load: float = 0.0, begins: float = 0.0,
) -> DifferentiatedCycles:  # fmt: skip
    """Fly `cycles` in calm air, as `Pumping.fly` but that phases end at guards, and differentiate; pumping: made with `wrt`.

    Raises ValueError where set-points move between samples (`held`).
    """
    kite = pumping.kite
    _, inputs = air_and_line(kite, wind, length, duration, dt, begins)
    phases, *how = pumping.through(kite, inputs, start, winch_states(load, speed), dt)
    one = pumping.laws[0]
    # one switch more: where the last cycle ends
    most = cycles * len(phases)
    flown = fly_switched(one.f.value, one.g.value, one.initial.value, phases, *how, most=most, at_guards=True)
    rows = tuple(OUTPUTS.index(n) for n in GUARDING)
    programs = Programs(one.f, one.differentiating(GUARDING), one.initial, [law.law for law in pumping.laws], rows)
    found = sensitivities_through(flown, phases, programs, *how, columns=_columns(pumping, asked))
    tension, v = flown.outputs[: flown.alive, OUTPUTS.index("tension")], kite.state_names.index(f"{DRUM}.speed")
    reeled, moved = flown.states[: flown.alive, v], found.states[:, v]
    power_moved = found.outputs[:, GUARDING.index("tension")] * reeled[:, None] + tension[:, None] * moved
    return DifferentiatedCycles(flown, found, tension * reeled, power_moved, dt)


def held(pumping: Pumping, dt: float) -> bool:
    """Whether set-points are held from sample to sample, so that a flight can be differentiated."""
    return not Stepping.between(dt, dt, pumping.kite.declaration.set_point_rate).onward


def _columns(pumping: Pumping, asked: Sequence[Asked]) -> Columns:
    kite, wrt = pumping.kite, pumping.laws[0].wrt
    own = {(base, phase) for _, base, phase in kite.own_in_phase}
    state, limit = np.full(len(asked), -1), {}
    parameter = np.full((len(pumping.phases), len(asked)), len(wrt))
    for j, what in enumerate(asked):
        if isinstance(what, str) and what in STATES:
            state[j] = kite.x_names.index(what)
            continue
        name, only = (what, None) if isinstance(what, str) else what
        if name not in kite.parameter_names:
            ended = present(only, f"the phase that '{name}' ends")
            quantities = [guard.quantity for guard in pumping.phases[ended].guards]
            limit[ended, quantities.index(name)] = j
            continue
        base, in_phase = parted(name)
        for i, phase in enumerate(pumping.phases):
            counts = phase.name == in_phase if in_phase else (base, phase.name) not in own
            if (only is None and counts) or only == i:
                parameter[i, j] = wrt.index(base)
    return Columns(state, parameter, limit)
