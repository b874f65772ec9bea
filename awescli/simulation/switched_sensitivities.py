"""Exact sensitivities of a flight through phases that end at their guards, with what a switch adds where its time depends on the state.

A guard b(x, t, p) = 0 is passed at a time that moves by

    dt*/dp = -(b_x S + b_p) / (db/dt along the old phase)

when a parameter moves, S = dx/dp before it. Behind the switch, whose reset is x+ = r(x-),

    S+ = r_x S- + (r_x f_old(x-) - f_new(x+)) dt*/dp

(docs/equations.md (35): the saltation of Aizerman & Gantmakher, 1958; Kong et al., Saltation matrices, Proc. IEEE 112, 2024). Between
switches the loop of `sensitivities` runs; from the guard to the next sample it runs once for the old phase and once for the new one, as
`switching` flies, so that phases that are alike leave every bit.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from awescli.engine.lanes import lane_rows
from awescli.engine.machine import LANES, Program, evaluate
from awescli.simulation import kernels
from awescli.simulation.groups import each_part
from awescli.simulation.sensitivities import differentiated_loop
from awescli.simulation.stepping import Stepping
from awescli.simulation.stretches import BetweenSamples, Leg, Side, Sizes, Stretch, beside_lanes
from awescli.simulation.switching import Passing, Phase, Read, Switch, Switched, unchanged

TINY = 2.0**-200
"""Of a complex step: what is differentiated with it is exact to rounding (Squire & Trapp, SIAM Review 40, 1998)."""
NEARBY = 1e-3
"""Share of the sample interval over which the rate of a guard's quantity is taken, to both sides."""


@dataclass(frozen=True)
class Programs:
    """f: the rates alone; g: [rates, outputs], differentiated in the rates and in some outputs; initial: as of `kernels.rollout`; laws: of
    each phase, or None for recorded set-points; rows: which outputs g differentiates, every one that a guard names among them."""

    f: Program
    g: Program
    initial: Program
    laws: Sequence[Program | None]
    rows: tuple[int, ...]


@dataclass(frozen=True)
class Columns:
    """What is differentiated with respect to, column by column: state (n,): index of one of the start, or -1; parameter (phases, n): its
    place in `Program.wrt` while a phase lasts, or len(wrt) for none; limit: (phase, place among its guards) -> column."""

    state: np.ndarray
    parameter: np.ndarray
    limit: Mapping[tuple[int, int], int]

    def __len__(self) -> int:
        return len(self.state)

    def part(self, which: slice) -> "Columns":
        """Some of them."""
        limit = {guard: j - which.start for guard, j in self.limit.items() if which.start <= j < which.stop}
        return Columns(self.state[which], self.parameter[:, which], limit)


@dataclass(frozen=True)
class Sensitivities:
    """outputs (N, rows, n), states (N, n_x, n): derivatives at the samples, N before divergence; times (switches, n): of when they are."""

    outputs: np.ndarray
    states: np.ndarray
    times: np.ndarray


def sensitivities_through(
    flown: Switched, phases: Sequence[Phase], programs: Programs, n_s: int, x0: np.ndarray, setpoints: np.ndarray, inputs: np.ndarray,
    h: float, stepping: Stepping, n_y: int, read: Read, columns: Columns,
) -> Sensitivities:  # fmt: skip
    """Of a flight that `fly_switched` has flown at guards, with the same arguments; columns on all cores."""
    sizes, n = (n_s, setpoints.shape[1], inputs.shape[1], n_y), len(columns)
    found = Sensitivities(
        np.empty((flown.alive, len(programs.rows), n)), np.empty((flown.alive, n_s + setpoints.shape[1], n)),
        np.zeros((len(flown.switches), n)),
    )  # fmt: skip

    def fill(which: slice) -> None:
        J, S, times = found.outputs[..., which], found.states[..., which], found.times[:, which]
        _through(flown, phases, programs, sizes, x0, setpoints, inputs, h, stepping, read, columns.part(which), (J, S, times))

    each_part(fill, n)
    return found


def _through(
    flown: Switched, phases: Sequence[Phase], programs: Programs, sizes: Sizes, x0: np.ndarray, setpoints: np.ndarray, inputs: np.ndarray,
    h: float, stepping: Stepping, read: Read, columns: Columns, into: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:  # fmt: skip
    """Some columns of `sensitivities_through`, into its (outputs, states, times)."""
    (J, S, times), n_s, n = into, sizes[0], len(columns)
    across = _Across(programs, sizes, h, stepping, read, phases, columns)
    begun_at, begun = 0.0, np.zeros(n)
    edges = [0, *(s.sample for s in flown.switches), flown.alive]
    S_here: np.ndarray | None = None
    for i, (first, end) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        phase = int(flown.phase[first])
        run = _Run(x0, programs, programs.laws[phase], sizes, h, stepping, columns.state, columns.parameter[phase])
        if S_here is not None:
            run.begin_with(flown.states[first], S_here)
        c = beside_lanes(phases[phase].c)
        S[first:end], J[first:end] = run.fly_all(c, first, end, setpoints, inputs)
        if i < len(flown.switches):
            switch = flown.switches[i]
            leg = Leg(flown.states[end - 1], inputs[end - 1], inputs[end])
            # set-points are held to the end of the leg
            before = np.concatenate([S[end - 1, :n_s], run.S[n_s:]])
            S_here, times[i] = across.switch(switch, leg, before, run.S, end - 1 - begun_at, begun, flown.states[end])
            begun_at, begun = switch.time / h if switch.share is not None else float(end), times[i]


class _Run(Stretch):
    """A stretch with the sensitivities S of its state beside it."""

    def __init__(
        self, x0: np.ndarray, programs: Programs, law: Program | None, sizes: Sizes, h: float, stepping: Stepping, state: np.ndarray,
        parameter: np.ndarray,
    ):  # fmt: skip
        n_s, n_sp, n_u, n_y = sizes
        self.n_x, self.n, self.n_rows, self.n_wrt = n_s + n_sp, len(state), len(programs.rows), len(programs.g.wrt)
        width, self.behind = self.n_x + self.n_wrt + 1, kernels.rows_of_loop(n_s + n_sp, n_s, n_u, n_y)
        rows = (self.n_x + self.n_rows) * self.n + (n_sp + 5 * n_s + self.n_rows) * width
        super().__init__(x0, (programs.g.rates, programs.g.linearised, programs.initial.linearised), sizes, h, stepping, rows)
        self.of, self.law, self.state, self.parameter = programs, law, state, parameter

    @property
    def S(self) -> np.ndarray:
        """(n_x, n)"""
        return self.work[self.behind : self.behind + self.n_x * self.n, 0].reshape(self.n_x, self.n).copy()

    def begin_with(self, x: np.ndarray, S: np.ndarray) -> None:
        """The next stretch begins at x (n_x,) with S (n_x, n)."""
        self.begin_at(x)
        self.work[self.behind : self.behind + self.n_x * self.n] = S.reshape(-1, 1)

    def fly_all(self, c: np.ndarray, first: int, until: int, setpoints: np.ndarray, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(S (until - first, n_x, n), J (until - first, rows, n)) at samples first..until-1; S goes on to `until`."""
        samples, before = len(setpoints), max(first - 1, 0)
        here = slice(before, min(until + 1, samples))
        count, n_y = here.stop - here.start, self.sizes[3]
        states, outputs, alive = lane_rows(count, self.n_x), lane_rows(count, n_y), np.full(kernels.LANES, count)
        J, ends = np.empty((1, count, len(self.of.rows), self.n)), np.empty((1, count, self.n_x, self.n))
        whole = np.full(self.n, count, dtype=np.int64)
        columns = (self.state.astype(np.int64), self.parameter.astype(np.int64), 0 * whole, whole, 0 * whole)
        law, more = self.law, (self.of.g.step, self.of.g.columns, self.of.initial.columns, self.law.columns if self.law else 0)
        sizes = (*self.sizes, samples - before, self.stepping.substeps, self.h, self.stepping.first, self.stepping.onward)
        arrays = (self.x0, *(beside_lanes(a[here]) for a in (setpoints, inputs)), c, states, outputs, alive, self.work)
        # S is kept at every sample, as if it were to begin again there
        further = (len(self.of.rows), 1, J.strides[0] // 8, J, ends.strides[0] // 8, ends, np.empty(self.n, np.int64))
        every = np.arange(count)
        differentiated_loop()(
            *kernels.passed(
                *self.programs, law.linearised if law else 0, *sizes, first - before, until - before, *arrays, *more, self.n, self.n_wrt,
                *columns, every, *further,
            )
        )  # fmt: skip
        return ends[0, first - before : until - before], J[0, first - before : until - before]


@dataclass(frozen=True)
class _Across:
    """What a switch does to sensitivities."""

    programs: Programs
    sizes: Sizes
    h: float
    stepping: Stepping
    read: Read
    phases: Sequence[Phase]
    columns: Columns

    @property
    def between(self) -> BetweenSamples:
        return BetweenSamples((self.programs.f.value, self.programs.g.value, 0), self.sizes, self.h, self.stepping)

    def switch(
        self, switch: Switch, leg: Leg, before: np.ndarray, after: np.ndarray, since: float, begun: np.ndarray, x_after: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """(S (n_x, n) at the sample behind a switch, its time's derivative (n,)). leg: to that sample; before, after: S of the old phase at
        both ends of it; since: samples from where the old phase began to where the leg does; begun (n,): derivative of that beginning."""
        old, new = self.phases[switch.out_of], self.phases[switch.into]
        reset, n_s = new.reset or unchanged, self.sizes[0]
        if switch.share is None:
            return np.concatenate([_pushed(reset, x_after[:n_s], after[:n_s]), after[n_s:]]), np.zeros(len(self.columns))
        u, share = leg.inputs_at(switch.share), switch.share
        c_old, c_new = (beside_lanes(p.c) for p in (old, new))
        x, y, S, dY = self._flown(switch.out_of, leg.x, before, (leg.u, u), share * self.h, c_old)
        passing = Passing(switch.guard, self.read, self.h, since)
        time = -self._beyond(switch, passing, x, y, u, S, dY, begun) / self._rate(passing, leg, share, c_old)
        f_old = self._rates(x, u, c_old)
        sides = (Side(old.law, c_old, unchanged), Side(new.law, c_new, reset))
        begins = self.between.begun(x, u, *sides)
        turned = _pushed(reset, x[:n_s], np.column_stack([S[:n_s], f_old]))
        jump = turned[:, -1] - self._rates(begins, u, c_new)
        # of set-points, which move at the switch and are held again, the whole derivative
        whole = (S[:n_s] + f_old[:, None] * time, turned[:, :-1] + turned[:, -1:] * time)
        at = (x, np.concatenate([begins[:n_s], x[n_s:]]))
        asked_old, asked_new = (
            self._asked(which, state, np.concatenate([moved, S[n_s:]]), leg, share, side.c, time)
            for which, state, moved, side in zip((switch.out_of, switch.into), at, whole, sides, strict=True)
        )
        salted = np.concatenate([turned[:, :-1] + jump[:, None] * time, S[n_s:] + (asked_new - asked_old)])
        left = (1 - share) * self.h
        (*_, S_new, _), (*_, S_old, _) = (
            self._flown(which, at, begun_with, (u, leg.u_after), left, c)
            for which, at, begun_with, c in ((switch.into, begins, salted, c_new), (switch.out_of, x, S, c_old))
        )
        return after + (S_new - S_old), time

    def _flown(
        self, phase: int, x: np.ndarray, S: np.ndarray, u: tuple, seconds: float, c: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """(x, outputs, S, dY (n_y, n)) after some seconds of a phase, set-points held."""
        n_s, n_sp, n_u, n_y = self.sizes
        ended, outputs = self.between.flown(x, u, seconds, c)
        run = _Run(x[:n_s], self.programs, None, self.sizes, seconds, self.stepping, self.columns.state, self.columns.parameter[phase])
        run.begin_with(x, S)
        all_S, J = run.fly_all(c, 1, 3, np.repeat(x[None, n_s:], 3, axis=0), np.stack([u[0], u[0], u[1]]))
        dY = np.zeros((n_y, len(self.columns)))
        dY[list(self.programs.rows)] = J[-1]
        # the set-points are held: what they depend on stays
        return ended, outputs, np.concatenate([all_S[-1, :n_s], S[n_s:]]), dY

    def _asked(self, phase: int, x: np.ndarray, S: np.ndarray, leg: Leg, share: float, c: np.ndarray, time: np.ndarray) -> np.ndarray:
        """(n_sp, n) derivative of the set-points that the law of a phase says at a state x, which moves by S (n_x, n), at a moving time."""
        n_s, law = self.sizes[0], self.programs.laws[phase]
        run = _Run(x[:n_s], self.programs, law, self.sizes, 0.0, self.stepping, self.columns.state, self.columns.parameter[phase])
        run.begin_with(x, S)
        run.fly_all(c, 1, 2, np.repeat(x[None, n_s:], 2, axis=0), np.repeat(leg.inputs_at(share)[None], 2, axis=0))
        address = law.value if law else 0
        before, after = (self.between.set_points(address, x, leg.inputs_at(share + s), c) for s in (-NEARBY, NEARBY))
        return run.S[n_s:] + ((after - before) / (2 * NEARBY * self.h))[:, None] * time

    def _beyond(
        self, switch: Switch, passing: Passing, x: np.ndarray, y: np.ndarray, u: np.ndarray, S: np.ndarray, dY: np.ndarray,
        begun: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """(n,) derivative of how far beyond its limit the guard is, at the time of the switch."""
        guard, n = switch.guard, len(self.columns)
        if guard.quantity == "time_in_phase":
            moved = -begun
        else:
            watched = dict(self.read(x + 1j * TINY * S.T, y + 1j * TINY * dY.T, np.repeat(u[None], n, axis=0)))
            moved = np.imag(guard.beyond(watched)) / TINY
        place = (switch.out_of, list(self.phases[switch.out_of].guards).index(guard))
        if place in self.columns.limit:
            moved = moved - (1.0 if guard.rising else -1.0) * (np.arange(n) == self.columns.limit[place])
        return moved

    def _rate(self, passing: Passing, leg: Leg, share: float, c: np.ndarray) -> float:
        """[1/s] of how far beyond its limit the guard is."""
        seen = []
        for s in (share - NEARBY, share + NEARBY):
            u = leg.inputs_at(s)
            x, y = self.between.flown(leg.x, (leg.u, u), s * self.h, c)
            seen.append(passing.beyond(x, y, u, s))
        return (seen[1] - seen[0]) / (2 * NEARBY * self.h)

    def _rates(self, x: np.ndarray, u: np.ndarray, c: np.ndarray) -> np.ndarray:
        """(n_s,) dx/dt."""
        wide_x, wide_u = (np.repeat(a[:, None], LANES, axis=1) for a in (x, u))
        return evaluate(self.programs.f, wide_x, wide_u, np.ascontiguousarray(c))[: self.sizes[0], 0]


def _pushed(reset: Callable, x: np.ndarray, S: np.ndarray) -> np.ndarray:
    """(n_s, n) r_x S at x."""
    return np.stack([np.imag(reset(x + 1j * TINY * column)) / TINY for column in S.T], axis=1) if S.shape[1] else S
