"""Sensor faults: signals that stand still while the kite flies, drop to a fixed value, or end at a limit. Found, then marked invalid."""

from dataclasses import dataclass, replace

import numpy as np

from awescli.flightlog.log import FlightLog, runs_of
from awescli.flightlog.spikes import usual
from awescli.notation.quantities import ANGLES

STUCK = 1.0
"""s without any change: no flight sensor with noise stands still for so long."""

UNUSUAL = 10.0
"""A standstill must be so many times longer than the signal's usual one, since slow sensors repeat their value by nature."""

MOVING = 5.0
"""m/s over ground: below, on the launcher, a sensor may well stand still."""

DEAD = 0.5
"""A signal that is stuck for more than this share of the moving time is left out instead of making the whole flight invalid."""

REELING = 0.2
"""m/s of reel-out speed: above, the tether length cannot stand still."""

DROPPED = 3
"""Samples in a row at one value that a signal leaps to and from: a sensor that reports its null instead of nothing."""

LEAP = 5.0
"""A leap is so many times larger than 99 % of the signal's steps, ..."""

LEAP_SHARE = 0.2
"""... and this share of the range in which 98 % of the signal lies."""

SATURABLE = {"tension": (1,), "p": (-1, 1), "q": (-1, 1), "r": (-1, 1), "a_x": (-1, 1), "a_y": (-1, 1), "a_z": (-1, 1), "V_a": (1,)}
"""Signal -> ends of its range at which it may saturate (+1 the upper; a slack line's zero tension is no fault)."""

PLATEAU = 3
"""Samples in a row at the extreme value, several times over: noise does not do that."""

MIN_SATURATED = 10
"""Samples in such plateaus in all."""


@dataclass(frozen=True)
class Fault:
    """Something wrong with one signal: kind "stuck", "dead", "dropout" or "saturated"; bounds (K, 2) half-open ranges; a sentence."""

    signal: str
    kind: str
    bounds: np.ndarray
    sentence: str


def find_faults(log: FlightLog) -> list[Fault]:
    """Faults of the measured signals and of the tether length, in the order of the log."""
    moving = _moving(log)
    faults = []
    for name, signal in log.measured.items():
        faults += [*_stuck(log, name, moving), *_dropouts(log, name)]
        for side in SATURABLE.get(name, ()):
            if (runs := _plateaus(signal, side)).size:
                count = int((runs[:, 1] - runs[:, 0]).sum())
                at = signal.max() if side > 0 else signal.min()
                faults.append(Fault(name, "saturated", runs, f"{name} is cut off at {at:.4g} in {count} samples; marked invalid."))
    if "tether_length" in log and "reel_out_speed" in log:
        faults += [*_stuck(log, "tether_length", np.abs(log["reel_out_speed"]) > REELING), *_dropouts(log, "tether_length")]
    return faults


def _stuck(log: FlightLog, name: str, moving: np.ndarray) -> list[Fault]:
    """The stretches in which a signal stands still though it should not; "dead" where they are most of the time."""
    if not moving.any():
        return []
    stuck = _standstills(log[name], log.dt)
    stuck = np.array([b for b in stuck if moving[b[0] : b[1]].mean() > 0.5 and log.valid[b[0] : b[1]].mean() > 0.5], int).reshape(-1, 2)
    long = float((stuck[:, 1] - stuck[:, 0]).sum() * log.dt)
    if long > DEAD * moving.sum() * log.dt > 0 and name in log.measured:
        return [Fault(name, "dead", stuck, f"{name} stands still for {long:.1f} s, most of the flight; it was left out.")]
    if not len(stuck):
        return []
    return [Fault(name, "stuck", stuck, f"{name} stands still for {long:.1f} s ({_times(log, stuck)}); marked invalid.")]


def _dropouts(log: FlightLog, name: str) -> list[Fault]:
    """Short stretches at one value that the signal leaps to and from, at the ends of the log on the one side that there is: a recorder that
    runs before its sensors do writes zeros."""
    signal = log[name]
    step = np.abs(np.diff(signal))
    step = np.minimum(step, 2 * np.pi - step) if name in ANGLES else step
    low, high = usual(signal, (0.01, 0.99))
    leap = max(LEAP * usual(step, 0.99), LEAP_SHARE * (high - low))
    bounds = _constant(signal)
    bounds = bounds[(bounds[:, 1] - bounds[:, 0] >= DROPPED)]
    step = np.r_[np.inf, step, np.inf]
    bounds = bounds[(step[bounds[:, 0]] > leap) & (step[bounds[:, 1]] > leap)] if leap > 0 else bounds[:0]
    if not len(bounds):
        return []
    values = ", ".join(sorted({f"{signal[first]:.4g}" for first, _ in bounds})[:3])
    sentence = f"{name} jumps to {values} and back ({_times(log, bounds)}); marked invalid."
    # on a clock that had to be interpolated the samples beside it are mixtures
    return [Fault(name, "dropout", np.clip(bounds + [-1, 1], 0, len(log)), sentence)]


def _times(log: FlightLog, bounds: np.ndarray) -> str:
    """How often, and where first: "2 times, first at 312.4 s"."""
    return f"{len(bounds)} times, first at {log.time[bounds[0, 0]]:.1f} s"


def mark_faults(log: FlightLog) -> FlightLog:
    """The log without its dead signals, with stuck and saturated samples marked invalid and noted."""
    faults = find_faults(log)
    if not faults:
        return log
    valid, dead = log.valid.copy(), {f.signal for f in faults if f.kind == "dead"}
    causes = dict(log.causes)
    for fault in faults:
        if fault.signal not in dead:
            causes[f"{fault.signal} {fault.kind}"] = fault.bounds
            for first, last in fault.bounds:
                valid[first:last] = False
    return replace(
        log,
        measured={k: s for k, s in log.measured.items() if k not in dead},
        valid=valid,
        causes=causes,
        notes=(*log.notes, *(f.sentence for f in faults if f.kind == "dead" or f.signal not in dead)),
        counters={**log.counters, "faulty_samples": int((log.valid & ~valid).sum()), "dead_signals": len(dead)},
    )


def _moving(log: FlightLog) -> np.ndarray:
    """Where the kite moves, by its velocity, or else by its position; a log with neither moves nowhere."""
    for names in (("v_n", "v_e", "v_d"), ("p_n", "p_e", "p_d")):
        if all(n in log.measured for n in names):
            rates = [log[n] if names[0] == "v_n" else np.gradient(log[n], log.dt) for n in names]
            return np.sqrt(sum(x**2 for x in rates)) > MOVING
    return np.zeros(len(log), bool)


def _standstills(signal: np.ndarray, dt: float) -> np.ndarray:
    """(K, 2) ranges of unchanged value, long and unusual for this signal."""
    bounds = _constant(signal)
    length = bounds[:, 1] - bounds[:, 0]
    # the usual standstill: that of a slow or coarse sensor, half of all time is spent in shorter ones
    order = np.sort(length)
    usual = float(order[np.searchsorted(np.cumsum(order), 0.5 * signal.size)]) if length.size > 20 else 1.0
    return bounds[(length * dt >= STUCK) & (length > UNUSUAL * usual)]


def _constant(signal: np.ndarray) -> np.ndarray:
    """(K, 2) ranges of one value each, which together are the whole signal."""
    change = np.flatnonzero(np.diff(signal) != 0) + 1
    return np.column_stack([np.concatenate([[0], change]), np.concatenate([change, [signal.size]])])


def _plateaus(signal: np.ndarray, side: int) -> np.ndarray:
    """(K, 2) runs at the extreme value, short ones too; empty unless enough of them are long, which makes it a limit."""
    extreme = signal.max() if side > 0 else signal.min()
    if signal.min() == signal.max():
        return np.empty((0, 2), int)
    runs = runs_of(signal == extreme)
    length = runs[:, 1] - runs[:, 0]
    return runs if length[length >= PLATEAU].sum() >= MIN_SATURATED else np.empty((0, 2), int)
