"""A switched system: phases, each with its own law and parameters, through which one flight runs from guard to guard.

The compiled loop over time is that of every rollout (`kernels`), stopped at samples and gone on with from what it left: a flight whose
phases are alike is the unswitched one to the last bit. A phase ends at the first sample at which one of its guards has been passed: that
is when a flight computer, which sets surfaces and winch once per sample, can act. Where between two samples the guard itself was passed
is told by the cubic through values and slopes at both.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from awescli.engine.lanes import abreast, lane_rows
from awescli.simulation import kernels
from awescli.simulation.stepping import Stepping

AHEAD = 64
"""Samples flown before the guards are looked at: what is flown beyond one is thrown away."""


@dataclass(frozen=True)
class Guard:
    """Passed where `quantity` has come to `limit` from below (rising) or above."""

    quantity: str
    limit: float
    rising: bool

    def beyond(self, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """(N,) how far beyond the limit; passed where this is not below zero."""
        return (values[self.quantity] - self.limit) * (1.0 if self.rising else -1.0)


@dataclass(frozen=True)
class Phase:
    """law: address of the program of set-points, 0 for recorded ones; c: (n_c,) parameters; guards: what ends it; reset: state x (n_s,) at
    its first sample -> the state that it begins with, or None."""

    name: str
    law: int
    c: np.ndarray
    guards: Sequence[Guard]
    reset: Callable[[np.ndarray], np.ndarray] | None = None


@dataclass(frozen=True)
class Switch:
    """At `sample` phase `into` took over from phase `out_of`, since `guard` was passed at `time` [s]."""

    sample: int
    time: float
    out_of: int
    into: int
    guard: Guard


@dataclass(frozen=True)
class Switched:
    """states (N+1, n_x), outputs (N+1, n_y); phase: (N+1,) index of the phase at each sample; alive: samples before it diverged or ended;
    ended: the guard that was passed after the last switch that was allowed, or None."""

    states: np.ndarray
    outputs: np.ndarray
    phase: np.ndarray
    alive: int
    switches: tuple[Switch, ...]
    ended: Guard | None


def fly_switched(
    f: int, g: int, initial: int, phases: Sequence[Phase], n_s: int, x0: np.ndarray, setpoints: np.ndarray, inputs: np.ndarray, h: float,
    stepping: Stepping, n_y: int, read: Callable[[np.ndarray, np.ndarray, np.ndarray], Mapping[str, np.ndarray]], most: int | None = None,
) -> Switched:  # fmt: skip
    """Fly through the phases, after the last one the first again, for all samples or until `most` switches.

    f, g, initial: addresses of programs, as in `kernels.rollout`; x0 (n_s,), setpoints (N+1, n_sp), inputs (N+1, n_u) of one segment;
    read: (states (n, n_x), outputs (n, n_y), inputs (n, n_u)) -> what guards name, (n,); `time_in_phase` [s] is always there.
    """
    samples, n_sp, n_u = len(setpoints), setpoints.shape[1], inputs.shape[1]
    n_x = n_s + n_sp
    X, Y, of = np.empty((samples, n_x)), np.empty((samples, n_y)), np.zeros(samples, dtype=int)
    stretch = _Stretch(kernels.rows_of_loop(n_x, n_s, n_u, n_y), x0, (f, g, initial), (n_s, n_sp, n_u, n_y), h, stepping)
    parameters = [abreast(np.ascontiguousarray(p.c[None], dtype=float)) for p in phases]
    switches: list[Switch] = []
    now = first = entered = 0
    alive = samples
    while first < samples and alive == samples:
        until = min(first + AHEAD, samples)
        alive = stretch.fly(phases[now].law, parameters[now], first, until, setpoints, inputs, X, Y)
        of[first:until] = now
        begin = max(first - 1, entered)
        seen = slice(begin, min(until, alive))
        values = dict(read(X[seen], Y[seen], inputs[seen]))
        values["time_in_phase"] = (np.arange(seen.start, seen.stop) - entered) * h
        passed = _first_passed(phases[now].guards, values)
        if passed is None:
            first = until
            continue
        k, guard = passed
        at, into = begin + k, (now + 1) % len(phases)
        if len(switches) == most:
            return Switched(X, Y, of, at + 1, tuple(switches), guard)
        switches.append(Switch(at, h * (at - 1 + _share(guard.beyond(values), k)), now, into, guard))
        reset = phases[into].reset
        stretch.begin_at(X[at] if reset is None else np.concatenate([reset(X[at, :n_s]), X[at, n_s:]]))
        # what was flown beyond the guard counts for nothing
        now, first, entered, alive = into, at, at, samples
    return Switched(X, Y, of, alive, tuple(switches), None)


class _Stretch:
    """The loop of a rollout, some samples at a time: `work` holds the state between them. All lanes fly the same."""

    def __init__(self, rows: int, x0: np.ndarray, programs: tuple, sizes: tuple, h: float, stepping: Stepping):
        self.work, self.x0 = lane_rows(rows), abreast(np.ascontiguousarray(x0[None], dtype=float))
        self.programs, self.sizes, self.h, self.stepping = programs, sizes, h, stepping

    def begin_at(self, x: np.ndarray) -> None:
        """The next stretch begins at the state x (n_x,)."""
        self.work[: len(x)] = x[:, None]

    def fly(self, law: int, c: np.ndarray, first: int, until: int, setpoints, inputs, X: np.ndarray, Y: np.ndarray) -> int:
        """Fill samples first..until-1 of X and Y; returns the first sample that diverged, or how many there are."""
        n_s, n_sp, n_u, n_y = self.sizes
        samples, before = len(setpoints), max(first - 1, 0)  # a loop that begins at sample 0 begins from the start
        here = slice(before, min(until + 1, samples))
        given = (abreast(np.ascontiguousarray(a[None, here], dtype=float)) for a in (setpoints, inputs))
        count = here.stop - here.start
        states, outputs, alive = lane_rows(count, n_s + n_sp), lane_rows(count, n_y), np.full(kernels.LANES, count)
        sizes = (*self.sizes, samples - before, self.stepping.substeps, self.h, self.stepping.first, self.stepping.onward)
        arrays = (self.x0, *given, c, states, outputs, alive, self.work)
        kernels.rollout_loop()(*kernels.passed(*self.programs, law, *sizes, first - before, until - before, *arrays))
        X[first:until], Y[first:until] = states[first - before : until - before, :, 0], outputs[first - before : until - before, :, 0]
        return samples if alive[0] == count else before + int(alive[0])


def _first_passed(guards: Sequence[Guard], values: Mapping[str, np.ndarray]) -> tuple[int, Guard] | None:
    """(index, guard) of the first sample behind the first one at which one is passed."""
    found = []
    for guard in guards:
        beyond = guard.beyond(values)[1:] >= 0
        if beyond.any():
            found.append((int(np.argmax(beyond)) + 1, guard))
    return min(found, key=lambda pair: pair[0], default=None)


def _share(beyond: np.ndarray, k: int) -> float:
    """Where between samples k - 1 and k a value came to zero: of the cubic through the values there and the slopes that the neighbours say;
    1 where it was beyond zero before."""
    a, b = float(beyond[k - 1]), float(beyond[k])
    if a >= 0:
        return 1.0
    before = (b - float(beyond[k - 2])) / 2 if k >= 2 else b - a
    after = (float(beyond[k + 1]) - a) / 2 if k + 1 < len(beyond) else 2 * (b - a) - before
    # Hermite's cubic in the share s; its one root in (0, 1] by bisection
    low, high = 0.0, 1.0
    for _ in range(60):
        s = (low + high) / 2
        value = (1 + 2 * s) * (1 - s) ** 2 * a + s * (1 - s) ** 2 * before + s * s * (3 - 2 * s) * b + s * s * (s - 1) * after
        low, high = (s, high) if value < 0 else (low, s)
    return high
