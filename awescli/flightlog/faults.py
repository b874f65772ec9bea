"""Sensor faults: signals that stand still while the kite flies, and sensors at the end of their range. Found, then marked invalid."""

from dataclasses import dataclass, replace

import numpy as np

from awescli.flightlog.log import FlightLog

STUCK = 1.0
"""s without any change: no flight sensor with noise stands still for so long."""

UNUSUAL = 10.0
"""A standstill must be so many times longer than the signal's usual one, since slow sensors repeat their value by nature."""

MOVING = 5.0
"""m/s over ground: below, on the launcher, a sensor may well stand still."""

DEAD = 0.5
"""A signal that is stuck for more than this share of the moving time is left out instead of making the whole flight invalid."""

SATURABLE = {"tension": (1,), "p": (-1, 1), "q": (-1, 1), "r": (-1, 1), "a_x": (-1, 1), "a_y": (-1, 1), "a_z": (-1, 1), "V_a": (1,)}
"""Signal -> ends of its range at which it may saturate (+1 the upper; a slack line's zero tension is no fault)."""

PLATEAU = 3
"""Samples in a row at the extreme value, several times over: noise does not do that."""

MIN_SATURATED = 10
"""Samples at the extreme value in all."""


@dataclass(frozen=True)
class Fault:
    """Something wrong with one signal: kind "stuck", "dead" or "saturated"; bounds (K, 2) half-open sample ranges; a sentence."""

    signal: str
    kind: str
    bounds: np.ndarray
    sentence: str


def find_faults(log: FlightLog) -> list[Fault]:
    """Faults of the measured signals, in the order of the log."""
    moving = _moving(log)
    faults = []
    for name, signal in log.measured.items():
        stuck = _standstills(signal, log.dt) if moving.any() else np.empty((0, 2), int)
        stuck = np.array([b for b in stuck if moving[b[0] : b[1]].mean() > 0.5 and log.valid[b[0] : b[1]].mean() > 0.5], int).reshape(-1, 2)
        long = float((stuck[:, 1] - stuck[:, 0]).sum() * log.dt)
        if long > DEAD * moving.sum() * log.dt > 0:
            faults.append(Fault(name, "dead", stuck, f"{name} stands still for {long:.1f} s, most of the flight; it was left out."))
        elif stuck.size:
            faults.append(Fault(name, "stuck", stuck, f"{name} stands still for {long:.1f} s ({len(stuck)} times); marked invalid."))
        for side in SATURABLE.get(name, ()):
            if (runs := _plateaus(signal, side)).size:
                count = int((runs[:, 1] - runs[:, 0]).sum())
                at = signal.max() if side > 0 else signal.min()
                faults.append(Fault(name, "saturated", runs, f"{name} is cut off at {at:.4g} in {count} samples; marked invalid."))
    return faults


def mark_faults(log: FlightLog) -> FlightLog:
    """The log without its dead signals, with stuck and saturated samples marked invalid and noted."""
    faults = find_faults(log)
    if not faults:
        return log
    valid, dead = log.valid.copy(), {f.signal for f in faults if f.kind == "dead"}
    for fault in faults:
        if fault.signal not in dead:
            for first, last in fault.bounds:
                valid[first:last] = False
    return replace(
        log,
        measured={k: s for k, s in log.measured.items() if k not in dead},
        valid=valid,
        notes=(*log.notes, *(f.sentence for f in faults if f.kind == "dead" or f.signal not in dead)),
        counters={**log.counters, "faulty_samples": int((log.valid & ~valid).sum()), "dead_signals": len(dead)},
    )


def runs_of(mask: np.ndarray) -> np.ndarray:
    """Half-open (first, last) ranges in which `mask` is True, (K, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return edges.reshape(-1, 2)


def _moving(log: FlightLog) -> np.ndarray:
    """Where the kite moves, by its velocity, or else by its position; a log with neither moves nowhere."""
    for names in (("v_n", "v_e", "v_d"), ("p_n", "p_e", "p_d")):
        if all(n in log.measured for n in names):
            rates = [log[n] if names[0] == "v_n" else np.gradient(log[n], log.dt) for n in names]
            return np.sqrt(sum(x**2 for x in rates)) > MOVING
    return np.zeros(len(log), bool)


def _standstills(signal: np.ndarray, dt: float) -> np.ndarray:
    """(K, 2) ranges of unchanged value, long and unusual for this signal."""
    change = np.flatnonzero(np.diff(signal) != 0) + 1
    bounds = np.column_stack([np.concatenate([[0], change]), np.concatenate([change, [signal.size]])])
    length = bounds[:, 1] - bounds[:, 0]
    # the usual standstill: that of a slow or coarse sensor, half of all time is spent in shorter ones
    order = np.sort(length)
    usual = float(order[np.searchsorted(np.cumsum(order), 0.5 * signal.size)]) if length.size > 20 else 1.0
    return bounds[(length * dt >= STUCK) & (length > UNUSUAL * usual)]


def _plateaus(signal: np.ndarray, side: int) -> np.ndarray:
    """(K, 2) runs at the extreme value, empty unless there are enough of them to be a limit."""
    extreme = signal.max() if side > 0 else signal.min()
    if signal.min() == signal.max():
        return np.empty((0, 2), int)
    runs = runs_of(signal == extreme)
    runs = runs[runs[:, 1] - runs[:, 0] >= PLATEAU]
    return runs if (runs[:, 1] - runs[:, 0]).sum() >= MIN_SATURATED else np.empty((0, 2), int)
