"""A switched system: phases, each with its own law and parameters, through which one flight runs from guard to guard.

The compiled loop over time is that of every rollout (`kernels`), stopped at samples and gone on with from what it left: a flight whose
phases are alike is the unswitched one to the last bit. A phase ends at the first sample at which one of its guards has been passed: that
is when a flight computer, which sets surfaces and winch once per sample, can act. Where between two samples the guard itself was passed
is given by the cubic through values and slopes at both.

Or it ends where the guard is passed (`at_guards`), so that the flight is a smooth function of its start and its parameters, with
sensitivities (`switched_sensitivities`): from there to the next sample it flies once as the old phase and once as the new one, and the
difference is added to the step of the old one. Set-points, held otherwise from sample to sample, move there by what both laws differ in.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from awescli.simulation.stepping import Stepping
from awescli.simulation.stretches import BetweenSamples, Leg, Side, Stretch, beside_lanes

Read = Callable[[np.ndarray, np.ndarray, np.ndarray], Mapping[str, np.ndarray]]
"""(states (n, n_x), outputs (n, n_y), inputs (n, n_u)) -> what guards name, (n,)."""
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
    """law: address of the program of set-points, 0 for recorded ones; c: (n_c,) parameters; guards: what ends it; reset: state x (n_s,)
    where it begins -> the state that it begins with, or None; it takes complex numbers where sensitivities are asked for."""

    name: str
    law: int
    c: np.ndarray
    guards: Sequence[Guard]
    reset: Callable[[np.ndarray], np.ndarray] | None = None


@dataclass(frozen=True)
class Switch:
    """At `sample` phase `into` took over from phase `out_of`, since `guard` was passed at `time` [s]; share: of the way there from the
    sample before, where phases end at guards: there it took over; None where the guard had been passed before."""

    sample: int
    time: float
    out_of: int
    into: int
    guard: Guard
    share: float | None = None


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
    stepping: Stepping, n_y: int, read: Read, most: int | None = None, at_guards: bool = False,
) -> Switched:  # fmt: skip
    """Fly through the phases, after the last one the first again, for all samples or until `most` switches.

    f, g, initial: addresses of programs, as in `kernels.rollout`; x0 (n_s,), setpoints (N+1, n_sp), inputs (N+1, n_u) of one segment;
    read: what guards name of states, outputs and inputs; `time_in_phase` [s] is always there. at_guards: phases end where guards are
    passed, not at the next sample. Raises ValueError for that where set-points move between samples.
    """
    if at_guards and (stepping.first or stepping.onward):
        raise ValueError("phases can end between samples only where set-points are held from sample to sample")
    samples, n_sp, n_u = len(setpoints), setpoints.shape[1], inputs.shape[1]
    X, Y, of = np.empty((samples, n_s + n_sp)), np.empty((samples, n_y)), np.zeros(samples, dtype=int)
    how = (f, g, initial), (n_s, n_sp, n_u, n_y), h, stepping
    stretch, between = Stretch(x0, *how), BetweenSamples(*how)
    parameters = [beside_lanes(p.c) for p in phases]
    switches: list[Switch] = []
    now = first = entered = 0
    since, alive = 0.0, samples
    while first < samples and alive == samples:
        until = min(first + AHEAD, samples)
        alive = stretch.fly(phases[now].law, parameters[now], first, until, setpoints, inputs, X, Y)
        of[first:until] = now
        begin = max(first - 1, entered)
        seen = slice(begin, min(until, alive))
        values = dict(read(X[seen], Y[seen], inputs[seen]))
        values["time_in_phase"] = (np.arange(seen.start, seen.stop) - since) * h
        passed = _first_passed(phases[now].guards, values)
        if passed is None:
            first = until
            continue
        k, guard = passed
        at, into = begin + k, (now + 1) % len(phases)
        if len(switches) == most:
            return Switched(X, Y, of, at + 1, tuple(switches), guard)
        beyond, reset = guard.beyond(values), phases[into].reset or unchanged
        if at_guards and beyond[k - 1] < 0:
            leg, c = Leg(X[at - 1], inputs[at - 1], inputs[at]), parameters[now]
            share = between.passed(leg, c, Passing(guard, read, h, at - 1 - since).beyond)
            sides = (Side(phases[i].law, parameters[i], phases[i].reset or unchanged) for i in (now, into))
            x, since = between.switched(leg, share, *sides, X[at]), at - 1 + share
            switches.append(Switch(at, h * since, now, into, guard, share))
        else:
            x, since = np.concatenate([reset(X[at, :n_s]), X[at, n_s:]]), float(at)
            switches.append(Switch(at, h * (at - 1 + _share(beyond, k)), now, into, guard))
        stretch.begin_at(x)
        # what was flown beyond the guard counts for nothing
        now, first, entered, alive = into, at, at, samples
    return Switched(X, Y, of, alive, tuple(switches), None)


@dataclass(frozen=True)
class Passing:
    """A guard on the way from one sample to the next; before: samples from where the phase took over to where the way begins."""

    guard: Guard
    read: Read
    h: float
    before: float

    def beyond(self, x: np.ndarray, y: np.ndarray, u: np.ndarray, share: float) -> float:
        """How far beyond its limit, at state x (n_x,), outputs y (n_y,), inputs u (n_u,), so far along the way."""
        seen = dict(self.read(x[None], y[None], u[None])) | {"time_in_phase": np.array([(self.before + share) * self.h])}
        return self.guard.beyond(seen)[0]


def unchanged(x: np.ndarray) -> np.ndarray:
    """The reset of a phase without one."""
    return x


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
